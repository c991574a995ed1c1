#include "support_remesh.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

orb_context *remesh_context(int threads) {
  orb_context *ctx;
  orb_context_options options = {.threads = threads};
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  return ctx;
}

orb_status remesh_by(orb_context *ctx, orb_remesh_method method, const orb_aligned_shape *shapes, int count,
                     orb_supermesh *out) {
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  options.method = method;
  orb_status status = orb_remesh(ctx, shapes, count, 0, &options, out);
  if (status != ORB_OK && status != ORB_E_NO_MEMORY) {
    print_message("%s: %s\n", orb_status_name(status), orb_context_error(ctx)->detail);
  }
  return status;
}

void remesh_assert_threads_do_not_matter(orb_remesh_method method) {
  orb_supermesh m[2];
  orb_context *ctx[2];
  for (int i = 0; i < 2; i++) {
    orb_aligned_shape shapes[2];
    ctx[i] = remesh_context(i ? 4 : 1);
    sphere_shape(ctx[i], SPHERE_ICO, 4, 0.2, 1, &shapes[0]);
    sphere_shape(ctx[i], SPHERE_OCTA, 4, 0.2, 2, &shapes[1]);
    assert_int_equal(remesh_by(ctx[i], method, shapes, 2, &m[i]), ORB_OK);
    sphere_shape_free(ctx[i], &shapes[0]);
    sphere_shape_free(ctx[i], &shapes[1]);
  }
  size_t vertices = (size_t)m[0].vertex_count;
  assert_int_equal(m[0].vertex_count, m[1].vertex_count);
  assert_memory_equal(m[0].points, m[1].points, 3 * vertices * sizeof(double));
  assert_memory_equal(m[0].triangles, m[1].triangles, 3 * (size_t)m[0].triangle_count * sizeof(int32_t));
  assert_memory_equal(m[0].error_bound, m[1].error_bound, 2 * sizeof(double));
  for (size_t i = 0; i < 2 * vertices; i++) {
    assert_int_equal(m[0].places[i].triangle, m[1].places[i].triangle);
    assert_memory_equal(m[0].places[i].at, m[1].places[i].at, sizeof m[0].places[i].at);
  }
  for (int i = 0; i < 2; i++) {
    orb_supermesh_free(ctx[i], &m[i]);
    orb_context_destroy(ctx[i]);
  }
}

static void *failing_alloc(void *user, size_t size) {
  int64_t *left = user;
  return (*left)-- > 0 ? malloc(size) : NULL;
}

static void failing_free(void *user, void *block) {
  (void)user;
  free(block);
}

orb_context *remesh_failing_context(int64_t *left) {
  orb_context *ctx;
  orb_context_options options = {.threads = 1, .allocator = {failing_alloc, failing_free, left}};
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  return ctx;
}

void remesh_assert_fails_cleanly(orb_remesh_method method) {
  int done = 0;
  for (int64_t n = 0; !done; n++) {
    assert_true(n < 3000);
    int64_t left = INT64_MAX;
    orb_context *ctx = remesh_failing_context(&left);
    orb_aligned_shape shapes[3];
    for (int s = 0; s < 3; s++) {
      sphere_shape(ctx, SPHERE_OCTA, s == 2 ? 0 : 1, 0, (unsigned)s + 1, &shapes[s]);
    }
    left = n;
    orb_supermesh m;
    orb_status status = remesh_by(ctx, method, shapes, 3, &m);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    done = status == ORB_OK;
    orb_supermesh_free(ctx, &m);
    for (int s = 0; s < 3; s++) {
      sphere_shape_free(ctx, &shapes[s]);
    }
    orb_context_destroy(ctx);
  }
}
