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

/* The primitives that have the same vertices, while their streams are made. */
typedef struct part {
  const cJSON *first, *attributes, *targets;
  int32_t primitive_count;
  int32_t vertex_count, target_count, position, normal;
  uint32_t *order;  /* the new number of each vertex; NULL: as it is */
  float *positions; /* of the base, in the new order */
  float **deltas;   /* of the normals of each target, likewise */
} part;

static int is_accessor(const maker *m, int32_t number, int32_t count) {
  return number >= 0 && number < m->source.accessor_count && m->source.accessors[number].count == count &&
         !m->streams[number].bytes;
}

/* Reads the indices of a primitive. out: NULL: only their number. */
static orb_status read_indices(const maker *m, const cJSON *primitive, int32_t vertex_count, size_t *count,
                               uint32_t *out) {
  int32_t number = orb_source_number(primitive, "indices");
  if (number < 0 || number >= m->source.accessor_count || m->streams[number].bytes) {
    return orb_source_corrupt(m->ctx);
  }
  const orb_source_accessor *from = &m->source.accessors[number];
  int wide = from->component_type == ORB_GLTF_UINT;
  if ((!wide && from->component_type != ORB_GLTF_USHORT) || from->components != 1 || from->count % 3 != 0) {
    return orb_source_corrupt(m->ctx);
  }
  *count = (size_t)from->count;
  for (int32_t i = 0; out && i < from->count; i++) {
    const unsigned char *at = from->bytes + (size_t)i * (size_t)from->stride;
    out[i] = wide ? orb_read_u32(at, 0) : orb_read_u16(at, 0);
    if (out[i] >= (uint32_t)vertex_count) {
      return orb_source_corrupt(m->ctx);
    }
  }
  return ORB_OK;
}

/* Vertices that no triangle uses come after the others. */
static void order_unused(part *p) {
  uint32_t next = 0;
  for (int32_t v = 0; v < p->vertex_count; v++) {
    next += p->order[v] < (uint32_t)p->vertex_count;
  }
  for (int32_t v = 0; v < p->vertex_count; v++) {
    if (p->order[v] >= (uint32_t)p->vertex_count) {
      p->order[v] = next++;
    }
  }
}

/* Makes the streams of the indices from those of all primitives of the part, one after another. */
static orb_status write_indices(maker *m, const part *p, const uint32_t *all, const size_t *counts) {
  const cJSON *primitive = p->first;
  for (int32_t i = 0; i < p->primitive_count; i++, primitive = primitive->next) {
    uint32_t *own = ORB_NEW(m->ctx, uint32_t, counts[i]);
    orb_stream *stream = &m->streams[orb_source_number(primitive, "indices")];
    if (!own) {
      return ORB_E_NO_MEMORY;
    }
    memcpy(own, all, counts[i] * sizeof *own);
    all += counts[i];
    if (stream->bytes) {
      orb_free(m->ctx, own);
      return orb_source_corrupt(m->ctx);
    }
    ORB_TRY(orb_attribute_indices(m->ctx, own, (int32_t)counts[i], p->vertex_count, stream));
  }
  return ORB_OK;
}

/* Reorders the triangles of each primitive and the vertices. */
static orb_status order_part(maker *m, part *p) {
  size_t *counts = ORB_NEW(m->ctx, size_t, p->primitive_count), total = 0;
  uint32_t *all = NULL;
  orb_status status = counts ? ORB_OK : ORB_E_NO_MEMORY;
  const cJSON *primitive = p->first;
  for (int32_t i = 0; status == ORB_OK && i < p->primitive_count; i++, primitive = primitive->next) {
    status = read_indices(m, primitive, p->vertex_count, &counts[i], NULL);
    total += status == ORB_OK ? counts[i] : 0;
  }
  if (status == ORB_OK) {
    all = ORB_NEW(m->ctx, uint32_t, total);
    p->order = ORB_NEW(m->ctx, uint32_t, p->vertex_count);
    status = all && p->order ? ORB_OK : ORB_E_NO_MEMORY;
  }
  primitive = p->first;
  for (size_t i = 0, at = 0; status == ORB_OK && i < (size_t)p->primitive_count; i++, primitive = primitive->next) {
    status = read_indices(m, primitive, p->vertex_count, &counts[i], all + at);
    at += counts[i];
  }
  if (status == ORB_OK) {
    status = orb_codec_order(m->ctx, all, counts, (size_t)p->primitive_count, (size_t)p->vertex_count, p->order);
  }
  if (status == ORB_OK) {
    order_unused(p);
    status = write_indices(m, p, all, counts);
  }
  orb_free(m->ctx, counts);
  orb_free(m->ctx, all);
  return status;
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

static orb_status make_part(maker *m, const cJSON *primitive, int32_t primitive_count) {
  part p = {.first = primitive,
            .attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes"),
            .targets = cJSON_GetObjectItemCaseSensitive(primitive, "targets"),
            .primitive_count = primitive_count};
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
    ORB_GO(status, order_part(m, &p), done);
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

/* Whether two primitives have the same accessors of vertices. */
static int shares_vertices(const cJSON *a, const cJSON *b) {
  static const char *const members[] = {"attributes", "targets"};
  for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
    const cJSON *of_a = cJSON_GetObjectItemCaseSensitive(a, members[i]),
                *of_b = cJSON_GetObjectItemCaseSensitive(b, members[i]);
    if ((of_a || of_b) && !cJSON_Compare(of_a, of_b, 1)) {
      return 0;
    }
  }
  return 1;
}

static orb_status make_parts(maker *m, const cJSON *primitives) {
  const cJSON *first = cJSON_GetArrayItem(primitives, 0), *primitive;
  int shared = first->next && shares_vertices(first, first->next);
  cJSON_ArrayForEach(primitive, primitives) {
    if (!shared || primitive == first) {
      ORB_TRY(make_part(m, primitive, shared ? cJSON_GetArraySize(primitives) : 1));
    } else if (!shares_vertices(first, primitive)) { /* all share them, or none: see orb_asset_write_template() */
      return orb_source_corrupt(m->ctx);
    }
  }
  return ORB_OK;
}

static orb_status make_streams(maker *m, int32_t levels) {
  const cJSON *primitives = primitives_of(m->source.document);
  m->streams = ORB_NEW0(m->ctx, orb_stream, m->source.accessor_count);
  if (!m->streams) {
    return ORB_E_NO_MEMORY;
  }
  if (!primitives) {
    return orb_source_corrupt(m->ctx);
  }
  ORB_TRY(orb_grid_choose(m->ctx, &m->source, primitives, levels, &m->grid));
  return make_parts(m, primitives);
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
