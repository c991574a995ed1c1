/* orb_profile_write(): takes the asset apart, chooses a grid, makes the streams of each primitive, and writes them. */
#include "orbmorph/profile.h"

#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "format/bytes.h"
#include "format/gltf_write.h"
#include "profile/attribute.h"
#include "profile/codec.h"
#include "profile/emit.h"
#include "profile/grid.h"
#include "profile/normal.h"

/* The levels of the grid along the longest side. Without compression an integer takes 16 bits, however many are used;
 * with it two bits fewer save a twentieth of the asset, at an error of a twentieth of the usual tolerance. */
enum { LEVELS_QUANTIZED = 65535, LEVELS_MESHOPT = 16383 };

static const char *const names[ORB_PROFILES] = {"float", "quantized", "meshopt"};

const char *orb_profile_name(orb_profile profile) {
  return profile >= 0 && profile < ORB_PROFILES ? names[profile] : NULL;
}

typedef struct maker {
  orb_context *ctx;
  orb_source source;
  orb_grid grid;
  orb_stream *streams; /* one for each accessor */
  int only_facts;
  orb_rounding rounding; /* of what does not morph */
  double error, degrees;
} maker;

/* A primitive while its streams are made. */
typedef struct part {
  const cJSON *attributes, *targets;
  int32_t vertex_count, target_count, position, normal;
  uint32_t *order;  /* the new number of each vertex; NULL: as it is */
  float *positions; /* of the base, in the new order */
  float **deltas;   /* of the normals of each target, likewise */
} part;

static int is_accessor(const maker *m, int32_t number, int32_t count) {
  return number >= 0 && number < m->source.accessor_count && m->source.accessors[number].count == count &&
         !m->streams[number].bytes;
}

/* Reads the indices and reorders them and the vertices. */
static orb_status order_part(maker *m, const cJSON *primitive, part *p) {
  int32_t number = orb_source_number(primitive, "indices");
  if (number < 0 || number >= m->source.accessor_count || m->streams[number].bytes) {
    return orb_source_corrupt(m->ctx);
  }
  const orb_source_accessor *from = &m->source.accessors[number];
  int wide = from->component_type == ORB_GLTF_UINT;
  if ((!wide && from->component_type != ORB_GLTF_USHORT) || from->components != 1 || from->count % 3 != 0) {
    return orb_source_corrupt(m->ctx);
  }
  uint32_t *indices = ORB_NEW(m->ctx, uint32_t, from->count);
  p->order = ORB_NEW(m->ctx, uint32_t, p->vertex_count);
  orb_status status = indices && p->order ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; status == ORB_OK && i < from->count; i++) {
    const unsigned char *at = from->bytes + (size_t)i * (size_t)from->stride;
    indices[i] = wide ? orb_read_u32(at, 0) : orb_read_u16(at, 0);
    status = indices[i] < (uint32_t)p->vertex_count ? ORB_OK : orb_source_corrupt(m->ctx);
  }
  if (status == ORB_OK) {
    status = orb_codec_order(m->ctx, indices, (size_t)from->count, (size_t)p->vertex_count, p->order);
  }
  for (int32_t i = 0; status == ORB_OK && i < p->vertex_count; i++) { /* a vertex without a triangle has no number */
    status = p->order[i] < (uint32_t)p->vertex_count ? ORB_OK : orb_source_corrupt(m->ctx);
  }
  if (status != ORB_OK) {
    orb_free(m->ctx, indices);
    return status;
  }
  return orb_attribute_indices(m->ctx, indices, from->count, p->vertex_count, &m->streams[number]);
}

static orb_status make_positions(maker *m, part *p) {
  const cJSON *target;
  const orb_stream *base = &m->streams[p->position];
  p->positions = ORB_NEW(m->ctx, float, 3 * (size_t)p->vertex_count);
  float *deltas = ORB_NEW(m->ctx, float, 3 * (size_t)p->vertex_count);
  orb_status status = p->positions && deltas ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_source_floats(&m->source, p->position, p->order, p->positions);
    status = orb_grid_base(m->ctx, &m->grid, p->positions, p->vertex_count, &m->streams[p->position], &m->error);
  }
  cJSON_ArrayForEach(target, p->targets) {
    int32_t number = orb_source_number(target, "POSITION");
    status = status != ORB_OK                                         ? status
             : number >= 0 && is_accessor(m, number, p->vertex_count) ? orb_context_check(m->ctx)
                                                                      : orb_source_corrupt(m->ctx);
    if (status == ORB_OK) {
      orb_source_floats(&m->source, number, p->order, deltas);
      status = orb_grid_target(m->ctx, &m->grid, p->positions, deltas, base, &m->streams[number], &m->error);
    }
  }
  orb_free(m->ctx, deltas);
  return status;
}

