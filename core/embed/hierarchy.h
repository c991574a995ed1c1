/* Multiresolution under an embedding: a decimation that can be undone exactly, and the refiner that undoes it on the
 * sphere. What `newton` runs from end to end, alignment runs in parts: it stops at a coarse level, walks landmarks to
 * their targets, pins them, and refines on. All vertex numbers here are those of the mesh. */
#ifndef ORB_EMBED_HIERARCHY_H
#define ORB_EMBED_HIERARCHY_H

#include "orbmorph/embed.h"

typedef struct orb_hierarchy orb_hierarchy;
typedef struct orb_refiner orb_refiner;

/* Decimates to a tetrahedron with carried areas. keep (vertex_count flags, or NULL): vertices that are not collapsed
 * while more than keep_until vertices live. */
ORB_MUST_CHECK orb_status orb_hierarchy_create(orb_context *ctx, const orb_mesh *mesh, const unsigned char *keep,
                                               int32_t keep_until, orb_hierarchy **out);
void orb_hierarchy_destroy(orb_context *ctx, orb_hierarchy *hierarchy);

/* A refiner at the tetrahedron. A hierarchy serves one refiner at a time. */
ORB_MUST_CHECK orb_status orb_refiner_create(orb_context *ctx, orb_hierarchy *hierarchy,
                                             const orb_embed_options *options, orb_refiner **out);
void orb_refiner_destroy(orb_context *ctx, orb_refiner *refiner);

/* Says that this refiner runs to full resolution and its hierarchy is not used again: what only collapses need is freed
 * as soon as all are undone. End it with orb_refiner_abandon(). */
void orb_refiner_one_way(orb_refiner *refiner);

/* A refiner at full resolution that starts from an embedding at hand (points: 3 a vertex, every triangle positive),
 * with a hierarchy that holds no collapses: for sweeps with pins. Destroy the refiner, then the hierarchy. */
ORB_MUST_CHECK orb_status orb_refiner_resume(orb_context *ctx, const orb_mesh *mesh, const double *points,
                                             const orb_embed_options *options, orb_hierarchy **hierarchy,
                                             orb_refiner **out);

/* Undoes collapses until at least `vertices` live (or all), sweeping levels on the way as an embedding does. Pinned
 * vertices stay where they are, bit for bit. */
ORB_MUST_CHECK orb_status orb_refiner_advance(orb_context *ctx, orb_refiner *refiner, int32_t vertices);
int32_t orb_refiner_live(const orb_refiner *refiner);

/* The present level, in fresh arrays of the caller: live vertices (mesh numbers), and triangles of mesh numbers. */
ORB_MUST_CHECK orb_status orb_refiner_level(orb_context *ctx, const orb_refiner *refiner, int32_t **vertices,
                                            int32_t *vertex_count, int32_t **triangles, int32_t *triangle_count);

/* Position on the sphere of live vertices; set it only inside the kernel of the vertex's ring. */
void orb_refiner_point(const orb_refiner *refiner, int32_t vertex, double out[3]);
void orb_refiner_move(orb_refiner *refiner, int32_t vertex, const double point[3]);
void orb_refiner_pin(orb_refiner *refiner, int32_t vertex, int pinned);

/* `sweeps` Gauss–Seidel sweeps over the present level; *gain (may be NULL) the relative fall of energy by the last. */
ORB_MUST_CHECK orb_status orb_refiner_sweep(orb_context *ctx, orb_refiner *refiner, int32_t sweeps, double *gain);

/* The points of all vertices (3 a vertex, mesh numbers), once all live. */
void orb_refiner_points(const orb_refiner *refiner, double *points);

#endif
