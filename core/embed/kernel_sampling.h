/* The method `kernel-sampling`: Peng & Timalsena 2016, sections 4 to 6 and Algorithm 1, with every parameter named in
 * orb_embed_options. A progressive mesh is refined vertex by vertex; each new vertex takes the best of the sample
 * points (Eq. 2) that lie in its spherical kernel under the error of Eq. 3; global optimisation runs in between
 * (Algorithm 1).
 *
 * Where the paper leaves a gap or errs, this is done instead:
 * - Eq. 1 depends on scale and blows up as the curvature nears −1: the area is normalised to 4π first and the factor is
 *   continued along its tangent for negative curvature (see ks_simplify.c). A collapse keeps the link condition.
 * - Eq. 4 scales the sphere with every insertion; the sphere here stays of radius 1 and the mesh's areas are scaled by
 *   4π / area(M_i) instead, which is the same in Eq. 3 and keeps the stored points on the unit sphere.
 * - The base mesh is projected from its centroid only if that keeps its orientation exactly; a flat or inside-out
 *   tetrahedron is placed as a regular one.
 * - Sampling may find no point in a narrow kernel. Then the kernel itself is clipped from the half-spaces in a gnomonic
 *   chart and its centroid taken, so that the insertion is valid.
 * - In Algorithm 1 the vertex's present place competes with the samples, so the error never rises. A vertex takes part
 * in an iteration if it or a neighbour moved in the one before: any other would find what it found then. neiDisp is the
 *   sum of those displacements, as in lines 4 and 12. max_iterations, not given in the paper, is 30, where its Fig. 7
 *   converges.
 * - "A few thousand" of section 9.2 is qem_until, 6,000: more vertices than that are first reduced by quadric errors.
 * - Triangles of the mesh without area get a floor of 1e-7 of the mean, since Eq. 3 divides by it.
 * The sign of every placement is decided exactly, and the result is certified like that of the other method.
 */
#ifndef ORB_EMBED_KERNEL_SAMPLING_H
#define ORB_EMBED_KERNEL_SAMPLING_H

#include "orbmorph/embed.h"

/* What the paper's Table 1 and Fig. 13 report. */
typedef struct orb_ks_report {
  double simplify_seconds, place_seconds, optimize_seconds;
  double kernel_points;      /* average number inside the kernel, a placement */
  double iterations;         /* average of Algorithm 1, an execution */
  int32_t executions;        /* of Algorithm 1 */
  int32_t clipped, relieved; /* placements that no sample served; that had to wait for room */
  /* Called after each execution of Algorithm 1 with the vertices inserted so far; may be NULL. */
  void (*trace)(void *user, int32_t inserted, double place_seconds, double optimize_seconds);
  void *trace_user;
} orb_ks_report;

/* Writes 3 doubles a vertex to points. Not yet certified. One thread (section 9.1: the order of Algorithm 1 makes each
 * step depend on the one before). About n·log n·samples time. report may be NULL. */
ORB_MUST_CHECK orb_status orb_kernel_sampling(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                              double *points, orb_ks_report *report);

#endif
