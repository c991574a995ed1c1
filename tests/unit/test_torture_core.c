/* Runs the library from the file to the asset while each allocation fails once: those of the context, of cJSON and of
 * the C++ code. A run with a failure ends with ORB_E_NO_MEMORY and leaks nothing. Whether later allocations fail as
 * well matters only during cleanup; quick runs try this, too. */
#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "orbmorph/format.h"
#include "orbmorph/merge.h"
#include "support_shapes.h"
#include "torture/torture.h"

typedef struct work {
  const orb_mesh *meshes; /* two */
  double *const *points;
  orb_buffer file; /* to read, or the result to compare */
  orb_embed_options embed;
  orb_merge_options merge;
  int landmarks;
  size_t expected;        /* size of the result without faults, 0: not known yet */
  long aligned, remeshed; /* allocations of the last merge until it had aligned, and until it had remeshed */
} work;

static void on_progress(void *user, const char *stage, double fraction) {
  work *w = user;
  if (fraction == 0 && strcmp(stage, "align") == 0) {
    w->aligned = w->remeshed = 0;
  } else if (w->aligned == 0 && strcmp(stage, "remesh") == 0) {
    w->aligned = torture_count();
  } else if (w->remeshed == 0 && strcmp(stage, "transfer") == 0) {
    w->remeshed = torture_count();
  }
}

/* A context that asserts that all its memory is freed. */
static int in_context(work *w, orb_status (*inner)(work *w, orb_context *ctx), torture_kind kind, long number,
                      int for_ever) {
  orb_context_options setup = {.threads = 1, .progress = on_progress, .progress_user = w};
  orb_context *ctx;
  assert_int_equal(orb_context_create(&setup, &ctx), ORB_OK);
  torture_arm(kind, number, for_ever);
  orb_status status = inner(w, ctx);
  int met = torture_disarm();
  if (status != ORB_OK && status != ORB_E_NO_MEMORY) {
    print_error("allocation %ld: %s\n", number, orb_context_error(ctx)->detail);
    fail();
  }
  assert_int_equal(met, status != ORB_OK);
  assert_int_equal(orb_memory_used(ctx), 0);
  orb_context_destroy(ctx);
  return met;
}

static orb_status read_inner(work *w, orb_context *ctx) {
  orb_mesh mesh;
  orb_status status = orb_mesh_read(ctx, w->file.data, w->file.size, ORB_FORMAT_AUTO, &mesh, NULL);
  if (status == ORB_OK) {
    assert_true(mesh.triangle_count > 0);
    status = orb_mesh_repair(ctx, &mesh, ORB_REPAIR_SAFE);
    orb_mesh_free(ctx, &mesh);
  }
  return status;
}
static int read_run(void *user, torture_kind kind, long number, int for_ever) {
  return in_context(user, read_inner, kind, number, for_ever);
}

static orb_status embed_inner(work *w, orb_context *ctx) {
  orb_embedding e;
  orb_buffer ply = {0};
  orb_status status = orb_embed(ctx, &w->meshes[0], &w->embed, &e);
  if (status != ORB_OK) {
    return status;
  }
  assert_true(e.certificate.valid);
  status = orb_sphere_ply_write(ctx, &w->meshes[0], e.points, &ply);
  orb_buffer_free(ctx, &ply);
  orb_embedding_free(ctx, &e);
  return status;
}
static int embed_run(void *user, torture_kind kind, long number, int for_ever) {
  return in_context(user, embed_inner, kind, number, for_ever);
}

static orb_status merge_inner(work *w, orb_context *ctx) {
  static const char *const names[2] = {"one", "two"};
  orb_align_shape shapes[2] = {{&w->meshes[0], w->points[0]}, {&w->meshes[1], w->points[1]}};
  orb_place places[3][2];
  orb_landmark landmarks[3];
  memset(landmarks, 0, sizeof landmarks);
  for (int i = 0; i < w->landmarks; i++) {
    for (int s = 0; s < 2; s++) {
      orb_status status = orb_place_of_vertex(ctx, &w->meshes[s], 2 * i, &places[i][s]);
      if (status != ORB_OK) {
        return status;
      }
    }
    landmarks[i] = (orb_landmark){.at = places[i], .confidence = 1};
  }
  orb_merge_result result;
  orb_status status = orb_merge(ctx, shapes, names, 2, landmarks, w->landmarks, &w->merge, &result);
  if (status == ORB_OK) {
    assert_true(w->expected == 0 || result.asset.size == w->expected);
    w->expected = result.asset.size;
    orb_merge_result_free(ctx, &result);
  }
  return status;
}
static int merge_run(void *user, torture_kind kind, long number, int for_ever) {
  return in_context(user, merge_inner, kind, number, for_ever);
}

