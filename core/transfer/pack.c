/* Packs a finished draft into glTF accessors: each has its own buffer view, at a multiple of four bytes. Bounds are
 * computed from the float32 values that are written. */
#include "transfer/pack.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "format/gltf_write.h"
#include "transfer/materials.h"
#include "transfer/names.h"

/* The animation, in seconds: how long a shape stays, and how long the way to the next one takes. */
static const double HOLD = 0.5, MOVE = 1.5;

typedef struct packer {
  orb_context *ctx;
  const orb_draft *draft;
  orb_buffer binary;
  orb_gltf_accessor *accessors;
  int32_t accessor_count, accessor_capacity;
  float *scratch; /* 4 per vertex of the largest part */
} packer;

static orb_status align_binary(packer *pack) {
  static const unsigned char zeros[4];
  return orb_buffer_append(pack->ctx, &pack->binary, zeros, (4 - pack->binary.size % 4) % 4);
}

static orb_status add_accessor(packer *pack, const void *bytes, size_t size, int32_t count, int32_t components,
                               int32_t type, int32_t target, int32_t *out) {
  ORB_ASSERT(pack->accessor_count < pack->accessor_capacity && count > 0);
  ORB_TRY(align_binary(pack));
  *out = pack->accessor_count;
  pack->accessors[pack->accessor_count++] = (orb_gltf_accessor){.offset = pack->binary.size,
                                                                .length = size,
                                                                .count = count,
                                                                .components = components,
                                                                .component_type = type,
                                                                .target = target};
  return orb_buffer_append(pack->ctx, &pack->binary, bytes, size);
}

/* Adds count × components floats; bounded: with their minimum and maximum. */
static orb_status add_floats(packer *pack, const float *values, int32_t count, int32_t components, int32_t target,
                             int bounded, int32_t *out) {
  ORB_TRY(add_accessor(pack, values, (size_t)count * (size_t)components * sizeof *values, count, components,
                       ORB_GLTF_FLOAT, target, out));
  orb_gltf_accessor *accessor = &pack->accessors[*out];
  accessor->bounded = bounded;
  for (int32_t c = 0; bounded && c < components; c++) {
    float least = FLT_MAX, greatest = -FLT_MAX;
    for (int32_t i = 0; i < count; i++) {
      float value = values[(int64_t)components * i + c];
      least = value < least ? value : least;
      greatest = value > greatest ? value : greatest;
    }
    accessor->min[c] = (double)least;
    accessor->max[c] = (double)greatest;
  }
  return ORB_OK;
}

static orb_status add_indices(packer *pack, const orb_draft_part *part, int32_t *out) {
  int32_t count = 3 * part->triangle_count;
  if (part->vertex_count > 65535) {
    return add_accessor(pack, part->indices, (size_t)count * sizeof *part->indices, count, 1, ORB_GLTF_UINT,
                        ORB_GLTF_ELEMENT_ARRAY_BUFFER, out);
  }
  uint16_t *narrow = ORB_NEW(pack->ctx, uint16_t, count);
  if (!narrow) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    narrow[i] = (uint16_t)part->indices[i];
  }
  orb_status status = add_accessor(pack, narrow, (size_t)count * sizeof *narrow, count, 1, ORB_GLTF_USHORT,
                                   ORB_GLTF_ELEMENT_ARRAY_BUFFER, out);
  orb_free(pack->ctx, narrow);
  return status;
}

static orb_status add_positions(packer *pack, const orb_draft_part *part, const float *values, int32_t *out) {
  const int32_t *triangles = pack->draft->supermesh->triangles;
  for (int32_t i = 0; i < part->vertex_count; i++) {
    memcpy(pack->scratch + 3 * (int64_t)i, values + 3 * (int64_t)triangles[part->corners[i]], 3 * sizeof(float));
  }
  return add_floats(pack, pack->scratch, part->vertex_count, 3, ORB_GLTF_ARRAY_BUFFER, 1, out);
}

/* Adds the values of a wedged attribute, minus those of `from` unless it is NULL. */
static orb_status add_wedges(packer *pack, const orb_draft_part *part, const orb_wedges *wedges, const orb_wedges *from,
                             int32_t *out) {
  const int32_t *triangles = pack->draft->supermesh->triangles;
  int32_t width = wedges->width;
  for (int32_t i = 0; i < part->vertex_count; i++) {
    const float *value = wedges->values + (int64_t)width * orb_wedge_of(wedges, triangles, part->corners[i]);
    const float *minus = from ? from->values + (int64_t)width * orb_wedge_of(from, triangles, part->corners[i]) : NULL;
    for (int32_t c = 0; c < width; c++) {
      pack->scratch[(int64_t)width * i + c] = minus ? value[c] - minus[c] : value[c];
    }
  }
  return add_floats(pack, pack->scratch, part->vertex_count, width, ORB_GLTF_ARRAY_BUFFER, 0, out);
}

