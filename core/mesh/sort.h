/* Sorting in place, as qsort() may allocate: short runs by insertion, long ones by heap. */
#ifndef ORB_MESH_SORT_H
#define ORB_MESH_SORT_H

#include <stdint.h>

static inline void orb_sift_u64(uint64_t *a, int64_t root, int64_t count) {
  uint64_t value = a[root];
  for (int64_t child; (child = 2 * root + 1) < count; root = child) {
    child += child + 1 < count && a[child + 1] > a[child];
    if (a[child] <= value) {
      break;
    }
    a[root] = a[child];
  }
  a[root] = value;
}

static inline void orb_sort_u64(uint64_t *a, int64_t count) {
  if (count <= 32) {
    for (int64_t i = 1; i < count; i++) {
      uint64_t value = a[i];
      int64_t j = i;
      for (; j > 0 && a[j - 1] > value; j--) {
        a[j] = a[j - 1];
      }
      a[j] = value;
    }
    return;
  }
  for (int64_t i = count / 2; i-- > 0;) {
    orb_sift_u64(a, i, count);
  }
  for (int64_t i = count - 1; i > 0; i--) {
    uint64_t top = a[0];
    a[0] = a[i];
    a[i] = top;
    orb_sift_u64(a, 0, i);
  }
}

#endif
