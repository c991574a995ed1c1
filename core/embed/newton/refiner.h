/* The refiner of a hierarchy: the points on the sphere of the vertices that are currently alive. Vertex numbers here
 * are those of the mesh. */
#ifndef ORB_EMBED_NEWTON_REFINER_H
#define ORB_EMBED_NEWTON_REFINER_H

#include "embed/newton/hierarchy.h"
#include "embed/newton/settings.h"
#include "orbmorph/embed.h"

typedef struct orb_refiner orb_refiner;

/* A refiner at the tetrahedron. A hierarchy serves one refiner at a time. */
ORB_MUST_CHECK orb_status orb_refiner_create(orb_context *ctx, orb_hierarchy *hierarchy,
                                             const orb_embed_options *options, orb_refiner **out);

/* A refiner at full resolution with these points (3 per vertex, every triangle positive), and a hierarchy that holds no
 * collapses: for sweeps with pins. Destroy the refiner, then the hierarchy. O(n). */
ORB_MUST_CHECK orb_status orb_refiner_resume(orb_context *ctx, const orb_mesh *mesh, const double *points,
                                             const orb_embed_options *options, orb_hierarchy **hierarchy,
                                             orb_refiner **out);

/* Takes the hierarchy back to its tetrahedron, for the next refiner, and frees this one. NULL is fine. */
void orb_refiner_destroy(orb_context *ctx, orb_refiner *refiner);

/* Declares that this refiner runs to full resolution and that its hierarchy is not used again: what only collapses need
 * is freed as soon as all are undone. End it with orb_refiner_abandon(). */
void orb_refiner_one_way(orb_refiner *refiner);

/* Frees a refiner and leaves its hierarchy as it is, fit only to be destroyed. NULL is fine. */
void orb_refiner_abandon(orb_context *ctx, orb_refiner *refiner);

/* From here on, sweeps of all levels keep angles and let areas go. */
void orb_refiner_keep_angles(orb_refiner *refiner);

/* How many vertices live. */
int32_t orb_refiner_live(const orb_refiner *refiner);

/* The current level, in fresh arrays that the caller frees: live vertices, and triangles. */
ORB_MUST_CHECK orb_status orb_refiner_level(orb_context *ctx, const orb_refiner *refiner, int32_t **vertices,
                                            int32_t *vertex_count, int32_t **triangles, int32_t *triangle_count);

/* The point of a live vertex; move it only inside the kernel of the vertex's ring. */
void orb_refiner_point(const orb_refiner *refiner, int32_t vertex, double out[3]);
void orb_refiner_move(orb_refiner *refiner, int32_t vertex, const double point[3]);
void orb_refiner_pin(orb_refiner *refiner, int32_t vertex, int pinned);

/* The points of all vertices (3 per vertex), once all live. */
void orb_refiner_points(const orb_refiner *refiner, double *points);

/* The energy that holds at the current level. */
orb_newton_energy orb_refiner_energy(const orb_refiner *refiner);

#endif