/* Reads the deltas of the normals of all targets: the base depends on all of them. numbers: their accessors. */
static orb_status read_normals(maker *m, part *p, int32_t *numbers) {
  const cJSON *target;
  int32_t k = 0;
  p->deltas = ORB_NEW0(m->ctx, float *, p->target_count);
  if (!p->deltas) {
    return ORB_E_NO_MEMORY;
  }
  cJSON_ArrayForEach(target, p->targets) {
    numbers[k] = orb_source_number(target, "NORMAL");
    if (!orb_source_is_floats(&m->source, numbers[k], 3, p->vertex_count) || m->streams[numbers[k]].bytes) {
      return orb_source_corrupt(m->ctx);
    }
    p->deltas[k] = ORB_NEW(m->ctx, float, 3 * (size_t)p->vertex_count);
    if (!p->deltas[k]) {
      return ORB_E_NO_MEMORY;
    }
    orb_source_floats(&m->source, numbers[k], p->order, p->deltas[k]);
    k++;
  }
  return ORB_OK;
}

static orb_status make_normals(maker *m, part *p) {
  if (p->normal < 0) {
    return ORB_OK;
  }
  float *base = ORB_NEW(m->ctx, float, 3 * (size_t)p->vertex_count);
  int32_t *numbers = ORB_NEW(m->ctx, int32_t, p->target_count);
  orb_stream *targets = ORB_NEW0(m->ctx, orb_stream, p->target_count);
  orb_status status = base && numbers && targets ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK &&
      (!orb_source_is_floats(&m->source, p->normal, 3, p->vertex_count) || m->streams[p->normal].bytes)) {
    status = orb_source_corrupt(m->ctx);
  }
  status = status == ORB_OK ? read_normals(m, p, numbers) : status;
  if (status == ORB_OK) {
    orb_source_floats(&m->source, p->normal, p->order, base);
    status = orb_normals_encode(m->ctx, base, p->vertex_count, (const float *const *)p->deltas, p->target_count,
                                m->rounding == ORB_ROUNDING_DIGITS, &m->streams[p->normal], targets, &m->degrees);
  }
  for (int32_t k = 0; targets && k < p->target_count; k++) {
    if (status == ORB_OK && !m->streams[numbers[k]].bytes) {
      m->streams[numbers[k]] = targets[k];
    } else {
      orb_stream_free(m->ctx, &targets[k]);
    }
  }
  orb_free(m->ctx, base);
  orb_free(m->ctx, numbers);
  orb_free(m->ctx, targets);
  return status;
}

/* What else the vertices have. exact: only reordered. */
static orb_status make_others(maker *m, const part *p, const cJSON *attributes, int exact) {
  const cJSON *item;
  cJSON_ArrayForEach(item, attributes) {
    int32_t number = orb_source_number(attributes, item->string);
    orb_rounding rounding = exact                                        ? ORB_ROUNDING_NONE
                            : strncmp(item->string, "TEXCOORD_", 9) == 0 ? m->rounding
                            : strncmp(item->string, "COLOR_", 6) == 0    ? ORB_ROUNDING_UNIT
                                                                         : ORB_ROUNDING_NONE;
    if (strcmp(item->string, "POSITION") == 0 || strcmp(item->string, "NORMAL") == 0) {
      continue;
    }
    if (!is_accessor(m, number, p->vertex_count)) {
      return orb_source_corrupt(m->ctx);
    }
    ORB_TRY(orb_attribute_copy(m->ctx, &m->source, number, p->order, rounding, &m->streams[number]));
  }
  return ORB_OK;
}

static void free_part(orb_context *ctx, part *p) {
  for (int32_t k = 0; p->deltas && k < p->target_count; k++) {
    orb_free(ctx, p->deltas[k]);
  }
  orb_free(ctx, p->deltas);
  orb_free(ctx, p->positions);
  orb_free(ctx, p->order);
}

