#include "carry/corner_blend.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"

enum { CHECK_EVERY = 65536 }; /* corners between two checks for cancellation */

static int make_blend(const orb_mesh *given, const orb_aligned_shape *shape, const int32_t *corners, int64_t h,
                      orb_corner_blend *out) {
  orb_place place = {.triangle = (int32_t)(h / 3)}, before, file;
  place.at[h % 3] = 1;
  orb_place_before(given, shape, &place, &before);
  orb_place_in_file(given, corners, &before, &file);
  if (file.triangle < 0) {
    return 0;
  }
  for (int k = 0; k < 3; k++) {
    out->vertex[k] = corners[3 * (int64_t)file.triangle + k];
    out->weight[k] = file.at[k];
  }
  return 1;
}

/* Gives corners without a blend that of a neighbour, ring by ring. known: per vertex a corner with a blend, or −1. */
static orb_status spread(orb_context *ctx, const orb_mesh *mesh, int64_t *known, int64_t *open, int64_t count,
                         orb_corner_blend *blends) {
  while (count > 0) {
    int64_t left = 0;
    for (int64_t i = 0; i < count; i++) {
      int64_t h = open[i], from = known[mesh->triangles[h]];
      if (from >= 0) {
        blends[h] = blends[from];
      } else {
        open[left++] = h;
      }
    }
    if (left == 0) {
      break;
    }
    int64_t reached = 0;
    for (int64_t i = 0; i < left; i++) {
      int32_t h = (int32_t)open[i], next = mesh->triangles[orb_next(h)], last = mesh->triangles[orb_prev(h)];
      int64_t from = known[next] >= 0 ? known[next] : known[last];
      if (from >= 0) {
        blends[h] = blends[from];
        reached++;
      }
      open[i] = from >= 0 ? -1 - (int64_t)h : (int64_t)h;
    }
    for (int64_t i = 0; i < left;
         i++) { /* only now, so that a corner of this ring does not serve others of the same ring */
      if (open[i] < 0) {
        open[i] = -1 - open[i];
        known[mesh->triangles[open[i]]] = open[i];
      }
    }
    if (reached == 0) {
      break; /* no corner of the shape has a blend */
    }
    count = left;
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

orb_status orb_corner_blends_create(orb_context *ctx, const orb_mesh *given, const orb_aligned_shape *shape,
                                    const int32_t *corners, orb_corner_blend **out) {
  const orb_mesh *mesh = &shape->mesh;
  int64_t count = 3 * (int64_t)mesh->triangle_count, open_count = 0;
  orb_corner_blend *blends = ORB_NEW0(ctx, orb_corner_blend, count);
  int64_t *known = ORB_NEW(ctx, int64_t, mesh->vertex_count), *open = ORB_NEW(ctx, int64_t, count);
  orb_status status = blends && known && open ? ORB_OK : ORB_E_NO_MEMORY;
  *out = blends;
  for (int32_t v = 0; status == ORB_OK && v < mesh->vertex_count; v++) {
    known[v] = -1;
  }
  for (int64_t h = 0; status == ORB_OK && h < count; h++) {
    if (make_blend(given, shape, corners, h, &blends[h])) {
      int64_t *first = &known[mesh->triangles[h]];
      *first = *first < 0 ? h : *first;
    } else {
      open[open_count++] = h;
    }
    status = h % CHECK_EVERY == 0 ? orb_context_check(ctx) : ORB_OK;
  }
  if (status == ORB_OK) {
    status = spread(ctx, mesh, known, open, open_count, blends);
  }
  orb_free(ctx, known);
  orb_free(ctx, open);
  if (status != ORB_OK) {
    orb_free(ctx, blends);
    *out = NULL;
  }
  return status;
}

void orb_corner_blends_apply(const orb_corner_blend *blends, int64_t count, const float *values, int32_t width,
                             float *out) {
  for (int64_t h = 0; h < count; h++) {
    for (int32_t c = 0; c < width; c++) {
      double sum = 0;
      for (int k = 0; k < 3; k++) {
        if (blends[h].weight[k] > 0) {
          sum += blends[h].weight[k] * (double)values[width * (int64_t)blends[h].vertex[k] + c];
        }
      }
      out[width * h + c] = (float)sum;
    }
  }
}