static void all_fail(work *w, torture_run run, const char *what, long least, int ways, long first, long last,
                     int step) {
  for (int for_ever = 0; for_ever < ways; for_ever++) {
    long failures = torture(run, w, TORTURE_ALLOC, for_ever, first, last, step);
    print_message("%s: %ld allocations failed, %s\n", what, failures, for_ever ? "for ever" : "once");
    assert_true(failures >= least);
  }
}

typedef struct fixture {
  orb_context *ctx;
  orb_mesh meshes[2];
  double *points[2];
  work w;
} fixture;

static int setup(void **state) {
  static fixture f;
  memset(&f, 0, sizeof f);
  if (orb_context_create(NULL, &f.ctx) != ORB_OK) {
    return -1;
  }
  f.meshes[0] = shape_ball(f.ctx, 1);
  f.meshes[1] = shape_globe(f.ctx, 6, 4);
  for (int s = 0; s < 2; s++) {
    f.meshes[s].source = ORB_NEW(f.ctx, int32_t, f.meshes[s].vertex_count);
    for (int32_t v = 0; v < f.meshes[s].vertex_count; v++) {
      f.meshes[s].source[v] = v;
    }
    size_t count = 3 * (size_t)f.meshes[s].vertex_count;
    f.points[s] = ORB_NEW(f.ctx, double, count);
    memcpy(f.points[s], f.meshes[s].positions, count * sizeof(double));
    for (int32_t v = 0; v < f.meshes[s].vertex_count; v++) {
      f.meshes[s].positions[3 * v + s] *= 2;
    }
  }
  f.w.meshes = f.meshes;
  f.w.points = f.points;
  orb_embed_defaults(&f.w.embed);
  orb_merge_defaults(&f.w.merge);
  *state = &f;
  return 0;
}
static int teardown(void **state) {
  fixture *f = *state;
  for (int s = 0; s < 2; s++) {
    orb_free(f->ctx, f->points[s]);
    orb_mesh_free(f->ctx, &f->meshes[s]);
  }
  orb_context_destroy(f->ctx);
  return 0;
}

static void test_embed(void **state) {
  fixture *f = *state;
  all_fail(&f->w, embed_run, "newton", 10, 2, 1, LONG_MAX, 1);
  f->w.embed.method = ORB_EMBED_KERNEL_SAMPLING;
  all_fail(&f->w, embed_run, "kernel-sampling", 10, 2, 1, LONG_MAX, 1);
}

/* The first method fails every allocation. The later ones fail the allocations that differ: their alignment, unless the
 * previous method has the same, and their remeshing; the rest makes the same allocations for every supermesh. Alignment
 * without landmarks is slow: fails a sample of the allocations, all of them with ORB_TORTURE_ALL=1. */
