/* Disjoint sets against labels that are rewritten at each join. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/forest.h"

enum { COUNT = 200, JOINS = 260 };

static uint32_t draw(uint64_t *seed) {
  *seed = *seed * 6364136223846793005ULL + 1442695040888963407ULL;
  return (uint32_t)(*seed >> 33);
}

/* Gives all of the set of b the label of a, or the reverse: the lesser one stays. */
static int relabel(int32_t *label, int32_t a, int32_t b) {
  const int32_t x = label[a], y = label[b], least = x < y ? x : y;
  for (int32_t i = 0; i < COUNT; i++) {
    label[i] = label[i] == x || label[i] == y ? least : label[i];
  }
  return x != y;
}

static void joins_are_those_of_labels(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 20; seed++) {
    int32_t root[COUNT], label[COUNT], sets = COUNT;
    uint64_t next = seed;
    orb_forest_plant(root, COUNT);
    orb_forest_plant(label, COUNT);
    for (int i = 0; i < JOINS; i++) {
      const int32_t a = (int32_t)(draw(&next) % COUNT), b = (int32_t)(draw(&next) % COUNT);
      const int joined = orb_forest_join(root, a, b);
      assert_int_equal(joined, relabel(label, a, b));
      sets -= joined;
    }
    int32_t roots = 0;
    for (int32_t i = 0; i < COUNT; i++) {
      assert_int_equal(orb_forest_root(root, i), label[i]);
      roots += root[i] == i;
    }
    assert_int_equal(roots, sets);
    assert_true(sets > 1 && sets < COUNT);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(joins_are_those_of_labels)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
