/* Frames of tangent planes. */
#ifndef ORB_NUMERIC_FRAME_H
#define ORB_NUMERIC_FRAME_H

/* An orthonormal frame of the tangent plane at a unit vector: e1, e2 and p are right-handed (Duff et al. 2017). */
void orb_tangent_frame(const double p[3], double e1[3], double e2[3]);

#endif
