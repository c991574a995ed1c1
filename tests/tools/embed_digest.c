/* embed-digest: embeds a mesh and prints a digest of the points for each method, to compare processors that follow IEEE
 * 754. The mesh needs only additions, multiplications and square roots; the embedding uses the vector loops that every
 * machine has. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "orbmorph/embed.h"

enum { SIDE = 40, VERTICES = 6 * SIDE * SIDE + 2, TRIANGLES = 12 * SIDE * SIDE };

/* Numbers the vertices of a cube's surface grid in the order in which they first occur. */
static int32_t number[SIDE + 1][SIDE + 1][SIDE + 1];
static double positions[3 * VERTICES];
static int32_t triangles[3 * TRIANGLES], vertex_count, triangle_count;

/* A grid point on the sphere, with bumps and a long nose. */
static int32_t vertex_at(const int32_t at[3]) {
  int32_t *known = &number[at[0]][at[1]][at[2]];
  if (*known) {
    return *known - 1;
  }
  double p[3], length2 = 0;
  for (int k = 0; k < 3; k++) {
    p[k] = 2.0 * at[k] / SIDE - 1;
    length2 += p[k] * p[k];
  }
  double bump = 1 + 0.3 * (double)((at[0] * 7 + at[1] * 13 + at[2] * 29) % 11) / (10 * SIDE);
  double nose = p[0] > 0.9 && p[1] * p[1] + p[2] * p[2] < 0.2 ? 3 : 1;
  for (int k = 0; k < 3; k++) {
    positions[3 * vertex_count + k] = p[k] / sqrt(length2) * bump * (k == 0 ? nose : 1);
  }
  *known = ++vertex_count;
  return vertex_count - 1;
}

static void add_square(int axis, int end, int32_t i, int32_t j) {
  static const int step[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  int32_t corner[4];
  for (int k = 0; k < 4; k++) {
    int32_t at[3];
    at[axis] = end ? SIDE : 0;
    at[(axis + 1) % 3] = i + step[k][0];
    at[(axis + 2) % 3] = j + step[k][1];
    corner[end ? k : 3 - k] = vertex_at(at);
  }
  const int32_t two[6] = {corner[0], corner[1], corner[2], corner[0], corner[2], corner[3]};
  memcpy(triangles + 3 * triangle_count, two, sizeof two);
  triangle_count += 2;
}

static uint64_t digest_of(const double *points) {
  uint64_t hash = 14695981039346656037u; /* FNV-1a */
  const unsigned char *bytes = (const unsigned char *)points;
  for (size_t i = 0; i < 3 * sizeof(double) * (size_t)vertex_count; i++) {
    hash = (hash ^ bytes[i]) * 1099511628211u;
  }
  return hash;
}

static int embed(orb_embed_method method, const char *name) {
  orb_context *ctx;
  orb_context_options with = {.threads = 2, .cpu = ORB_CPU_PLAIN};
  orb_embed_options options;
  orb_embedding out;
  orb_mesh mesh = {
      .vertex_count = vertex_count, .triangle_count = triangle_count, .positions = positions, .triangles = triangles};
  orb_embed_defaults(&options);
  options.method = method;
  if (orb_context_create(&with, &ctx) != ORB_OK) {
    return 1;
  }
  int failed = orb_embed(ctx, &mesh, &options, &out) != ORB_OK;
  if (failed) {
    printf("%s: %s\n", name, orb_context_error(ctx)->detail);
  } else {
    printf("%s: %d triangles, valid %d, symmetric Dirichlet %.4f, digest %016" PRIx64 "\n", name, triangle_count,
           out.certificate.valid, out.distortion.symmetric_dirichlet.mean, digest_of(out.points));
    orb_embedding_free(ctx, &out);
  }
  orb_context_destroy(ctx);
  return failed;
}

int main(void) {
  for (int side = 0; side < 6; side++) {
    for (int32_t i = 0; i < SIDE * SIDE; i++) {
      add_square(side / 2, side % 2, i / SIDE, i % SIDE);
    }
  }
  int failed = embed(ORB_EMBED_NEWTON, "newton");
  failed |= embed(ORB_EMBED_KERNEL_SAMPLING, "kernel-sampling");
  return failed;
}
