/* Marks: 64-bit digests of what a search depends on. A search that found nothing keeps its mark and is skipped while
 * the mark stays the same. If two states have equal marks (probability about 2⁻⁶⁴), one search is skipped wrongly. That
 * cannot falsify a bound, because orb_placed_bounds() uses no marks. */
#ifndef ORB_REMESH_PLACED_MARKS_H
#define ORB_REMESH_PLACED_MARKS_H

#include <string.h>

#include "sphere/net.h"

/* Mixes `size` bytes, a multiple of 8, into a mark. */
static inline uint64_t orb_mark_mix(uint64_t mark, const void *part, size_t size) {
  uint64_t word;
  for (const unsigned char *p = part, *end = p + size; p < end; p += sizeof word) {
    memcpy(&word, p, sizeof word);
    mark = (mark ^ word) * UINT64_C(0x9E3779B97F4A7C15);
    mark ^= mark >> 29;
  }
  return mark;
}

static inline uint64_t orb_mark_of_point(const double p[3]) {
  uint64_t word[3];
  memcpy(word, p, sizeof word);
  uint64_t mark = word[0] * UINT64_C(0x9E3779B97F4A7C15) + word[1] * UINT64_C(0xC2B2AE3D27D4EB4F) +
                  word[2] * UINT64_C(0x165667B19E3779F9);
  mark = (mark ^ mark >> 32) * UINT64_C(0xD6E8FEB86659FD93);
  return mark ^ mark >> 29;
}

/* Fills ring for all vertices that are not dead: the sums of the marks of their neighbours' points. O(vertices). */
void orb_marks_of_rings(orb_context *ctx, const orb_net *net, uint64_t *ring);

/* Covers the points of v's neighbours and of their neighbours. A sum, so independent of the order of the rings. Without
 * `ring`, the marks of all neighbours of a vertex with n neighbours would take n² steps. O(neighbours). */
uint64_t orb_mark_of_surroundings(const orb_net *net, const uint64_t *ring, int32_t v);

/* Keep ring as orb_net_collapse() and orb_net_fill() change the net: call them before. neighbour: those of u, n of
 * them, counter-clockwise. u moves onto number `at` of them, or goes, and the triangles fill its hole (corners as of
 * orb_net_fill()). They write to the entries of the neighbours alone. */
void orb_marks_collapse(const orb_net *net, uint64_t *ring, int32_t u, const int32_t *neighbour, int n, int at);
void orb_marks_fill(const orb_net *net, uint64_t *ring, int32_t u, const int32_t *neighbour, int n,
                    int (*triangles)[3]);

#endif
