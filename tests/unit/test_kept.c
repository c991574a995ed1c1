/* Alignments as bytes: an alignment that is written and read is equal to the bit, with split triangles and attributes
 * too; bytes that are damaged, cut, or of other shapes are refused and nothing leaks. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "orbmorph/align.h"
#include "orbmorph/kept.h"
#include "support_bodies.h"

static void check_equal(const void *a, const void *b, size_t count, size_t size) {
  assert_int_equal(!a, !b);
  if (a) {
    assert_memory_equal(a, b, count * size);
  }
}

static void check_same_mesh(const orb_mesh *a, const orb_mesh *b) {
  const size_t v = (size_t)a->vertex_count, t = (size_t)a->triangle_count;
  assert_int_equal(a->vertex_count, b->vertex_count);
  assert_int_equal(a->triangle_count, b->triangle_count);
  assert_int_equal(a->file_vertex_count, b->file_vertex_count);
  check_equal(a->positions, b->positions, 3 * v, sizeof(double));
  check_equal(a->triangles, b->triangles, 3 * t, sizeof(int32_t));
  check_equal(a->source, b->source, v, sizeof(int32_t));
  check_equal(a->vertex_of_source, b->vertex_of_source, (size_t)a->file_vertex_count, sizeof(int32_t));
  check_equal(a->source_triangle, b->source_triangle, t, sizeof(int32_t));
  check_equal(a->normals, b->normals, 9 * t, sizeof(float));
  check_equal(a->texcoords, b->texcoords, 6 * t, sizeof(float));
  check_equal(a->colors, b->colors, 12 * t, sizeof(float));
  check_equal(a->material, b->material, t, sizeof(int32_t));
}

static void check_same(const orb_alignment *a, const orb_alignment *b) {
  const size_t found = (size_t)a->found_count, shapes = (size_t)a->shape_count;
  assert_int_equal(a->shape_count, b->shape_count);
  assert_int_equal(a->landmark_count, b->landmark_count);
  assert_int_equal(a->found_count, b->found_count);
  assert_int_equal(a->has_followed, b->has_followed);
  assert_memory_equal(&a->energy, &b->energy, sizeof a->energy); /* also NaN */
  assert_memory_equal(&a->match, &b->match, sizeof a->match);
  assert_int_equal(a->alternative_count, b->alternative_count);
  for (int32_t i = 0; i < a->alternative_count; i++) {
    const orb_alternative *x = &a->alternatives[i], *y = &b->alternatives[i];
    assert_true(x->cost == y->cost && x->shape == y->shape && x->count == y->count);
    for (size_t k = 0; k < (size_t)x->count * shapes; k++) {
      assert_int_equal(x->at[k].triangle, y->at[k].triangle);
      assert_memory_equal(x->at[k].at, y->at[k].at, sizeof x->at[k].at);
    }
  }
  assert_int_equal(a->suspect_count, b->suspect_count);
  for (int32_t i = 0; i < a->suspect_count; i++) {
    const orb_suspect *x = &a->suspects[i], *y = &b->suspects[i];
    assert_true(x->landmark == y->landmark && x->shape == y->shape && x->share == y->share);
    assert_true(x->distance == y->distance && x->at.triangle == y->at.triangle);
    assert_memory_equal(x->at.at, y->at.at, sizeof x->at.at);
  }
  assert_int_equal(a->landmark_shares != NULL, b->landmark_shares != NULL);
  if (a->landmark_shares) {
    check_equal(a->landmark_shares, b->landmark_shares, (size_t)a->landmark_count, sizeof(double));
  }
  for (size_t i = 0; i < found * shapes; i++) {
    assert_int_equal(a->found[i].triangle, b->found[i].triangle);
    assert_memory_equal(a->found[i].at, b->found[i].at, sizeof a->found[i].at);
  }
  if (found > 0) {
    check_equal(a->found_points, b->found_points, 3 * found, sizeof(double));
    check_equal(a->confidence, b->confidence, found, sizeof(double));
  }
  for (size_t s = 0; s < shapes; s++) {
    const orb_aligned_shape *x = &a->shapes[s], *y = &b->shapes[s];
    check_same_mesh(&x->mesh, &y->mesh);
    check_equal(x->points, y->points, 3 * (size_t)x->mesh.vertex_count, sizeof(double));
    check_equal(x->parent, y->parent, (size_t)x->mesh.triangle_count, sizeof(int32_t));
    check_equal(x->landmark_vertices, y->landmark_vertices, (size_t)a->landmark_count, sizeof(int32_t));
    assert_int_equal(x->certificate.valid, y->certificate.valid);
    assert_int_equal(x->certificate.degree, y->certificate.degree);
    assert_true(x->certificate.min_determinant == y->certificate.min_determinant);
  }
}

static void add_attributes(bodies *b) {
  for (int s = 0; s < BODIES; s++) {
    orb_mesh *mesh = &b->mesh[s];
    const size_t corners = 3 * (size_t)mesh->triangle_count;
    mesh->texcoords = ORB_NEW(b->ctx, float, 2 * corners);
    mesh->colors = ORB_NEW(b->ctx, float, 4 * corners);
    assert_true(mesh->texcoords && mesh->colors);
    for (size_t i = 0; i < 4 * corners; i++) {
      mesh->colors[i] = (float)(i % 7) / 7;
      mesh->texcoords[i / 2] = (float)(i % 11) / 11;
    }
  }
}

static void remove_attributes(bodies *b) {
  for (int s = 0; s < BODIES; s++) {
    orb_free(b->ctx, b->mesh[s].texcoords);
    orb_free(b->ctx, b->mesh[s].colors);
    b->mesh[s].texcoords = b->mesh[s].colors = NULL;
  }
}