static void test_merge(void **state) {
  int all = getenv("ORB_TORTURE_ALL") != NULL;
  fixture *f = *state;
  static const struct {
    const char *name;
    orb_align_method align;
    orb_remesh_method remesh;
    int landmarks, step;
  } ways[] = {{"pin, subdivision", ORB_ALIGN_PIN, ORB_REMESH_SUBDIVISION, 3, 1},
              {"pin, overlay", ORB_ALIGN_PIN, ORB_REMESH_OVERLAY, 3, 1},
              {"pin, adaptive", ORB_ALIGN_PIN, ORB_REMESH_ADAPTIVE, 3, 1},
              {"rbf, convex hull", ORB_ALIGN_RBF, ORB_REMESH_CONVEX_HULL, 3, 1},
              {"rotate, overlay", ORB_ALIGN_ROTATE, ORB_REMESH_OVERLAY, 0, 7},
              {"auto, adaptive", ORB_ALIGN_AUTO, ORB_REMESH_ADAPTIVE, 0, 11}};
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
    f->w.merge.align.method = ways[i].align;
    f->w.merge.align.preset = ORB_PRESET_FAST;
    f->w.merge.remesh.method = ways[i].remesh;
    f->w.landmarks = ways[i].landmarks;
    f->w.expected = 0;
    assert_int_equal(merge_run(&f->w, TORTURE_ALLOC, LONG_MAX, 0), 0);
    assert_true(f->w.aligned > 0 && f->w.remeshed > f->w.aligned);
    long first = i > 0 && ways[i].align == ways[i - 1].align ? f->w.aligned + 1 : 1;
    long last = i == 0 || all ? LONG_MAX : f->w.remeshed;
    all_fail(&f->w, merge_run, ways[i].name, 5, 1, first, last, all ? 1 : ways[i].step);
  }
}

static void put(orb_buffer *file, const void *bytes, size_t size, orb_context *ctx) {
  assert_int_equal(orb_buffer_append(ctx, file, bytes, size), ORB_OK);
}

/* The tetrahedron in each text format; a merge result as GLB, a sphere as binary PLY. */
static void test_read(void **state) {
  fixture *f = *state;
  static const char *const texts[][2] = {
      {"obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\nf 1/1/1 3/1/1 2/1/1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"},
      {"off", "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"},
      {"ply",
       "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
       "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
       "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"},
      {"stl",
       "solid t\n"
       "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n"
       "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n"
       "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\n"
       "facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\n"
       "endsolid t\n"},
      {"gltf with a material",
       "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":"
       "0},\"indices\":1,\"material\":0}]}],\"accessors\":[{\"bufferView\":0,\"componentType\":5"
       "126,\"count\":4,\"type\":\"VEC3\"},{\"bufferView\":1,\"componentType\":5121,\"count\":12,\""
       "type\":\"SCALAR\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":48},{\"buffer\":0,\"byte"
       "Offset\":48,\"byteLength\":12}],\"buffers\":[{\"byteLength\":60,\"uri\":\"data:;base64,A"
       "AAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAIBAAEDAAMCAQI"
       "D\"}],\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"data:;base64,iVBORw0KGgoAAAAN"
       "SUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC\"}"
       "],\"materials\":[{\"normalTexture\":{\"index\":0},\"extensions\":{\"A\":{},\"KHR_material"
       "s_ior\":{\"ior\":2}}}]}"}};
  for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
    put(&f->w.file, texts[i][1], strlen(texts[i][1]), f->ctx);
    all_fail(&f->w, read_run, texts[i][0], 5, 2, 1, LONG_MAX, 1);
    orb_buffer_free(f->ctx, &f->w.file);
  }
  orb_align_shape shapes[2] = {{&f->meshes[0], f->points[0]}, {&f->meshes[1], f->points[1]}};
  const char *names[2] = {"one", "two"};
  orb_merge_result result;
  f->w.merge.align.method = ORB_ALIGN_ROTATE;
  f->w.merge.remesh.method = ORB_REMESH_OVERLAY;
  assert_int_equal(orb_merge(f->ctx, shapes, names, 2, NULL, 0, &f->w.merge, &result), ORB_OK);
  f->w.file = result.asset;
  all_fail(&f->w, read_run, "glb", 20, 2, 1, LONG_MAX, 1);
  orb_merge_result_free(f->ctx, &result);
  f->w.file = (orb_buffer){0};
  assert_int_equal(orb_sphere_ply_write(f->ctx, &f->meshes[0], f->points[0], &f->w.file), ORB_OK);
  all_fail(&f->w, read_run, "binary ply", 5, 2, 1, LONG_MAX, 1);
  orb_buffer_free(f->ctx, &f->w.file);
}

int main(void) {
  torture_begin();
  const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_read, setup, teardown),
                                     cmocka_unit_test_setup_teardown(test_embed, setup, teardown),
                                     cmocka_unit_test_setup_teardown(test_merge, setup, teardown)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
