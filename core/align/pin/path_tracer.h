/* Paths between vertices of a sheet that do not cross one another. */
#ifndef ORB_ALIGN_PIN_PATH_TRACER_H
#define ORB_ALIGN_PIN_PATH_TRACER_H

#include "align/pin/paths.h"

/* A node is a vertex (2 v) or the middle of an edge (2 h + 1, h the lesser half-edge). */
typedef struct orb_path_node {
  double estimate, cost; /* length of the whole path, and of its part up to the node */
  int32_t node;
} orb_path_node;

typedef struct orb_path_tracer {
  orb_context *ctx;
  orb_sheet *sheet;
  orb_paths *paths;
  double *cost; /* of each node */
  int32_t *from, *stamp, nodes, now;
  unsigned char
      *gate; /* of each half-edge, bits: 1: its triangle may be entered from its origin, 2: it may be walked */
  orb_path_node *heap;
  int32_t heap_count, heap_capacity;
  int64_t *work;  /* visits of nodes that are left: a search that spends them ends without a path */
  int32_t *chain; /* nodes of the path found, back to front */
  int32_t chain_count;
  double bound, length; /* longest path to look for (0: no bound); the length of the one found */
} orb_path_tracer;

ORB_MUST_CHECK orb_status orb_path_tracer_fit(orb_path_tracer *tracer);
void orb_path_tracer_free(orb_path_tracer *tracer);

/* The outgoing half-edge of v on path `name`; −1: none. */
int32_t orb_path_tracer_outgoing(const orb_path_tracer *tracer, int32_t v, int32_t name);

/* Opens or closes the gates around an end of a future path: the sector from half-edge `first`, on a path,
 * counter-clockwise to `last`, on a path; first −1: every sector. */
void orb_path_tracer_gates(orb_path_tracer *tracer, int32_t v, int32_t first, int32_t last, int open);

/* Finds the shortest path through the gates of `from` and `to` that meets no other path; *found 0: none. */
ORB_MUST_CHECK orb_status orb_path_tracer_search(orb_path_tracer *tracer, int32_t from, int32_t to, int *found);

/* Raises lower bounds of the lengths of paths from one end, through any gates, to all others. End k is the vertex v
 * with mark[v] = k (−1: no end; vertices from mark_count on are not ends); distance[k] rises to the true length, or to
 * the radius if that is less. */
ORB_MUST_CHECK orb_status orb_path_tracer_ball(orb_path_tracer *tracer, int32_t from, double radius,
                                               const int32_t *mark, int32_t mark_count, double *distance,
                                               int32_t distance_count);

/* Makes the path found a chain of edges of the sheet under a name, and straightens it. *good 0: it broke. */
ORB_MUST_CHECK orb_status orb_path_tracer_lay(orb_path_tracer *tracer, int32_t name, int *good);

#endif