static void align(bodies *b, orb_align_method method, int landmarks, orb_alignment *out) {
  orb_align_options options = bodies_options(method);
  bodies_random(b, landmarks, 5);
  assert_int_equal(orb_align(b->ctx, b->shape, 2, b->landmark, landmarks, &options, out), ORB_OK);
}

/* The preset fast measures none. */
static void add_shares(bodies *b, orb_alignment *a) {
  orb_free(b->ctx, a->landmark_shares);
  a->landmark_shares = NULL;
  if (a->landmark_count > 0) {
    a->landmark_shares = ORB_NEW(b->ctx, double, a->landmark_count);
    assert_non_null(a->landmark_shares);
  }
  for (int32_t i = 0; i < a->landmark_count; i++) {
    a->landmark_shares[i] = 1.0 / (1 + i);
  }
}

static void what_is_read_was_written(void **state) {
  (void)state;
  static const struct {
    orb_align_method method;
    int landmarks, attributes;
  } cases[] = {{ORB_ALIGN_AUTO, 0, 0}, {ORB_ALIGN_ROTATE, 0, 1}, {ORB_ALIGN_RBF, 5, 0}, {ORB_ALIGN_PIN, 30, 1}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    bodies b;
    orb_alignment made, read;
    orb_buffer bytes, again;
    bodies_open(&b, NULL);
    if (cases[i].attributes) {
      add_attributes(&b);
    }
    align(&b, cases[i].method, cases[i].landmarks, &made);
    add_shares(&b, &made);
    made.has_followed = made.landmark_count > 0;
    made.match.is_part = made.match.is_measured; /* these bodies are no parts, but the member must be kept */
    assert_int_equal(orb_alignment_write(b.ctx, b.shape, &made, &bytes), ORB_OK);
    assert_int_equal(orb_alignment_read(b.ctx, bytes.data, bytes.size, b.shape, 2, &read), ORB_OK);
    check_same(&made, &read);
    assert_int_equal(orb_alignment_write(b.ctx, b.shape, &read, &again), ORB_OK);
    assert_int_equal(bytes.size, again.size);
    assert_memory_equal(bytes.data, again.data, bytes.size);
    size_t vertices = (size_t)(made.shapes[0].mesh.vertex_count + made.shapes[1].mesh.vertex_count);
    size_t given = (size_t)(b.mesh[0].vertex_count + b.mesh[1].vertex_count);
    assert_int_equal(vertices > given, cases[i].method == ORB_ALIGN_PIN);
    assert_true(vertices > given || bytes.size < 24 * vertices + 2000);
    orb_buffer_free(b.ctx, &bytes);
    orb_buffer_free(b.ctx, &again);
    orb_alignment_free(b.ctx, &made);
    orb_alignment_free(b.ctx, &read);
    remove_attributes(&b);
    bodies_close(&b);
  }
}

static int is_refused(bodies *b, const unsigned char *bytes, size_t size, const orb_align_shape *shapes) {
  orb_alignment read;
  orb_status status = orb_alignment_read(b->ctx, bytes, size, shapes, 2, &read);
  static const orb_alignment none;
  if (status == ORB_OK) {
    orb_alignment_free(b->ctx, &read);
    return 0;
  }
  assert_int_equal(status, ORB_E_BAD_OPTION);
  assert_memory_equal(&read, &none, sizeof none);
  return 1;
}

/* An alignment that is cut anywhere is refused. One with any byte of its numbers changed is refused or gives a
 * certified alignment. */
static void damage_is_refused(void **state) {
  (void)state;
  bodies b;
  orb_alignment made;
  orb_buffer bytes;
  bodies_open(&b, NULL);
  align(&b, ORB_ALIGN_PIN, 30, &made);
  assert_int_equal(orb_alignment_write(b.ctx, b.shape, &made, &bytes), ORB_OK);
  const orb_align_shape swapped[2] = {b.shape[1], b.shape[0]}, other[2] = {b.shape[0], b.shape[2]};
  assert_false(is_refused(&b, bytes.data, bytes.size, b.shape));
  assert_true(is_refused(&b, bytes.data, bytes.size, swapped));
  assert_true(is_refused(&b, bytes.data, bytes.size, other));
  b.mesh[1].positions[4] += 1e-9; /* the same connectivity */
  assert_true(is_refused(&b, bytes.data, bytes.size, b.shape));
  b.mesh[1].positions[4] -= 1e-9;
  for (size_t size = 0; size < bytes.size; size += size < 200 ? 1 : bytes.size / 60) {
    assert_true(is_refused(&b, bytes.data, size, b.shape));
  }
  unsigned char *copy = ORB_NEW(b.ctx, unsigned char, bytes.size + 1);
  assert_non_null(copy);
  memcpy(copy, bytes.data, bytes.size);
  copy[bytes.size] = 0;
  assert_true(is_refused(&b, copy, bytes.size + 1, b.shape));
  for (size_t at = 0; at < 28; at++) { /* magic, version, byte order, counts of shapes and landmarks */
    copy[at] ^= 0x55;
    assert_true(is_refused(&b, copy, bytes.size, b.shape));
    copy[at] ^= 0x55;
  }
  int refused = 0, tried = 0;
  for (size_t at = 28; at < bytes.size; at += bytes.size / 300 + 1, tried++) {
    copy[at] ^= 0xff;
    refused += is_refused(&b, copy, bytes.size, b.shape);
    copy[at] ^= 0xff;
  }
  assert_true(refused > tried / 10 && tried > 200);
  orb_free(b.ctx, copy);
  orb_buffer_free(b.ctx, &bytes);
  orb_alignment_free(b.ctx, &made);
  bodies_close(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_read_was_written), cmocka_unit_test(damage_is_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
