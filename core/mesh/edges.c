#include "mesh/edges.h"

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "mesh/sort.h"

static void match_run(const uint64_t *entry, int32_t count, const int32_t *triangles, int32_t *twin, orb_edges *out) {
  out->edges++;
  if (count == 1) {
    twin[(int32_t)(uint32_t)entry[0]] = ORB_OPEN;
    out->open++;
    return;
  }
  if (count == 2) {
    int32_t a = (int32_t)(uint32_t)entry[0], b = (int32_t)(uint32_t)entry[1];
    if (a / 3 != b / 3) {
      twin[a] = b;
      twin[b] = a;
      out->same_way += triangles[a] == triangles[b];
      return;
    }
  }
  out->crowded++;
  for (int32_t i = 0; i < count; i++) {
    twin[(int32_t)(uint32_t)entry[i]] = ORB_CROWDED;
  }
}

orb_status orb_edges_match(orb_context *ctx, const int32_t *triangles, int32_t triangle_count, int32_t vertex_count,
                           int32_t *twin, orb_edges *out) {
  *out = (orb_edges){0};
  int32_t half_edges = 3 * triangle_count;
  int32_t *start = ORB_NEW0(ctx, int32_t, (size_t)vertex_count + 2);
  uint64_t *entry = ORB_NEW(ctx, uint64_t, half_edges);
  orb_status status = ORB_E_NO_MEMORY;
  if (!start || !entry) {
    goto done;
  }
  for (int32_t t = 0; t < half_edges; t += 3) {
    int32_t a = triangles[t], b = triangles[t + 1], c = triangles[t + 2];
    start[(a < b ? a : b) + 2]++;
    start[(b < c ? b : c) + 2]++;
    start[(c < a ? c : a) + 2]++;
  }
  for (int32_t v = 0; v < vertex_count; v++) {
    start[v + 2] += start[v + 1];
  }
  for (int32_t t = 0; t < half_edges; t += 3) {
    for (int32_t k = 0; k < 3; k++) {
      int32_t a = triangles[t + k], b = triangles[k == 2 ? t : t + k + 1];
      int32_t low = a < b ? a : b, high = a < b ? b : a;
      entry[start[low + 1]++] = (uint64_t)(uint32_t)high << 32 | (uint32_t)(t + k);
    }
  }
  ORB_GO(status, orb_context_check(ctx), done);
  for (int32_t v = 0; v < vertex_count; v++) {
    int32_t first = start[v], last = start[v + 1];
    orb_sort_u64(entry + first, last - first);
    while (first < last) {
      int32_t next = first + 1;
      while (next < last && entry[next] >> 32 == entry[first] >> 32) {
        next++;
      }
      match_run(entry + first, next - first, triangles, twin, out);
      first = next;
    }
  }
  for (int32_t h = 0; h < half_edges; h++) {
    if (triangles[h] == triangles[orb_next(h)]) {
      twin[h] = ORB_CROWDED;
    }
  }
done:
  orb_free(ctx, start);
  orb_free(ctx, entry);
  return status;
}

orb_status orb_mesh_twins(orb_context *ctx, const int32_t *triangles, int32_t triangle_count, int32_t vertex_count,
                          int32_t *twin) {
  orb_edges edges;
  ORB_TRY(orb_edges_match(ctx, triangles, triangle_count, vertex_count, twin, &edges));
  if (edges.open || edges.crowded || edges.same_way) {
    return orb_fail(ctx, ORB_E_INTERNAL, "A mesh that should be closed and oriented is not.");
  }
  return ORB_OK;
}
