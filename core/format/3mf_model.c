#include "format/3mf_model.h"

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/memory.h"

void orb_3mf_model_init(orb_3mf_model *model, orb_context *ctx, size_t file_size) {
  *model = (orb_3mf_model){.ctx = ctx, .limit = (int64_t)file_size + ORB_3MF_FREE};
}

void orb_3mf_model_free(orb_3mf_model *model) {
  void *blocks[] = {model->positions, model->triangles, model->components, model->items,
                    model->resources, model->materials, model->slots};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    orb_free(model->ctx, blocks[i]);
  }
  *model = (orb_3mf_model){.ctx = model->ctx};
}

orb_status orb_3mf_count(orb_3mf_model *model, int64_t elements) {
  model->counted += elements;
  if (model->counted > model->limit) {
    return orb_fail(model->ctx, ORB_E_TOO_LARGE,
                    "The 3MF file has, or shows by its items and components, more than its size justifies; export one "
                    "object alone.");
  }
  return ORB_OK;
}

/* The slot of a resource, or the free one in which it belongs. */
static int32_t *slot_of(const orb_3mf_model *model, int32_t part, int64_t id) {
  const int64_t key[2] = {part, id};
  uint64_t at = orb_hash(model->ctx, key, sizeof key) % (uint64_t)model->slot_count;
  while (model->slots[at]) {
    const orb_3mf_resource *there = &model->resources[model->slots[at] - 1];
    if (there->part == part && there->id == id) {
      break;
    }
    at = (at + 1) % (uint64_t)model->slot_count;
  }
  return &model->slots[at];
}

/* Keeps half of the slots free. */
static orb_status widen_slots(orb_3mf_model *model) {
  if (2 * (model->resource_count + 1) <= model->slot_count) {
    return ORB_OK;
  }
  int64_t wanted = model->slot_count ? 2 * model->slot_count : 64;
  int32_t *slots = ORB_NEW0(model->ctx, int32_t, wanted);
  if (!slots) {
    return ORB_E_NO_MEMORY;
  }
  orb_free(model->ctx, model->slots);
  model->slots = slots;
  model->slot_count = wanted;
  for (int64_t i = 0; i < model->resource_count; i++) {
    *slot_of(model, model->resources[i].part, model->resources[i].id) = (int32_t)i + 1;
  }
  return ORB_OK;
}

orb_status orb_3mf_add(orb_3mf_model *model, int32_t part, int64_t id, orb_3mf_kind kind, int64_t line) {
  ORB_TRY(orb_3mf_count(model, 4)); /* it takes as much memory as four vertices and triangles */
  ORB_TRY(widen_slots(model));
  ORB_TRY(orb_build_grow(model->ctx, &model->resources, &model->resource_room, model->resource_count + 1,
                         sizeof *model->resources));
  int32_t *slot = slot_of(model, part, id);
  if (*slot) {
    return orb_build_malformed(model->ctx, 1, line, "The 3MF file has two resources of the id %lld.", (long long)id);
  }
  model->resources[model->resource_count++] =
      (orb_3mf_resource){.id = id,
                         .part = part,
                         .kind = kind,
                         .material = -1,
                         .vertex = model->vertex_count,
                         .triangle = model->triangle_count,
                         .first = kind == ORB_3MF_OBJECT ? model->component_count : model->material_count};
  *slot = (int32_t)model->resource_count;
  return ORB_OK;
}

orb_3mf_resource *orb_3mf_find(const orb_3mf_model *model, int32_t part, int64_t id) {
  int32_t found = model->slot_count ? *slot_of(model, part, id) : 0;
  return found ? &model->resources[found - 1] : NULL;
}
