/* The method `kernel-sampling`: Peng & Timalsena 2016, sections 4 to 6 and Algorithm 1, with every parameter named in
 * orb_embed_options. A progressive mesh is refined vertex by vertex; each new vertex takes the best of the sample
 * points (Eq. 2) that lie in its spherical kernel under the error of Eq. 3; global optimisation runs in between
 * (Algorithm 1).
 *
 * Where the paper leaves a gap or errs, this is done instead:
 * - Eq. 1 depends on scale and blows up as the curvature nears −1: the area is normalised to 4π first and the factor is
 *   continued along its tangent for negative curvature (see simplify.c). A collapse keeps the link condition.
 * - Areas are carried: in Eq. 3 a triangle of the coarse mesh M_i has the area of the part of the input that it stands
 *   for. A collapsed star hands on its whole area. With the area of M_i itself a limb that is gone has no room to come
 *   back to. The sum is then the same for each M_i, and with it the radius of Eq. 4: the sphere is the unit sphere, the
 *   area 4π.
 * - The area term of Eq. 3 as printed, ((A' + A) / A)^ϱ, does not punish shrinking, against the text. The term here is
 *   (A'/A + A/A')^ϱ (Degener, Meseth & Klein 2003), which does.
 * - The base mesh is projected from its centroid only if that keeps its orientation exactly; a flat or inside-out
 *   tetrahedron is placed as a regular one.
 * - Sampling may find no point in a narrow kernel. Then a point of the kernel itself is taken (kernel.h).
 * - Eq. 1 removes limbs as a whole, one after the other, so that they come back in one piece, hundreds of vertices
 *   between two global optimisations. Where a new vertex finds its ring with less than 0.3 of its area, the two rings
 *   around it are optimised at once, 3 sweeps. Where doubles cannot hold a kernel all the same, the surroundings are
 *   optimised with φ = 1 and the insertion is tried again; as a last resort the whole is done again with more sweeps.
 * - A ring squeezed to 1e-4 of its area is measured with φ = 1: its triangles are past saving by shape alone.
 * - In Algorithm 1 the vertex's present place competes with the samples, so the error never rises. A vertex takes part
 *   in an iteration if it or a neighbour moved in the one before: any other would find what it found then. neiDisp is
 *   the sum of those displacements, as in lines 4 and 12. max_iterations, not given in the paper, is 25; its Table 1
 *   has 10 to 24 on average.
 * - "A few thousand" of section 9.2 is qem_until, 6,000: more vertices than that are first reduced by quadric errors.
 * - Triangles of the mesh without area get a floor of a hundredth of the mean, since Eq. 3 divides by it.
 * The sign of every placement is decided exactly, and the result is certified like that of the other method.
 */
#ifndef ORB_EMBED_KERNEL_SAMPLING_KERNEL_SAMPLING_H
#define ORB_EMBED_KERNEL_SAMPLING_KERNEL_SAMPLING_H

#include "orbmorph/embed.h"

/* What the paper's Table 1 and Fig. 13 report. */
typedef struct orb_ks_report {
  double simplify_seconds, place_seconds, optimize_seconds;
  double kernel_points; /* average number inside the kernel, a placement */
  double iterations;    /* average of Algorithm 1, an execution */
  int32_t executions;   /* of Algorithm 1 */
  int32_t clipped;      /* placements that no sample served */
  int32_t loosened;     /* placements into dense regions */
  int32_t relieved;     /* placements that had to wait for room */
  int32_t attempts;     /* 1, but for meshes made to break the method */
  /* Called after each execution of Algorithm 1 with the vertices inserted so far; may be NULL. */
  void (*trace)(void *user, int32_t inserted, double place_seconds, double optimize_seconds);
  void *trace_user;
} orb_ks_report;

/* Writes 3 doubles a vertex to points. Not yet certified. One thread (section 9.1: the order of Algorithm 1 makes each
 * step depend on the one before). About n·log n·samples time. report may be NULL. */
ORB_MUST_CHECK orb_status orb_kernel_sampling(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options,
                                              double *points, orb_ks_report *report);

#endif
