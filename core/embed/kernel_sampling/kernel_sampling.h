/* The method `kernel-sampling`: Peng & Timalsena 2016, sections 4 to 6 and Algorithm 1, with every parameter named in
 * orb_embed_options. A progressive mesh is refined vertex by vertex; each new vertex takes the best of the sample
 * points (Eq. 2) that lie in its spherical kernel under the error of Eq. 3; global optimisation runs in between
 * (Algorithm 1).
 *
 * Where the paper leaves a gap or errs, this implementation differs:
 * - Eq. 1 depends on scale and blows up as the curvature approaches −1. Here the area is first normalised to 4π, and
 *   for negative curvature the factor continues along its tangent (simplify.c). A collapse keeps the link condition.
 * - Areas are carried: in Eq. 3 a triangle of the coarse mesh M_i has the area of the part of the input that it stands
 *   for, and a collapsed star passes on its whole area. With the area of M_i itself, a limb that is gone would have no
 *   room to come back to. So the area is 4π for each M_i, and the radius of Eq. 4 is that of the unit sphere.
 * - The area term of Eq. 3 as printed, ((A' + A) / A)^ϱ, does not penalise shrinking, although the text says it does.
 *   The term here is (A'/A + A/A')^ϱ (Degener, Meseth & Klein 2003), which does.
 * - The base mesh is projected from its centroid only if that keeps its orientation exactly; a flat or inside-out
 *   tetrahedron is placed as a regular one.
 * - Sampling may find no point in a narrow kernel. Then embed/common/kernel.h finds one.
 * - Eq. 1 removes limbs as a whole, one after the other, so they come back in one piece, hundreds of vertices between
 *   two global optimisations. Where the ring of a new vertex has less than 0.3 of its area, the two rings around it are
 *   optimised at once, in 3 sweeps. Where doubles still cannot hold a kernel, its surroundings are optimised with φ = 1
 *   and the insertion is tried again; as a last resort everything is done again with more sweeps.
 * - A ring squeezed to 1e-4 of its area is measured with φ = 1: shape alone can no longer repair its triangles.
 * - In Algorithm 1 the current point of the vertex competes with the samples, so the error never rises. A vertex takes
 *   part in an iteration if it or a neighbour moved in the one before: any other would find what it found then. neiDisp
 *   is the sum of those displacements, as in lines 4 and 12. The paper does not give max_iterations; here it is 25,
 *   while Table 1 has 10 to 24 on average.
 * - "A few thousand" of section 9.2 is qem_until, 6,000: with more vertices, quadric errors reduce the mesh first.
 * - Triangles without area get a floor of a hundredth of the mean, since Eq. 3 divides by the area.
 * The sign of every placement is decided exactly, and the result is certified like that of the other method.
 */
#ifndef ORB_EMBED_KERNEL_SAMPLING_KERNEL_SAMPLING_H
#define ORB_EMBED_KERNEL_SAMPLING_KERNEL_SAMPLING_H

#include "orbmorph/embed.h"

/* What the paper's Table 1 and Fig. 13 report. */
typedef struct orb_ks_report {
  double simplify_seconds, place_seconds, optimize_seconds;
  double kernel_points; /* how many samples of a placement lie in the kernel, on average */
  double iterations;    /* of an execution of Algorithm 1, on average */
  int32_t executions;   /* of Algorithm 1 */
  int32_t clipped;      /* placements for which no sample was allowed */
  int32_t loosened;     /* placements into dense regions */
  int32_t relieved;     /* placements whose kernel had to be widened first */
  int32_t attempts;     /* 1, except for meshes made to break the method */
  /* Called after each execution of Algorithm 1 with the vertices inserted so far; may be NULL. */
  void (*trace)(void *user, int32_t inserted, double place_seconds, double optimize_seconds);
  void *trace_user;
} orb_ks_report;

/* Writes 3 doubles per vertex to points, not certified yet. Runs on one thread: the order of Algorithm 1 makes each
 * step depend on the one before (section 9.1). About O(n log n) times the samples. report may be NULL. */
ORB_MUST_CHECK orb_status orb_kernel_sampling(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                              double *points, orb_ks_report *report);

#endif