static orb_status make_part(maker *m, const cJSON *primitive) {
  part p = {.attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes"),
            .targets = cJSON_GetObjectItemCaseSensitive(primitive, "targets")};
  const cJSON *target;
  orb_status status;
  p.position = orb_source_number(p.attributes, "POSITION"); /* orb_grid_choose() has checked it */
  p.normal = orb_source_number(p.attributes, "NORMAL");
  p.target_count = cJSON_GetArraySize(p.targets);
  p.vertex_count = m->source.accessors[p.position].count;
  if (m->streams[p.position].bytes) {
    return orb_source_corrupt(m->ctx);
  }
  if (!m->only_facts) {
    ORB_GO(status, order_part(m, primitive, &p), done);
  }
  ORB_GO(status, make_positions(m, &p), done);
  ORB_GO(status, make_normals(m, &p), done);
  if (!m->only_facts) {
    ORB_GO(status, make_others(m, &p, p.attributes, 0), done);
    cJSON_ArrayForEach(target, p.targets) {
      ORB_GO(status, make_others(m, &p, target, 1), done);
    }
  }
done:
  free_part(m->ctx, &p);
  return status;
}

/* One mesh in one node, without a place of its own. Returns its primitives; NULL: something else. */
static const cJSON *primitives_of(const cJSON *document) {
  const cJSON *meshes = cJSON_GetObjectItemCaseSensitive(document, "meshes"),
              *nodes = cJSON_GetObjectItemCaseSensitive(document, "nodes"), *node = cJSON_GetArrayItem(nodes, 0);
  static const char *const places[] = {"matrix", "translation", "rotation", "scale", "skin"};
  int fine = cJSON_GetArraySize(meshes) == 1 && cJSON_GetArraySize(nodes) == 1 &&
             orb_source_number(node, "mesh") == 0 &&
             cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(document, "buffers")) == 1;
  for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
    fine = fine && !cJSON_HasObjectItem(node, places[i]);
  }
  const cJSON *primitives = cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(meshes, 0), "primitives");
  return fine && cJSON_GetArraySize(primitives) > 0 ? primitives : NULL;
}

static orb_status make_streams(maker *m, int32_t levels) {
  const cJSON *primitive, *primitives = primitives_of(m->source.document);
  m->streams = ORB_NEW0(m->ctx, orb_stream, m->source.accessor_count);
  if (!m->streams) {
    return ORB_E_NO_MEMORY;
  }
  if (!primitives) {
    return orb_source_corrupt(m->ctx);
  }
  ORB_TRY(orb_grid_choose(m->ctx, &m->source, primitives, levels, &m->grid));
  cJSON_ArrayForEach(primitive, primitives) {
    ORB_TRY(make_part(m, primitive));
  }
  return ORB_OK;
}

orb_status orb_profile_write(orb_context *ctx, const unsigned char *asset, size_t size, orb_profile profile,
                             orb_profile_facts *facts, orb_buffer *out) {
  if (profile <= ORB_PROFILE_FLOAT || profile >= ORB_PROFILES) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "An asset is written in the profile \"quantized\" or \"meshopt\".");
  }
  int packed = profile == ORB_PROFILE_MESHOPT;
  maker m = {.ctx = ctx, .only_facts = !out, .rounding = packed ? ORB_ROUNDING_DIGITS : ORB_ROUNDING_UNIT};
  orb_status status;
  ORB_GO(status, orb_source_open(ctx, asset, size, &m.source), done);
  ORB_GO(status, make_streams(&m, packed ? LEVELS_MESHOPT : LEVELS_QUANTIZED), done);
  if (facts) {
    double error = m.error + orb_grid_rounding(&m.grid);
    *facts = (orb_profile_facts){.position_error = error,
                                 .position_relative = m.grid.diagonal > 0 ? error / m.grid.diagonal : 0,
                                 .normal_degrees = m.degrees};
  }
  if (out) {
    status = orb_profile_emit(ctx, &m.source, m.streams, &m.grid, profile, out);
  }
done:
  for (int32_t a = 0; m.streams && a < m.source.accessor_count; a++) {
    orb_stream_free(ctx, &m.streams[a]);
  }
  orb_free(ctx, m.streams);
  orb_source_close(ctx, &m.source);
  return status;
}
