#include "remesh/common/supermesh.h"

#include <string.h>

#include "base/memory.h"

void orb_supermesh_free(orb_context *ctx, orb_supermesh *supermesh) {
  orb_free(ctx, supermesh->triangles);
  orb_free(ctx, supermesh->points);
  orb_free(ctx, supermesh->places);
  orb_free(ctx, supermesh->landmark_vertices);
  orb_free(ctx, supermesh->error_bound);
  memset(supermesh, 0, sizeof *supermesh);
}

orb_status orb_net_export(orb_context *ctx, const orb_net *net, orb_supermesh *out, int32_t *map) {
  int32_t vertices = 0, triangles = 0;
  for (int32_t v = 0; v < net->vertex_count; v++) {
    vertices += net->out[v] >= 0;
  }
  for (int32_t t = 0; t < net->triangle_count; t++) {
    triangles += net->triangles[3 * t] >= 0;
  }
  int32_t *number = map ? map : ORB_NEW(ctx, int32_t, net->vertex_count);
  out->points = ORB_NEW(ctx, double, 3 * (int64_t)vertices);
  out->triangles = ORB_NEW(ctx, int32_t, 3 * (int64_t)triangles);
  orb_status status = number && out->points && out->triangles ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int32_t v = 0; v < net->vertex_count; v++) {
      number[v] = -1;
      if (net->out[v] >= 0) {
        number[v] = out->vertex_count++;
        memcpy(out->points + 3 * (int64_t)number[v], orb_net_point(net, v), 3 * sizeof(double));
      }
    }
    for (int32_t t = 0; t < net->triangle_count; t++) {
      for (int k = 0; k < 3 && net->triangles[3 * t] >= 0; k++) {
        out->triangles[3 * (int64_t)out->triangle_count + k] = number[net->triangles[3 * t + k]];
      }
      out->triangle_count += net->triangles[3 * t] >= 0;
    }
  }
  if (!map) {
    orb_free(ctx, number);
  }
  return status;
}
