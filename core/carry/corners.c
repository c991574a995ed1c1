#include "carry/corners.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "orbmorph/mesh.h"

/* The corners of each supermesh vertex: corner[start[v]] to before corner[start[v + 1]]. */
typedef struct fans {
  int32_t *start, *corner;
} fans;

static orb_status fans_create(orb_context *ctx, const orb_supermesh *mesh, fans *out) {
  int64_t count = 3 * (int64_t)mesh->triangle_count;
  out->start = ORB_NEW0(ctx, int32_t, (int64_t)mesh->vertex_count + 2);
  out->corner = ORB_NEW(ctx, int32_t, count);
  if (!out->start || !out->corner) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t h = 0; h < count; h++) {
    out->start[mesh->triangles[h] + 2]++;
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    out->start[v + 2] += out->start[v + 1];
  }
  for (int64_t h = 0; h < count; h++) {
    out->corner[out->start[mesh->triangles[h] + 1]++] = (int32_t)h;
  }
  return ORB_OK;
}

/* The corner at vertex a of the supermesh triangle a b c, or of a c b; −1: there is none. */
static int32_t find(const orb_supermesh *mesh, const fans *all, int32_t a, int32_t b, int32_t c) {
  for (int32_t i = all->start[a]; i < all->start[a + 1]; i++) {
    int32_t h = all->corner[i], next = mesh->triangles[orb_next(h)], last = mesh->triangles[orb_prev(h)];
    if ((next == b && last == c) || (next == c && last == b)) {
      return h;
    }
  }
  return -1;
}

orb_status orb_corners_create(orb_context *ctx, const orb_supermesh *supermesh, const int32_t *vertices,
                              int32_t vertex_count, const int32_t *triangles, int32_t triangle_count, int64_t **out) {
  fans all = {0};
  int64_t *corner = *out = ORB_NEW(ctx, int64_t, vertex_count);
  orb_status status = corner ? fans_create(ctx, supermesh, &all) : ORB_E_NO_MEMORY;
  for (int32_t g = 0; status == ORB_OK && g < vertex_count; g++) {
    corner[g] = -1;
  }
  for (int64_t h = 0; status == ORB_OK && h < 3 * (int64_t)triangle_count; h++) {
    int32_t at = (int32_t)h, g = triangles[h], b = triangles[orb_next(at)], c = triangles[orb_prev(at)];
    int on = g < vertex_count && b < vertex_count && c < vertex_count && vertices[g] >= 0 && vertices[b] >= 0 &&
             vertices[c] >= 0;
    if (on && corner[g] < 0) {
      corner[g] = find(supermesh, &all, vertices[g], vertices[b], vertices[c]);
    }
  }
  for (int32_t g = 0; status == ORB_OK && g < vertex_count; g++) {
    if (corner[g] < 0 && vertices[g] >= 0) {
      corner[g] = all.corner[all.start[vertices[g]]];
    }
  }
  orb_free(ctx, all.start);
  orb_free(ctx, all.corner);
  if (status != ORB_OK) {
    orb_free(ctx, corner);
    *out = NULL;
  }
  return status;
}
