/* What a trial's poses tell beside their bend.
 *
 * A wrong limb may bend a shape no more than the right one. But then its pose swells or shrinks it, or turns outside
 * what faces elsewhere on the other shape. A pose is a copy's vertices where a registration has put them on the other
 * copy. O(n log n) for n vertices and triangles. */
#ifndef ORB_ALIGN_FIND_EVIDENCE_H
#define ORB_ALIGN_FIND_EVIDENCE_H

#include "orbmorph/mesh.h"

/* The angle of the rotation that carries the copy best onto its pose, over π. */
double orb_evidence_rotated(const orb_mesh *copy, const double *pose);

/* How much the pose resizes the copy's triangles: the mean of |ln(area there / area here)|, weighted by areas. The
 * shapes must have the same area. Areas below ORB_FIND_RESIZED_LEAST count as that. */
double orb_evidence_resized(const orb_mesh *copy, const double *pose);

/* How unlike the copy's normals are to those of the other one's triangles that are nearest to the pose, after the
 * rotation that makes them most alike: 1 − the mean cosine, weighted by areas. tree: of `other`. */
double orb_evidence_scattered(const orb_mesh *copy, const double *pose, const orb_mesh *other, const orb_nearest *tree);

#endif