static orb_status add_vertices(packer *pack, const orb_draft_part *part, orb_gltf_primitive *primitive,
                               orb_gltf_attributes *targets) {
  const orb_draft *draft = pack->draft;
  primitive->base = (orb_gltf_attributes){-1, -1, -1, -1, -1};
  ORB_TRY(add_positions(pack, part, draft->base, &primitive->base.position));
  if (draft->normals) {
    ORB_TRY(add_wedges(pack, part, &draft->normals[0], NULL, &primitive->base.normal));
  }
  int has_tangents = draft->tangents && orb_material_tangents(&draft->shapes[0].mesh, part->material, draft->options);
  if (has_tangents) {
    ORB_TRY(add_wedges(pack, part, &draft->tangents[0], NULL, &primitive->base.tangent));
  }
  if (draft->texcoords.width) {
    ORB_TRY(add_wedges(pack, part, &draft->texcoords, NULL, &primitive->base.texcoord));
  }
  if (draft->color_count > 0) {
    ORB_TRY(add_wedges(pack, part, &draft->colors[0], NULL, &primitive->base.color));
  }
  for (int32_t f = 1; f < draft->frame_count; f++) {
    targets[f - 1] = (orb_gltf_attributes){-1, -1, -1, -1, -1};
    ORB_TRY(add_positions(pack, part, draft->deltas[f - 1], &targets[f - 1].position));
    if (draft->normals) {
      ORB_TRY(add_wedges(pack, part, &draft->normals[f], &draft->normals[0], &targets[f - 1].normal));
    }
    if (has_tangents) {
      ORB_TRY(add_wedges(pack, part, &draft->tangents[f], NULL, &targets[f - 1].tangent));
    }
    if (draft->color_count > 1) {
      ORB_TRY(add_wedges(pack, part, &draft->colors[f], &draft->colors[0], &targets[f - 1].color));
    }
    ORB_TRY(orb_context_check(pack->ctx));
  }
  return ORB_OK;
}

/* Adds a part. Parts that share their vertices have the accessors of the first one. */
static orb_status add_part(packer *pack, int32_t number, orb_gltf_primitive *primitives, orb_gltf_attributes *targets) {
  const orb_draft *draft = pack->draft;
  const orb_draft_part *part = &draft->parts[number];
  orb_gltf_primitive *primitive = &primitives[number];
  int64_t target_count = draft->frame_count - 1;
  primitive->material = draft->shapes[0].mesh.material_count > 0 ? part->material : 0;
  primitive->targets = targets + number * target_count;
  ORB_TRY(add_indices(pack, part, &primitive->indices));
  if (number == 0 || !draft->shares_vertices) {
    return add_vertices(pack, part, primitive, targets + number * target_count);
  }
  primitive->base = primitives[0].base;
  memcpy(targets + number * target_count, targets, (size_t)target_count * sizeof *targets);
  return ORB_OK;
}

int32_t orb_draft_keys(const orb_draft *draft, int32_t *frames, double *times) {
  int32_t count = 0, legs = 2 * (draft->shape_count - 1);
  int32_t steps = draft->between_count > 0 ? draft->options->path_steps : 0;
  for (int32_t leg = 0; leg <= legs; leg++) {
    int32_t shape = leg < draft->shape_count ? leg : legs - leg;
    double start = leg * (HOLD + MOVE);
    for (int32_t k = -1; k <= steps && !(leg == legs && k >= 0); k++) {
      int forth = leg < draft->shape_count - 1;
      int32_t gap = forth ? shape : shape - 1, step = forth ? k - 1 : steps - k;
      if (frames) {
        frames[count] = k <= 0 ? shape : draft->shape_count + gap * steps + step;
        times[count] = k < 0 ? start : start + HOLD + MOVE * k / (steps + 1);
      }
      count++;
    }
  }
  return count;
}

static orb_status add_animation(packer *pack, orb_gltf_scene *scene) {
  const orb_draft *draft = pack->draft;
  int32_t keys = orb_draft_keys(draft, NULL, NULL), targets = draft->frame_count - 1;
  int32_t *frames = ORB_NEW(pack->ctx, int32_t, keys);
  double *times = ORB_NEW(pack->ctx, double, keys);
  float *values = ORB_NEW0(pack->ctx, float, ((int64_t)keys * targets));
  float *seconds = ORB_NEW(pack->ctx, float, keys);
  orb_status status = frames && times && values && seconds ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    orb_draft_keys(draft, frames, times);
    for (int32_t k = 0; k < keys; k++) {
      seconds[k] = (float)times[k];
      if (frames[k] > 0) {
        values[(int64_t)k * targets + frames[k] - 1] = 1;
      }
    }
    ORB_GO(status, add_floats(pack, seconds, keys, 1, 0, 1, &scene->times), done);
    ORB_GO(status, add_floats(pack, values, keys * targets, 1, 0, 0, &scene->weights), done);
  }
