#include "support_bodies.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/vec3.h"
#include "support_shapes.h"

void bodies_open(bodies *b, const orb_context_options *options) {
  memset(b, 0, sizeof *b);
  assert_int_equal(orb_context_create(options, &b->ctx), ORB_OK);
  b->mesh[0] = shape_globe(b->ctx, 26, 18);
  b->mesh[1] = shape_ball(b->ctx, 4);
  b->mesh[2] = shape_globe(b->ctx, 15, 23);
  for (int s = 0; s < BODIES; s++) {
    orb_mesh *mesh = &b->mesh[s];
    b->points[s] = ORB_NEW(b->ctx, double, 3 * (size_t)mesh->vertex_count);
    assert_non_null(b->points[s]);
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      double *x = mesh->positions + 3 * v, *p = b->points[s] + 3 * v;
      memcpy(p, x, 3 * sizeof *x);
      orb_normalize(p);
      double r = 1 + 0.3 * sin(3 * x[0] + s) * cos(2 * x[1]);
      for (int k = 0; k < 3; k++) {
        x[k] *= r * (k == s ? 2 : 1);
      }
    }
    b->shape[s] = (orb_align_shape){mesh, b->points[s]};
  }
  for (int k = 0; k < BODIES_LANDMARKS_MAX; k++) {
    b->landmark[k].at = b->at[k];
    b->landmark[k].confidence = 1;
  }
}

void bodies_close(bodies *b) {
  for (int s = 0; s < BODIES; s++) {
    orb_free(b->ctx, b->points[s]);
    shape_free(b->ctx, &b->mesh[s]);
  }
  orb_context_destroy(b->ctx);
}

static uint64_t next_random(uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return *state >> 33;
}

int32_t bodies_vertex_at(const orb_mesh *mesh, const orb_place *place) {
  for (int k = 0; k < 3; k++) {
    if (place->at[k] == 1) {
      return mesh->triangles[3 * place->triangle + k];
    }
  }
  return -1;
}

void bodies_random(bodies *b, int count, uint64_t seed) {
  for (int i = 0; i < 8; i++) {
    (void)next_random(&seed);
  }
  for (int s = 0; s < BODIES; s++) {
    for (int k = 0; k < count; k++) {
      int32_t v = (int32_t)(next_random(&seed) % (uint64_t)b->mesh[s].vertex_count);
      assert_int_equal(orb_place_of_vertex(b->ctx, &b->mesh[s], v, &b->at[k][s]), ORB_OK);
      for (int j = 0; j < k; j++) {
        if (bodies_vertex_at(&b->mesh[s], &b->at[j][s]) == v) {
          k--;
          break;
        }
      }
    }
  }
}

void bodies_like(bodies *b, int count) {
  for (int s = 0; s < BODIES; s++) {
    for (int k = 0; k < count; k++) {
      double z = 1 - (2 * k + 1.0) / count, a = 2.4 * k, d[3] = {sqrt(1 - z * z) * cos(a), sqrt(1 - z * z) * sin(a), z};
      int32_t best = 0;
      for (int32_t v = 0; v < b->mesh[s].vertex_count; v++) {
        if (orb_distance2(b->points[s] + 3 * v, d) < orb_distance2(b->points[s] + 3 * best, d)) {
          best = v;
        }
      }
      assert_int_equal(orb_place_of_vertex(b->ctx, &b->mesh[s], best, &b->at[k][s]), ORB_OK);
    }
  }
}

orb_align_options bodies_options(orb_align_method method) {
  orb_align_options options;
  orb_align_defaults(&options);
  options.method = method;
  options.preset = ORB_PRESET_FAST;
  return options;
}
