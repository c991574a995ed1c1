#include "align/map/twist/patch.h"

#include <math.h>
#include <string.h>

#include "base/forest.h"
#include "base/memory.h"
#include "numeric/vec3.h"

orb_status orb_map_patch_create(orb_context *ctx, const orb_map_surface *b, orb_map_patch *patch) {
  const size_t n = (size_t)b->vertex_count;
  *patch = (orb_map_patch){.ctx = ctx, .b = b};
  patch->inside = ORB_NEW0(ctx, unsigned char, n);
  patch->next = ORB_NEW0(ctx, unsigned char, n);
  patch->reached = ORB_NEW0(ctx, unsigned char, n);
  patch->joined = ORB_NEW(ctx, int32_t, n);
  patch->corner = ORB_NEW(ctx, int32_t, n);
  patch->rim = ORB_NEW(ctx, int32_t, n);
  if (!patch->inside || !patch->next || !patch->reached || !patch->joined || !patch->corner || !patch->rim) {
    orb_map_patch_free(patch);
    return ORB_E_NO_MEMORY;
  }
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    patch->corner[b->triangles[h]] = h;
  }
  return ORB_OK;
}

void orb_map_patch_free(orb_map_patch *patch) {
  orb_free(patch->ctx, patch->inside);
  orb_free(patch->ctx, patch->next);
  orb_free(patch->ctx, patch->reached);
  orb_free(patch->ctx, patch->joined);
  orb_free(patch->ctx, patch->corner);
  orb_free(patch->ctx, patch->rim);
  memset(patch, 0, sizeof *patch);
}

void orb_map_patch_join(orb_map_patch *patch, const unsigned char *flag, int value) {
  const orb_map_surface *b = patch->b;
  orb_forest_plant(patch->joined, b->vertex_count);
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    int32_t v = b->triangles[h], u = b->triangles[orb_next(h)];
    if (flag[v] == value && flag[u] == value) {
      orb_forest_join(patch->joined, v, u);
    }
  }
  for (int32_t v = 0; v < b->vertex_count; v++) {
    patch->joined[v] = orb_forest_root(patch->joined, v);
  }
}

double orb_map_patch_share(const orb_map_patch *patch) {
  const orb_map_surface *b = patch->b;
  double area = 0;
  for (int32_t t = 0; t < b->triangle_count; t++) {
    const int32_t *v = b->triangles + 3 * (size_t)t;
    if (patch->inside[v[0]] && patch->inside[v[1]] && patch->inside[v[2]]) {
      area += orb_triangle_area_at(b->x, v);
    }
  }
  return area / (4 * M_PI);
}

orb_status orb_map_patch_fill(orb_map_patch *patch, int flag) {
  int32_t n = patch->b->vertex_count, most = -1, *count = ORB_NEW0(patch->ctx, int32_t, n);
  if (!count) {
    return ORB_E_NO_MEMORY;
  }
  orb_map_patch_join(patch, patch->inside, 0);
  for (int32_t v = 0; v < n; v++) {
    if (!patch->inside[v]) {
      count[patch->joined[v]]++;
      most = most < 0 || count[patch->joined[v]] > count[most] ? patch->joined[v] : most;
    }
  }
  for (int32_t v = 0; v < n; v++) {
    if (!patch->inside[v] && patch->joined[v] != most) {
      patch->inside[v] = (unsigned char)flag;
    }
  }
  orb_free(patch->ctx, count);
  return ORB_OK;
}

/* The half-edge out of the same vertex that comes next. */
static int32_t swing(const orb_map_surface *b, int32_t h) {
  return b->twin[orb_prev(h)];
}

void orb_map_patch_find_rim(orb_map_patch *patch) {
  enum { ON_RIM = 255 };
  const orb_map_surface *b = patch->b;
  memcpy(patch->next, patch->inside, (size_t)b->vertex_count);
  patch->rim_count = 0;
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    int32_t v = b->triangles[h];
    if (patch->next[v] && patch->next[v] != ON_RIM && !patch->next[b->triangles[orb_next(h)]]) {
      patch->next[v] = ON_RIM;
      patch->rim[patch->rim_count++] = v;
    }
  }
  memcpy(patch->next, patch->inside, (size_t)b->vertex_count);
}

/* The length of the edges of the rim's vertices whose left side is not reached yet. */
static double rim_length(const orb_map_patch *patch) {
  const orb_map_surface *b = patch->b;
  double length = 0;
  for (int32_t i = 0; i < patch->rim_count; i++) {
    int32_t first = patch->corner[patch->rim[i]], h = first;
    do {
      int32_t u = b->triangles[orb_next(h)];
      if (patch->next[u] && !patch->next[b->triangles[orb_prev(h)]]) {
        length += sqrt(orb_distance2(b->x + 3 * (size_t)patch->rim[i], b->x + 3 * (size_t)u));
      }
      h = swing(b, h);
    } while (h != first);
  }
  return length;
}

double orb_map_patch_dilate(orb_map_patch *patch) {
  const orb_map_surface *b = patch->b;
  int32_t old = patch->rim_count, count = old;
  for (int32_t i = 0; i < old; i++) {
    int32_t first = patch->corner[patch->rim[i]], h = first;
    do {
      int32_t u = b->triangles[orb_next(h)];
      if (!patch->next[u]) {
        patch->next[u] = ORB_PATCH_LIMB;
        patch->rim[count++] = u;
      }
      h = swing(b, h);
    } while (h != first);
  }
  patch->rim_count = count - old;
  memmove(patch->rim, patch->rim + old, (size_t)patch->rim_count * sizeof *patch->rim);
  return rim_length(patch);
}

void orb_map_patch_reach(orb_map_patch *patch) {
  const orb_map_surface *b = patch->b;
  memset(patch->reached, 0, (size_t)b->vertex_count);
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    int32_t v = b->triangles[h];
    patch->reached[v] |=
        patch->inside[v] == ORB_PATCH_END && patch->inside[b->triangles[orb_next(h)]] == ORB_PATCH_LIMB;
  }
}
