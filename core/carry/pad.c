/* Padding: linear filters and smaller levels of a texture read texels beyond the rim of a chart. */
#include "carry/pad.h"

#include <stddef.h>

enum { KNOWN = 1, QUEUED = 2 };

/* The neighbour k (0 to 7) of a texel; −1: beyond the picture. */
static int32_t neighbour(int32_t at, int32_t side, int k) {
  static const int step[8][2] = {{-1, -1}, {0, -1}, {1, -1}, {-1, 0}, {1, 0}, {-1, 1}, {0, 1}, {1, 1}};
  int32_t x = at % side + step[k][0], y = at / side + step[k][1];
  return x >= 0 && y >= 0 && x < side && y < side ? y * side + x : -1;
}

static void fill_from_known(unsigned char *rgba, const unsigned char *known, int32_t side, int32_t at) {
  int sum[4] = {0}, count = 0;
  for (int k = 0; k < 8; k++) {
    int32_t next = neighbour(at, side, k);
    if (next >= 0 && known[next] == KNOWN) {
      for (int c = 0; c < 4; c++) {
        sum[c] += rgba[4 * (size_t)next + (size_t)c];
      }
      count++;
    }
  }
  for (int c = 0; c < 4 && count > 0; c++) {
    rgba[4 * (size_t)at + (size_t)c] = (unsigned char)((sum[c] + count / 2) / count);
  }
}

static void fill_rest(unsigned char *rgba, const unsigned char *known, size_t count) {
  uint64_t sum[4] = {0}, all = 0;
  for (size_t i = 0; i < count; i++) {
    if (known[i]) {
      for (size_t c = 0; c < 4; c++) {
        sum[c] += rgba[4 * i + c];
      }
      all++;
    }
  }
  for (size_t i = 0; i < count && all > 0; i++) {
    for (size_t c = 0; c < 4 && !known[i]; c++) {
      rgba[4 * i + c] = (unsigned char)((sum[c] + all / 2) / all);
    }
  }
}

/* Appends the unknown neighbours of a texel to the queue. */
static int32_t reach(unsigned char *known, int32_t side, int32_t at, int32_t *queue, int32_t end) {
  for (int k = 0; k < 8; k++) {
    int32_t next = neighbour(at, side, k);
    if (next >= 0 && known[next] == 0) {
      known[next] = QUEUED;
      queue[end++] = next;
    }
  }
  return end;
}

void orb_pad(unsigned char *rgba, unsigned char *known, int32_t side, int32_t rings, int32_t *queue) {
  int32_t count = side * side, begin = 0, end = 0;
  for (int32_t i = 0; i < count; i++) {
    if (known[i] == KNOWN) {
      end = reach(known, side, i, queue, end);
    }
  }
  for (int32_t ring = 0; ring < rings && begin < end; ring++) {
    int32_t last = end;
    for (int32_t i = begin; i < last; i++) {
      fill_from_known(rgba, known, side, queue[i]);
    }
    for (int32_t i = begin; i < last; i++) { /* only now, so that the order does not matter */
      known[queue[i]] = KNOWN;
    }
    for (int32_t i = begin; i < last && ring + 1 < rings; i++) {
      end = reach(known, side, queue[i], queue, end);
    }
    begin = last;
  }
  for (int32_t i = begin; i < end; i++) {
    known[queue[i]] = 0;
  }
  fill_rest(rgba, known, (size_t)count);
}
