/* Replacing a disc of triangles by the star of one vertex. */
#ifndef ORB_REMESH_ADAPTIVE_STAR_H
#define ORB_REMESH_ADAPTIVE_STAR_H

#include "remesh/placed/placed_net.h"

/* What a star must achieve for inverted triangles: fewer of them, or no more of them and much smaller ones. */
typedef enum orb_star_goal { ORB_STAR_FEWER, ORB_STAR_SMALLER } orb_star_goal;
typedef struct orb_star_wish {
  double limit2;               /* relative, squared */
  int least_inner, most_inner; /* vertices inside the disc: the star has 2 − 2 · inner triangles more than the disc */
  orb_star_goal goal;
} orb_star_wish;
/* Replaces the given triangles, a disc that holds the points, and as many triangles beyond its edges as necessary, by
 * the star of the first of the points that stays within the limit and meets the goal. Returns whether there is one.
 * Needs room for one vertex. */
int orb_adaptive_star(orb_placed_net *placed, const int32_t *triangles, int count, const double (*points)[3],
                      int point_count, const orb_star_wish *wish);
/* Whether orb_adaptive_star() would succeed. From any thread; needs room for as many vertices as there are threads. */
int orb_adaptive_can_star(orb_placed_net *placed, const int32_t *triangles, int count, const double (*points)[3],
                          int point_count, const orb_star_wish *wish, int thread);

#endif
