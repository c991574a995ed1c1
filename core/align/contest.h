/* The contest of the two best matches of shapes that bend much.
 *
 * Such matches lead to maps by landmark walks, whose energy on a coarse level tells which map will be the better one:
 * of 57 pairs of other kinds, the match whose walk had clearly less energy also had the better map in all. So both are
 * walked, side by side, and only the better one is finished. */
#ifndef ORB_ALIGN_CONTEST_H
#define ORB_ALIGN_CONTEST_H

#include "align/find/match.h"
#include "orbmorph/alignment.h"
#include "orbmorph/remesh.h"

/* Does the next best match of shapes on spheres that keep angles take part? It does not if it is far behind. */
int orb_contest_is_open(const orb_match *match, int keep_angles);

/* Composes an alignment of two rotated spheres that keep angles towards the better of the two best matches, and fills
 * alignment->energy and match->target. *target: NULL if the best match has won; otherwise that of the next best one, and the caller's to
 * free. *clear: then how clearly it has won, 0 to 1. */
ORB_MUST_CHECK orb_status orb_contest_run(orb_context *ctx, orb_match *match, orb_preset preset,
                                          orb_alignment *alignment, double **target, double *clear);

#endif
