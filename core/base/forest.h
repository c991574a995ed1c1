/* Disjoint sets of the numbers 0 to n − 1, as a forest in one array: root[i] is i, or nearer to the root of its set. */
#ifndef ORB_BASE_FOREST_H
#define ORB_BASE_FOREST_H

#include <stdint.h>

/* Every number becomes a set of its own. O(n). */
static inline void orb_forest_plant(int32_t *root, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    root[i] = i;
  }
}

/* The least number of the set of i. Halves the path to it (Tarjan & van Leeuwen 1984). O(log n) in the mean over calls.
 */
static inline int32_t orb_forest_root(int32_t *root, int32_t i) {
  while (root[i] != i) {
    i = root[i] = root[root[i]];
  }
  return i;
}

/* Joins the sets of a and b. Returns 0 if they are one already. The lesser root stays, so the roots do not depend on
 * the order of the calls. */
static inline int orb_forest_join(int32_t *root, int32_t a, int32_t b) {
  a = orb_forest_root(root, a);
  b = orb_forest_root(root, b);
  root[a < b ? b : a] = a < b ? a : b;
  return a != b;
}

#endif
