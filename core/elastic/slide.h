/* A slide: a registration along the other surface. */
#ifndef ORB_ELASTIC_SLIDE_H
#define ORB_ELASTIC_SLIDE_H

#include "elastic/pose.h"

/* Slides mesh a over mesh b until the two fit each other in space, from where a map takes its vertices. A map of little
 * energy knows lengths only; a slide knows bumps and hollows as well. Both meshes are scaled to the
 * same area, near 4π, and have no vertex without triangles.
 * Changes the positions, 3 per vertex. *fits 0: the shapes do not fit; the caller drops the positions. O(n
 * · m) a round, 10 to 40 rounds, as long as it moves. On all threads. */
ORB_MUST_CHECK orb_status orb_elastic_slide(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                            const orb_elastic_anchors *anchors, double *position, int *fits);

#endif
