/* An encoded embedding of the core: changes to a valid one of an octahedron. The first byte: whether the checksum is
 * made to fit again; the second and third: how much is cut off or added; then, ten bytes each, an offset and eight
 * bytes to put there. What is decoded is certified. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "orbmorph/embed.h"
#include "orbmorph/format.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { VERTICES = 6, ROOM = 8192 };
static const char octahedron[] =
    "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\nf 1 3 5\nf 3 2 5\nf 2 4 5\n"
    "f 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

static uint64_t word(const unsigned char *at) {
  uint64_t x = 0;
  for (int i = 0; i < 8; i++) {
    x |= (uint64_t)at[i] << 8 * i;
  }
  return x;
}

/* As core/embed/codec.c describes it. */
static void put_checksum(unsigned char *bytes, size_t size) {
  uint64_t h = UINT64_C(0xcbf29ce484222325);
  for (size_t i = 0; i + 8 <= size - 8; i += 8) {
    h = (h ^ word(bytes + i)) * UINT64_C(0x100000001b3);
    h ^= h >> 29;
  }
  h *= UINT64_C(0x9e3779b97f4a7c15);
  h ^= h >> 32;
  for (int i = 0; i < 8; i++) {
    bytes[size - 8 + (size_t)i] = (unsigned char)(h >> 8 * i);
  }
}

/* A valid one, made once. */
static size_t original(orb_context *ctx, const orb_mesh *mesh, unsigned char out[ROOM]) {
  static unsigned char kept[ROOM];
  static size_t size;
  if (!size) {
    orb_embedding e;
    orb_buffer buffer = {0};
    if (orb_embed(ctx, mesh, NULL, &e) != ORB_OK || orb_embedding_encode(ctx, &e, &buffer) != ORB_OK ||
        buffer.size > ROOM) {
      abort();
    }
    memcpy(kept, buffer.data, size = buffer.size);
    orb_buffer_free(ctx, &buffer);
    orb_embedding_free(ctx, &e);
  }
  memcpy(out, kept, size);
  return size;
}

static void decode(orb_context *ctx, const orb_mesh *mesh, const unsigned char *bytes, size_t size) {
  orb_embedding e;
  orb_certificate certificate;
  if (orb_embedding_decode(ctx, bytes, size, mesh, &e) != ORB_OK) {
    return;
  }
  if (orb_certify(ctx, e.points, VERTICES, mesh->triangles, mesh->triangle_count, &certificate) != ORB_OK ||
      !certificate.valid) {
    abort();
  }
  for (int i = 0; i < VERTICES; i++) {
    const double *p = e.points + 3 * i;
    if (!(fabs(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 1) < 1e-10)) {
      abort();
    }
  }
  orb_embedding_free(ctx, &e);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  unsigned char bytes[ROOM] = {0};
  orb_context_options options = {.threads = 1};
  orb_context *ctx;
  orb_mesh mesh;
  if (size < 3 || orb_context_create(&options, &ctx) != ORB_OK) {
    return 0;
  }
  if (orb_mesh_read(ctx, (const unsigned char *)octahedron, sizeof octahedron - 1, ORB_FORMAT_OBJ, &mesh, NULL) !=
          ORB_OK ||
      mesh.vertex_count != VERTICES) {
    abort();
  }
  long length = (long)original(ctx, &mesh, bytes) + (int16_t)(data[1] | data[2] << 8);
  length = length < 0 ? 0 : length > ROOM ? ROOM : length;
  for (size_t at = 3; at + 10 <= size; at += 10) {
    size_t to = (size_t)(data[at] | data[at + 1] << 8) % (ROOM - 8);
    memcpy(bytes + to, data + at + 2, 8);
  }
  if (data[0] & 1 && length >= 8) {
    put_checksum(bytes, (size_t)length);
  }
  unsigned char *exact = malloc((size_t)length + (length == 0));
  if (!exact) {
    abort();
  }
  memcpy(exact, bytes, (size_t)length);
  decode(ctx, &mesh, exact, (size_t)length);
  free(exact);
  orb_mesh_free(ctx, &mesh);
  orb_context_destroy(ctx);
  return 0;
}
