/* Feeds bytes as a glTF document that is kept and gets targets. The written document must be read again as the same
 * surface. The first byte chooses which vertices move. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "cost.h"
#include "format/gltf_keep.h"
#include "orbmorph/format.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_same(const orb_mesh *before, const orb_mesh *after) {
  size_t points = 3 * (size_t)before->vertex_count, corners = 3 * (size_t)before->triangle_count;
  if (before->vertex_count != after->vertex_count || before->triangle_count != after->triangle_count ||
      memcmp(before->positions, after->positions, points * sizeof(double)) != 0 ||
      memcmp(before->triangles, after->triangles, corners * sizeof(int32_t)) != 0) {
    abort();
  }
}

static void keep(orb_context *ctx, const uint8_t *bytes, size_t size, unsigned choice, const orb_mesh *mesh) {
  size_t count = (size_t)mesh->vertex_count;
  static const char *const names[] = {"one", "one"};
  static const int32_t frames[] = {0, 1, 2};
  static const double times[] = {0, 1, 2};
  int32_t *on = malloc(count * sizeof *on);
  double *moved = malloc(3 * count * sizeof *moved), *up = malloc(3 * count * sizeof *up);
  if (!on || !moved || !up) {
    abort();
  }
  for (size_t v = 0; v < count; v++) {
    on[v] = choice % 3 == 0 || v % 7 < choice % 7 ? (int32_t)v : -1;
    for (size_t k = 0; k < 3; k++) {
      moved[3 * v + k] = mesh->positions[3 * v + k] + 1;
      up[3 * v + k] = k == (v + choice) % 3;
    }
  }
  const double *positions[] = {mesh->positions, moved, mesh->positions}, *normals[] = {up, up, moved};
  orb_gltf_shapes shapes = {.target_count = 2,
                            .file_vertex_count = mesh->vertex_count,
                            .names = names,
                            .on_surface = on,
                            .positions = positions,
                            .normals = choice & 8 ? normals : NULL,
                            .key_count = choice & 16 ? 3 : 0,
                            .key_frames = frames,
                            .key_times = times};
  orb_gltf_kept kept;
  orb_buffer out = {0};
  orb_mesh again;
  if (orb_gltf_keep(ctx, bytes, size, &shapes, &kept, &out) == ORB_OK) {
    if (orb_mesh_read(ctx, out.data, out.size, ORB_FORMAT_GLB, &again, NULL) != ORB_OK) {
      abort();
    }
    check_same(mesh, &again);
    orb_mesh_free(ctx, &again);
  }
  orb_buffer_free(ctx, &out);
  orb_free(ctx, kept.dropped);
  free(on);
  free(moved);
  free(up);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  orb_context_options options = {.threads = 1};
  orb_context *ctx;
  orb_mesh mesh;
  if (size < 1 || orb_context_create(&options, &ctx) != ORB_OK) {
    return 0;
  }
  const double began = fuzz_begin();
  const uint8_t *bytes = data + 1;
  orb_format format = size > 4 && memcmp(bytes, "glTF", 4) == 0 ? ORB_FORMAT_GLB : ORB_FORMAT_GLTF;
  if (orb_mesh_read(ctx, bytes, size - 1, format, &mesh, NULL) == ORB_OK) {
    keep(ctx, bytes, size - 1, data[0], &mesh);
    orb_mesh_free(ctx, &mesh);
  }
  if (orb_memory_used(ctx) > 0) {
    abort();
  }
  fuzz_check_document(ctx, began, size, "keeping");
  orb_context_destroy(ctx);
  return 0;
}
