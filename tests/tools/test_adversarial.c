/* Every generated mesh is closed, consistently oriented and of genus zero; same seed, same bytes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "adversarial.h"

static int compare_edges(const void *a, const void *b) {
  const int32_t *p = a, *q = b;
  return p[0] != q[0] ? (p[0] > q[0]) - (p[0] < q[0]) : (p[1] > q[1]) - (p[1] < q[1]);
}

static void check_sphere(const adversarial_mesh *m) {
  size_t count = 3 * (size_t)m->triangle_count;
  int32_t(*edge)[2] = malloc(count * sizeof *edge);
  assert_non_null(edge);
  for (size_t h = 0; h < count; h++) {
    edge[h][0] = m->triangles[h];
    edge[h][1] = m->triangles[h % 3 == 2 ? h - 2 : h + 1];
    assert_true(edge[h][0] >= 0 && edge[h][0] < m->vertex_count && edge[h][0] != edge[h][1]);
  }
  qsort(edge, count, sizeof *edge, compare_edges);
  for (size_t h = 0; h < count; h++) {
    assert_true(h == 0 || compare_edges(edge[h - 1], edge[h]) != 0); /* every directed edge once */
    const int32_t back[2] = {edge[h][1], edge[h][0]};
    assert_non_null(bsearch(back, edge, count, sizeof *edge, compare_edges));
  }
  assert_int_equal(m->vertex_count - (int32_t)(count / 2) + m->triangle_count, 2);
  free(edge);
}

static void spheres(void **state) {
  (void)state;
  for (int kind = 0; kind < ADV_KIND_COUNT; kind++) {
    for (uint64_t seed = 1; seed <= 4; seed++) {
      adversarial_mesh m = adversarial_make((adversarial_kind)kind, seed, seed == 1 ? 40 : 3000);
      adversarial_mesh again = adversarial_make((adversarial_kind)kind, seed, seed == 1 ? 40 : 3000);
      check_sphere(&m);
      assert_int_equal(m.vertex_count, again.vertex_count);
      assert_memory_equal(m.positions, again.positions, (size_t)m.vertex_count * sizeof(double[3]));
      adversarial_free(&m);
      adversarial_free(&again);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(spheres)};
  return cmocka_run_group_tests_name("adversarial", tests, NULL, NULL);
}
