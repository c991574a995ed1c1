/* A mesh and its sphere as binary little-endian PLY, written in batches of BATCH rows. */
#include "base/buffer.h"
#include "base/check.h"
#include "format/bytes.h"
#include "orbmorph/format.h"

enum { VERTEX_BYTES = 6 * 8 + 4, FACE_BYTES = 1 + 3 * 4, BATCH = 1024 };

static void put_u32(unsigned char *p, uint32_t value) {
  for (int i = 0; i < 4; i++) {
    p[i] = (unsigned char)(value >> (8 * i));
  }
}

static void put_f64(unsigned char *p, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  put_u32(p, (uint32_t)bits);
  put_u32(p + 4, (uint32_t)(bits >> 32));
}

orb_status orb_sphere_ply_write(orb_context *ctx, const orb_mesh *mesh, const double *points, orb_buffer *out) {
  ORB_TRY(orb_buffer_printf(ctx, out,
                            "ply\nformat binary_little_endian 1.0\ncomment " ORB_ENGINE
                            "\nelement vertex %d\nproperty double x\nproperty double y\nproperty double z\n"
                            "property double px\nproperty double py\nproperty double pz\nproperty int source\n"
                            "element face %d\nproperty list uchar int vertex_indices\nend_header\n",
                            mesh->vertex_count, mesh->triangle_count));
  unsigned char row[BATCH * VERTEX_BYTES];
  for (int32_t v = 0; v < mesh->vertex_count;) {
    unsigned char *p = row;
    for (int i = 0; i < BATCH && v < mesh->vertex_count; i++, v++, p += VERTEX_BYTES) {
      for (int k = 0; k < 3; k++) {
        put_f64(p + 8 * k, mesh->positions[3 * (size_t)v + (size_t)k]);
        put_f64(p + 24 + 8 * k, points[3 * (size_t)v + (size_t)k]);
      }
      put_u32(p + 48, (uint32_t)mesh->source[v]);
    }
    ORB_TRY(orb_buffer_append(ctx, out, row, (size_t)(p - row)));
  }
  for (int32_t t = 0; t < mesh->triangle_count;) {
    unsigned char *p = row;
    for (int i = 0; i < BATCH && t < mesh->triangle_count; i++, t++, p += FACE_BYTES) {
      p[0] = 3;
      for (int k = 0; k < 3; k++) {
        put_u32(p + 1 + 4 * k, (uint32_t)mesh->triangles[3 * (size_t)t + (size_t)k]);
      }
    }
    ORB_TRY(orb_buffer_append(ctx, out, row, (size_t)(p - row)));
  }
  return ORB_OK;
}
