/* Median cut (P. Heckbert, Color image quantization for frame buffer display, SIGGRAPH 1982): cuts the box of colours
 * with the largest weight at its median until there are 256. Colours are counted at 7 bits per channel. */
#include "view_palette.h"

#include <stdint.h>
#include <stdlib.h>

enum { BITS = 7, SIDE = 1 << BITS, BINS = SIDE * SIDE * SIDE };

typedef struct color {
  unsigned char at[3]; /* the upper 7 bits of each channel */
  uint32_t count;      /* of pixels */
} color;

typedef struct box {
  int first, end, axis;
  uint64_t weight; /* pixels × squared spread along the axis; 0: cannot be cut */
} box;

static int bin_of(const unsigned char *p) {
  return (p[0] >> (8 - BITS)) << (2 * BITS) | (p[1] >> (8 - BITS)) << BITS | p[2] >> (8 - BITS);
}

static void measure(const color *colors, box *b) {
  unsigned char low[3] = {SIDE - 1, SIDE - 1, SIDE - 1}, high[3] = {0};
  uint64_t count = 0;
  for (int i = b->first; i < b->end; i++) {
    count += colors[i].count;
    for (int c = 0; c < 3; c++) {
      low[c] = colors[i].at[c] < low[c] ? colors[i].at[c] : low[c];
      high[c] = colors[i].at[c] > high[c] ? colors[i].at[c] : high[c];
    }
  }
  b->axis = 0;
  for (int c = 1; c < 3; c++) {
    b->axis = high[c] - low[c] > high[b->axis] - low[b->axis] ? c : b->axis;
  }
  uint64_t spread = (uint64_t)(high[b->axis] - low[b->axis]);
  b->weight = count * spread * spread;
}

static int by_red(const void *a, const void *b) {
  return ((const color *)a)->at[0] - ((const color *)b)->at[0];
}
static int by_green(const void *a, const void *b) {
  return ((const color *)a)->at[1] - ((const color *)b)->at[1];
}
static int by_blue(const void *a, const void *b) {
  return ((const color *)a)->at[2] - ((const color *)b)->at[2];
}

/* Cuts b after half of its pixels; both parts keep at least one colour. Returns the upper part. */
static box cut(color *colors, box *b) {
  static int (*const orders[3])(const void *, const void *) = {by_red, by_green, by_blue};
  uint64_t all = 0, below = 0;
  qsort(colors + b->first, (size_t)(b->end - b->first), sizeof *colors, orders[b->axis]);
  for (int i = b->first; i < b->end; i++) {
    all += colors[i].count;
  }
  int middle = b->first + 1;
  for (below = colors[b->first].count; middle < b->end - 1 && 2 * below < all; middle++) {
    below += colors[middle].count;
  }
  box upper = {middle, b->end, 0, 0};
  b->end = middle;
  measure(colors, b);
  measure(colors, &upper);
  return upper;
}

static int make_boxes(color *colors, int count, box boxes[256]) {
  int made = 1;
  boxes[0] = (box){0, count, 0, 0};
  measure(colors, &boxes[0]);
  while (made < 256) {
    int widest = 0;
    for (int i = 1; i < made; i++) {
      widest = boxes[i].weight > boxes[widest].weight ? i : widest;
    }
    if (boxes[widest].weight == 0) {
      break;
    }
    boxes[made] = cut(colors, &boxes[widest]);
    made++;
  }
  return made;
}

/* The colours that occur, each with its number of pixels. The caller frees them. NULL: no memory. */
static color *count_colors(const unsigned char *rgb, size_t pixels, int *count) {
  uint32_t *bins = calloc(BINS, sizeof *bins);
  *count = 0;
  if (!bins) {
    return NULL;
  }
  for (size_t i = 0; i < pixels; i++) {
    *count += bins[bin_of(rgb + 3 * i)]++ == 0;
  }
  color *out = malloc((size_t)*count * sizeof *out);
  for (int i = 0, fill = 0; out && i < BINS; i++) {
    if (bins[i]) {
      out[fill].count = bins[i];
      for (int c = 0; c < 3; c++) {
        out[fill].at[c] = (unsigned char)(i >> ((2 - c) * BITS) & (SIDE - 1));
      }
      fill++;
    }
  }
  free(bins);
  return out;
}

/* The mean colour of a box, scaled so that the lowest value is 0 and the highest 255. */
static void mean_color(const color *colors, const box *b, unsigned char out[3]) {
  for (int c = 0; c < 3; c++) {
    uint64_t count = 0, sum = 0;
    for (int i = b->first; i < b->end; i++) {
      count += colors[i].count;
      sum += (uint64_t)colors[i].at[c] * colors[i].count;
    }
    out[c] = (unsigned char)((255 * sum + count * (SIDE - 1) / 2) / (count * (SIDE - 1)));
  }
}

int view_palette(const unsigned char *rgb, size_t pixels, unsigned char palette[256][3], unsigned char *out) {
  box boxes[256];
  int count, made = 0;
  color *colors = count_colors(rgb, pixels, &count);
  unsigned char *place = malloc(BINS);
  if (colors && place) {
    made = make_boxes(colors, count, boxes);
    for (int k = 0; k < made; k++) {
      mean_color(colors, &boxes[k], palette[k]);
      for (int i = boxes[k].first; i < boxes[k].end; i++) {
        place[colors[i].at[0] << (2 * BITS) | colors[i].at[1] << BITS | colors[i].at[2]] = (unsigned char)k;
      }
    }
    for (size_t i = 0; i < pixels; i++) {
      out[i] = place[bin_of(rgb + 3 * i)];
    }
  }
  free(colors);
  free(place);
  return made;
}
