/* Where a small shape may lie in a large one: at which turns, sizes and nodes of a grid the two surfaces nearly meet.
 * No sample is compared with a triangle, so a million similarities take a twentieth of a second. */
#ifndef ORB_ALIGN_FIND_INSET_STARTS_H
#define ORB_ALIGN_FIND_INSET_STARTS_H

#include "align/find/inset/grid.h"
#include "align/find/inset/similarity.h"

enum {
  ORB_INSET_TURNS = 60, /* rotations that take a dodecahedron to itself: any rotation is within 45° of one of them */
  ORB_INSET_FINE_TURNS = 5 * ORB_INSET_TURNS,
  ORB_INSET_STARTS = ORB_INSET_TURNS * ORB_FIND_INSET_SIZES,
  ORB_INSET_STARTS_MOST = 2 * ORB_INSET_STARTS /* those of the grid, and those where landmarks meet */
};

/* A point of the small shape, around the middle of its box, and its unit normal. */
typedef struct orb_inset_sample {
  double position[3], normal[3];
} orb_inset_sample;

/* Writes ORB_INSET_FINE_TURNS rotations, all about as far from the next ones: ORB_INSET_TURNS of them, and each again
 * after a rotation by ORB_FIND_INSET_BETWEEN about each of the axes of a tetrahedron. */
void orb_inset_fine_turns(double (*rotation)[9]);

/* Finds the best node for each turn and each of ORB_FIND_INSET_SIZE, and writes these similarities, ORB_INSET_STARTS at
 * most: a turn and a size that lie badly everywhere have none. sample: ORB_FIND_INSET_LOOKUPS of them. O(nodes · turns
 * · sizes · samples). */
ORB_MUST_CHECK orb_status orb_inset_starts(orb_context *ctx, const orb_inset_grid *grid, const orb_inset_sample *sample,
                                           orb_similarity *start, int32_t *count);

/* Writes the similarities of each turn and each size that take the point `from` of the small shape to `to`. */
void orb_inset_starts_at(const double from[3], const double to[3], orb_similarity start[ORB_INSET_STARTS]);

#endif