done:
  orb_free(pack->ctx, frames);
  orb_free(pack->ctx, times);
  orb_free(pack->ctx, values);
  orb_free(pack->ctx, seconds);
  return status;
}

/* The members of mesh.extras besides targetNames. */
static int32_t make_extras(const orb_asset_facts *facts, const orb_draft *draft, orb_gltf_extra extras[4]) {
  int32_t count = 0;
  extras[count++] = (orb_gltf_extra){"morphedAttributes", NULL, facts->morphed_attributes};
  if (draft->between_count > 0) {
    extras[count++] = (orb_gltf_extra){"inBetweens", NULL, draft->options->path_steps};
  }
  if (facts->nudged_vertices > 0) {
    extras[count++] = (orb_gltf_extra){"nudgedVertices", NULL, facts->nudged_vertices};
  }
  if (facts->morphed_attributes > 8) {
    extras[count++] = (orb_gltf_extra){"note",
                                       "A client need support only 8 morphed attributes at once; this mesh has more. "
                                       "At most two targets are shown at a time.",
                                       0};
  }
  return count;
}

static orb_status write_scene(packer *pack, orb_gltf_scene *scene, orb_gltf_primitive *primitives,
                              orb_gltf_attributes *targets, orb_asset_facts *facts, orb_buffer *out) {
  const orb_draft *draft = pack->draft;
  *facts = (orb_asset_facts){
      .primitive_count = draft->part_count, .target_count = draft->frame_count - 1, .nudged_vertices = draft->nudged};
  for (int32_t p = 0; p < draft->part_count; p++) {
    ORB_TRY(add_part(pack, p, primitives, targets));
    facts->vertex_count += draft->parts[p].vertex_count;
    facts->triangle_count += draft->parts[p].triangle_count;
    orb_progress(pack->ctx, "write", 0.5 + 0.4 * (p + 1) / draft->part_count);
  }
  int per_target = 1 + (draft->normals ? 1 : 0) + (draft->tangents ? 1 : 0) + (draft->color_count > 1 ? 1 : 0);
  facts->morphed_attributes = per_target * facts->target_count;
  scene->primitives = primitives;
  scene->primitive_count = draft->part_count;
  scene->target_count = facts->target_count;
  if (draft->options->animation == ORB_ANIMATION_PINGPONG) {
    ORB_TRY(add_animation(pack, scene));
  }
  scene->accessors = pack->accessors;
  scene->accessor_count = pack->accessor_count;
  orb_gltf_extra extras[4];
  scene->extra_count = make_extras(facts, draft, extras);
  scene->extras = extras;
  return orb_gltf_write(pack->ctx, scene, &pack->binary, out);
}

orb_status orb_draft_write(orb_context *ctx, const orb_draft *draft, const char *const *names, orb_asset_facts *facts,
                           orb_buffer *out) {
  packer pack = {.ctx = ctx, .draft = draft, .accessor_capacity = 2 + draft->part_count * (6 + 4 * draft->frame_count)};
  orb_gltf_scene scene = {.times = -1, .weights = -1};
  int32_t widest = 0;
  for (int32_t p = 0; p < draft->part_count; p++) {
    widest = draft->parts[p].vertex_count > widest ? draft->parts[p].vertex_count : widest;
  }
  pack.accessors = ORB_NEW(ctx, orb_gltf_accessor, pack.accessor_capacity);
  pack.scratch = ORB_NEW(ctx, float, 4 * (int64_t)widest);
  orb_gltf_primitive *primitives = ORB_NEW(ctx, orb_gltf_primitive, draft->part_count);
  orb_gltf_attributes *targets =
      ORB_NEW(ctx, orb_gltf_attributes, (int64_t)draft->part_count * (draft->frame_count - 1));
  orb_draft_materials materials = {0};
  orb_target_name *texts = ORB_NEW0(ctx, orb_target_name, draft->frame_count);
  const char **all_names = ORB_NEW(ctx, const char *, draft->frame_count);
  orb_status status = ORB_E_NO_MEMORY;
  if (pack.accessors && pack.scratch && primitives && targets && texts && all_names) {
    scene.name = texts[0];
    scene.target_names = all_names + 1;
    status = orb_draft_names(ctx, draft, names, texts, all_names);
    if (status == ORB_OK) {
      status = orb_draft_materials_add(ctx, draft, &pack.binary, &materials, &scene);
    }
    if (status == ORB_OK) {
      status = write_scene(&pack, &scene, primitives, targets, facts, out);
    }
  }
  orb_buffer_free(ctx, &pack.binary);
  orb_free(ctx, pack.accessors);
  orb_free(ctx, pack.scratch);
  orb_free(ctx, primitives);
  orb_free(ctx, targets);
  orb_draft_materials_free(ctx, &materials);
  orb_free(ctx, texts);
  orb_free(ctx, all_names);
  return status;
}
