/* Fitting: moves a later shape onto the first. */
#ifndef ORB_TRANSFER_FIT_H
#define ORB_TRANSFER_FIT_H

#include "orbmorph/asset.h"

/* x ↦ scale · R x + shift. */
typedef struct orb_motion {
  orb_fit kind; /* NONE: the identity */
  double rotation[3][3], scale, shift[3];
  double moves; /* distance by which the mean of the fitted points moves */
} orb_motion;

/* The motion that brings `moved` nearest to `fixed` in the least-squares sense (both 3 per supermesh vertex): over the
 * landmarks if there are at least three that lie on no line on either shape, else over all vertices, weighted by the
 * area around them on both shapes. fit NONE gives the identity, and so do both AUTOs unless the frames clearly differ
 * (see orb_fit). Source: Horn 1987; the scale is the ratio of spreads, so that fitting back is the inverse. */
ORB_MUST_CHECK orb_status orb_fit_motion(orb_context *ctx, const orb_supermesh *supermesh, const double *fixed,
                                         const double *moved, orb_fit fit, orb_motion *out);

/* The angle of a rotation, in degrees. */
double orb_motion_degrees(const orb_motion *motion);
/* The diagonal of the box around `count` points. */
double orb_fit_diagonal(const double *positions, int32_t count);

void orb_motion_apply(const orb_motion *motion, double *positions, int32_t count);
/* Rotates `count` unit vectors of float. */
void orb_motion_rotate(const orb_motion *motion, float *vectors, int32_t count);

#endif
