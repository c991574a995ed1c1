/* From corners to the vertices of the file: a vertex is a supermesh vertex, a material and one value of each wedged
 * attribute. Corners that agree in all of these share a vertex, so a smooth mesh of one material keeps the supermesh's
 * vertices. */
#include "transfer/split.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "transfer/order.h"

enum { CHECK_EVERY = 16384 }; /* triangles between two checks for cancellation */

/* The attributes that can split a vertex: per corner, the number of its value. */
typedef struct stream_list {
  int32_t count;
  const int32_t **of_corner;
} stream_list;

static void add_stream(stream_list *list, const orb_wedges *wedges) {
  if (wedges->width && wedges->of_corner) {
    list->of_corner[list->count++] = wedges->of_corner;
  }
}

static orb_status collect_streams(orb_context *ctx, const orb_draft *draft, stream_list *list) {
  list->count = 0;
  list->of_corner = ORB_NEW(ctx, const int32_t *, 2 * (int64_t)draft->frame_count + 2 + draft->options->split_count);
  if (!list->of_corner) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t f = 0; draft->normals && f < draft->frame_count; f++) {
    add_stream(list, &draft->normals[f]);
  }
  for (int32_t f = 0; f < draft->color_count; f++) {
    add_stream(list, &draft->colors[f]);
  }
  add_stream(list, &draft->texcoords);
  if (draft->tangents) {
    add_stream(list, &draft->tangents[0]); /* the frames share their corners */
  }
  for (int32_t i = 0; i < draft->options->split_count; i++) {
    if (draft->options->splits[i]) {
      list->of_corner[list->count++] = draft->options->splits[i];
    }
  }
  return ORB_OK;
}

static int same_corner(const stream_list *list, int64_t a, int64_t b) {
  for (int32_t i = 0; i < list->count; i++) {
    if (list->of_corner[i][a] != list->of_corner[i][b]) {
      return 0;
    }
  }
  return 1;
}

/* Whether a triangle of the supermesh lies in a hole that is open again, so that no part has it. */
static int is_hole(const orb_draft *draft, int64_t triangle) {
  return draft->has_holes && draft->shapes[0].mesh.source_triangle[draft->home[triangle]] == ORB_MADE_FILL;
}

int32_t orb_draft_material(const orb_draft *draft, int64_t triangle) {
  const orb_mesh *mesh = &draft->shapes[0].mesh;
  if (!mesh->material || !draft->home) {
    return 0;
  }
  int32_t material = mesh->material[draft->home[triangle]];
  return material >= 0 && material < mesh->material_count ? material : 0;
}

/* Fills a part whose material is set and whose arrays are large enough. first, next: linked lists of the part's
 * vertices that stand for one supermesh vertex; first is all −1 before and after. */
static orb_status fill_part(orb_context *ctx, const orb_draft *draft, const stream_list *list, orb_draft_part *part,
                            int32_t *first, int32_t *next) {
  const int32_t *triangles = draft->supermesh->triangles;
  int32_t made = 0;
  int64_t index = 0;
  for (int32_t t = 0; t < draft->supermesh->triangle_count; t++) {
    if (is_hole(draft, t) || orb_draft_material(draft, t) != part->material) {
      continue;
    }
    for (int k = 0; k < 3; k++) {
      int64_t corner = 3 * (int64_t)t + k;
      int32_t v = triangles[corner], found = first[v], last = -1;
      while (found >= 0 && !same_corner(list, corner, part->corners[found])) {
        last = found;
        found = next[found];
      }
      if (found < 0) {
        found = made++;
        part->corners[found] = (int32_t)corner;
        next[found] = -1;
        if (last < 0) {
          first[v] = found;
        } else {
          next[last] = found;
        }
      }
      part->indices[index++] = (uint32_t)found;
    }
    if (t % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(ctx));
    }
  }
  for (int32_t i = 0; i < made; i++) {
    first[triangles[part->corners[i]]] = -1;
  }
  part->vertex_count = made;
  return ORB_OK;
}

static orb_status order_part(orb_context *ctx, orb_draft_part *part) {
  size_t index_count = 3 * (size_t)part->triangle_count, vertex_count = (size_t)part->vertex_count;
  orb_status status = ORB_OK;
  uint32_t *remap = ORB_NEW(ctx, uint32_t, vertex_count);
  int32_t *corners = ORB_NEW(ctx, int32_t, vertex_count);
  /* meshoptimizer allocates outside the context, about 60 bytes per triangle: reserve as much from its budget. */
  void *held = orb_alloc(ctx, (size_t)part->triangle_count, 60);
  if (!remap || !corners || !held) {
    status = ORB_E_NO_MEMORY;
    goto done;
  }
  status = orb_order_for_cache(ctx, part->indices, index_count, vertex_count, remap);
  if (status != ORB_OK) {
    goto done;
  }
  for (size_t v = 0; v < vertex_count; v++) {
    ORB_ASSERT(remap[v] < vertex_count);
    corners[remap[v]] = part->corners[v];
  }
  for (size_t i = 0; i < index_count; i++) {
    part->indices[i] = remap[part->indices[i]];
  }
  memcpy(part->corners, corners, vertex_count * sizeof *corners);
done:
  orb_free(ctx, remap);
  orb_free(ctx, corners);
  orb_free(ctx, held);
  return status;
}

/* Allocates a part for each material that is used. */
static orb_status make_parts(orb_context *ctx, orb_draft *draft) {
  int32_t materials = draft->shapes[0].mesh.material_count > 0 ? draft->shapes[0].mesh.material_count : 1;
  int32_t *used = ORB_NEW0(ctx, int32_t, materials);
  draft->parts = ORB_NEW0(ctx, orb_draft_part, materials);
  orb_status status = used && draft->parts ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t t = 0; status == ORB_OK && t < draft->supermesh->triangle_count; t++) {
    used[orb_draft_material(draft, t)] += !is_hole(draft, t);
  }
  for (int32_t m = 0; status == ORB_OK && m < materials; m++) {
    if (used[m] == 0) {
      continue;
    }
    orb_draft_part *part = &draft->parts[draft->part_count++];
    part->material = m;
    part->triangle_count = used[m];
    part->indices = ORB_NEW(ctx, uint32_t, 3 * (int64_t)used[m]);
    part->corners = ORB_NEW(ctx, int32_t, 3 * (int64_t)used[m]);
    if (!part->indices || !part->corners) {
      status = ORB_E_NO_MEMORY;
    }
  }
  orb_free(ctx, used);
  return status;
}

orb_status orb_draft_split(orb_context *ctx, orb_draft *draft) {
  const orb_supermesh *supermesh = draft->supermesh;
  stream_list list = {0};
  int32_t *first = ORB_NEW(ctx, int32_t, supermesh->vertex_count);
  int32_t *next = ORB_NEW(ctx, int32_t, 3 * (int64_t)supermesh->triangle_count);
  orb_status status = first && next ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  memset(first, -1, (size_t)supermesh->vertex_count * sizeof *first);
  ORB_GO(status, collect_streams(ctx, draft, &list), done);
  ORB_GO(status, make_parts(ctx, draft), done);
  for (int32_t p = 0; p < draft->part_count; p++) {
    ORB_GO(status, fill_part(ctx, draft, &list, &draft->parts[p], first, next), done);
    ORB_GO(status, order_part(ctx, &draft->parts[p]), done);
  }
done:
  orb_free(ctx, first);
  orb_free(ctx, next);
  orb_free(ctx, list.of_corner);
  return status;
}
