/* embed-adversarial [COUNT [FIRST-SEED [MOST-TRIANGLES]]]: embeds seeded adversarial meshes with `newton`, cycling
 * through all kinds. Each must be certified. Prints one line for each mesh that failed, then how extreme the worst ones
 * are; exit status 0 only if none failed. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "adversarial.h"
#include "base/memory.h"
#include "orbmorph/embed.h"

typedef struct extremes {
  int32_t failed;
  int64_t triangles;
  double seconds, least_determinant, greatest_distortion;
  char least[64], greatest[64];
} extremes;

/* The context owns the arrays of a mesh, so the generator's arrays are copied into it. */
static int adopt(orb_context *ctx, const adversarial_mesh *from, orb_mesh *out) {
  size_t vertices = (size_t)from->vertex_count, triangles = (size_t)from->triangle_count;
  memset(out, 0, sizeof *out);
  out->vertex_count = out->file_vertex_count = from->vertex_count;
  out->triangle_count = out->file_triangle_count = from->triangle_count;
  out->positions = ORB_NEW(ctx, double, 3 * vertices);
  out->triangles = ORB_NEW(ctx, int32_t, 3 * triangles);
  if (!out->positions || !out->triangles) {
    orb_mesh_free(ctx, out);
    return 0;
  }
  memcpy(out->positions, from->positions, 3 * vertices * sizeof(double));
  memcpy(out->triangles, from->triangles, 3 * triangles * sizeof(int32_t));
  return 1;
}

/* From 40 to `most` triangles, evenly over the orders of magnitude. */
static int32_t size_of(uint64_t seed, int32_t most) {
  double share = (double)((seed * 0x9e3779b97f4a7c15u) >> 11) * 0x1p-53;
  return (int32_t)(40 * pow(most / 40.0, share));
}

static void note(extremes *x, const char *label, const orb_embedding *e) {
  double distortion = e->distortion.symmetric_dirichlet.max;
  if (e->certificate.min_determinant < x->least_determinant) {
    x->least_determinant = e->certificate.min_determinant;
    snprintf(x->least, sizeof x->least, "%s", label);
  }
  if (distortion > x->greatest_distortion) {
    x->greatest_distortion = distortion;
    snprintf(x->greatest, sizeof x->greatest, "%s", label);
  }
}

static void try_one(adversarial_kind kind, uint64_t seed, int32_t triangles, extremes *x) {
  char label[64];
  adversarial_mesh made = adversarial_make(kind, seed, triangles);
  snprintf(label, sizeof label, "%s seed %llu, %d triangles", adversarial_name(kind), (unsigned long long)seed,
           made.triangle_count);
  orb_context *ctx;
  if (orb_context_create(NULL, &ctx) != ORB_OK) {
    fprintf(stderr, "embed-adversarial: out of memory\n");
    exit(1);
  }
  orb_mesh mesh;
  orb_embedding e;
  const char *why = NULL;
  if (!adopt(ctx, &made, &mesh)) {
    why = "out of memory";
  } else if (orb_embed(ctx, &mesh, NULL, &e) != ORB_OK) {
    why = orb_context_error(ctx)->detail;
    orb_mesh_free(ctx, &mesh);
  } else {
    const orb_certificate *c = &e.certificate;
    if (!(c->valid && c->exact && !c->flipped && !c->degenerate && c->degree == 1 && c->min_determinant > 0)) {
      why = "returned without a certificate";
    } else if (isnan(e.distortion.symmetric_dirichlet.max)) {
      why = "reported a distortion that is not a number";
    }
    note(x, label, &e);
    x->triangles += mesh.triangle_count;
    x->seconds += e.timings.total;
    orb_embedding_free(ctx, &e);
    orb_mesh_free(ctx, &mesh);
  }
  if (why) {
    printf("FAILED %s (asked for %d): %s\n", label, triangles, why);
    fflush(stdout);
    x->failed++;
  }
  orb_context_destroy(ctx);
  adversarial_free(&made);
}

int main(int argc, char **argv) {
  int32_t count = argc > 1 ? atoi(argv[1]) : 50, most = argc > 3 ? atoi(argv[3]) : 20000;
  uint64_t first = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
  if (argc > 4 || count < 1 || most < 40) {
    fprintf(stderr, "usage: embed-adversarial [COUNT [FIRST-SEED [MOST-TRIANGLES]]]\n");
    return 2;
  }
  extremes x = {.least_determinant = INFINITY, .greatest_distortion = -INFINITY, .least = "none", .greatest = "none"};
  for (int32_t i = 0; i < count; i++) {
    uint64_t seed = first + (uint64_t)i;
    try_one((adversarial_kind)(i % ADV_KIND_COUNT), seed, size_of(seed, most), &x);
  }
  printf("%d of %d embedded and certified, %lld triangles in %.2f s\n", count - x.failed, count, (long long)x.triangles,
         x.seconds);
  printf("smallest determinant %.3g (%s)\nlargest symmetric Dirichlet of a triangle %.3g (%s)\n", x.least_determinant,
         x.least, x.greatest_distortion, x.greatest);
  return x.failed ? 1 : 0;
}
