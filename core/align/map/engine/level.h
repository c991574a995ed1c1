/* The optimiser of the composed map: one level of the moving shape, whose vertices move over the fixed shape.
 *
 * In: the fixed shape with its embedding, and a level of the moving shape with a point on the sphere for each vertex.
 * Out: the same level, with less energy, and without flips if it had none or they could be cleared. Read in this order:
 *
 *   params.h          every threshold and weight of map/
 *   surface.h         the fixed shape, on which places move
 *   level.h           the moving vertices of one resolution
 *   star.h, step.h    the energy around one vertex, and its Newton step
 *   packed.h          the fixed shape in the order in which sweeps read it
 *   vector/           the step for several vertices at once
 *   sweep.h           sweeps of such steps
 *   untangle.h        clearing flips on the sphere
 *   folds.h           what untangling has only spread is taken back
 *   unfold.h          clearing the last ones for certain, and setting parts anew
 *   run.h             what one call of orb_compose() holds, and the points that the fixed shape has on the sphere
 *   rounds.h          sweeps with and without flips, and pulls
 *   clear.h           rounds of sweeps, untangling and unfolding
 *   loosen.h          rounds with flips allowed that are then cleared
 *   iron.h            crumpled parts that are set anew
 *   near.h            levels that are nearly a map
 *   spread.h          samples
 */
#ifndef ORB_ALIGN_MAP_ENGINE_LEVEL_H
#define ORB_ALIGN_MAP_ENGINE_LEVEL_H

#include "align/map/engine/params.h"
#include "align/map/engine/surface.h"
#include "embed/common/corner_table.h"

/* A triangle of a vertex's star: neighbours q and r (numbers of the level), the cotangents at the vertex, q and r, and
 * the area. */
typedef struct orb_map_spoke {
  int32_t q, r;
  double cv, cq, cr, area;
} orb_map_spoke;

typedef struct orb_map_level {
  const orb_map_params *params; /* borrowed */
  int32_t count, triangle_count;
  int32_t *vertex;        /* numbers of the surface */
  const int32_t *to_mesh; /* of each vertex of the surface: its number in the mesh; borrowed */
  int32_t *local;         /* of each vertex of the surface: its number here, −1: none; borrowed */
  int32_t *start;         /* of each vertex's spokes; count + 1 */
  orb_map_spoke *spoke;
  int32_t *triangle;     /* 3 each, numbers of the level */
  orb_place *place;      /* on the fixed shape */
  double *y, *n, *x;     /* position and normal there, point on the sphere; 3 each */
  double *density;       /* of the fixed shape there, see orb_map_surface */
  double *area;          /* a third of the star's */
  double *moved;         /* by each vertex's last step; INFINITY: not yet stepped */
  double *target, *pull; /* spatial target, and the strength of its pull; 0: none */
  unsigned char *pinned;
  int32_t moving; /* vertices that have a colour: the others do not move */
  /* Sweeps go through parts of the level side by side, and then through the border between them. The vertices of part p
   * and colour c begin in by_group at group_start[p · colours + c]; part number `parts` is the border. */
  int32_t parts, colours, *group_start, *by_group;
} orb_map_level;

/* How the sweeps work. */
typedef struct orb_map_rules {
  int soft;       /* flips are allowed, against a finite barrier */
  double barrier; /* strength of the hinge barrier on the sphere's determinants */
  double epsilon; /* of the regularised area, relative to min(a, D/2): the larger, the more freely triangles invert */
  double omega;   /* over-relaxation */
  double still;   /* a vertex waits while it and its neighbours last moved by less than this */
} orb_map_rules;

/* Gathers the live vertices of a surface. position: 3 per vertex of the surface, area 4π at full resolution. params and
 * local (vertex_count) stay the caller's and must outlive the level. Does not set x, place, y, n, density, target and
 * pull. */
ORB_MUST_CHECK orb_status orb_map_level_create(orb_context *ctx, const orb_map_params *params,
                                               const orb_corner_table *s, const unsigned char *alive,
                                               const unsigned char *pinned, const double *position, int32_t live,
                                               int32_t *local, orb_map_level *out);
void orb_map_level_free(orb_context *ctx, orb_map_level *level);

/* Sets y, n and density from the place. */
void orb_map_level_refresh(orb_map_level *level, const orb_map_surface *b, int32_t v);
/* Sets place, y, n and density from x. */
void orb_map_level_locate(orb_map_level *level, const orb_map_surface *b, int32_t v, int32_t hint);
/* The same for all vertices. fresh: they have no places yet; else pinned vertices keep theirs, and the search for the
 * others begins where they were. */
ORB_MUST_CHECK orb_status orb_map_level_locate_all(orb_context *ctx, orb_map_level *level, const orb_map_surface *b,
                                                   int fresh);

/* The number of flipped triangles. */
int32_t orb_map_level_flips(const orb_map_level *level);

/* How many times a level covers the sphere; flipped triangles count against it. 1: once, as a map does. A triangle that
 * is drawn over half of the sphere changes the number, so a level without flips may cover the sphere twice. */
int32_t orb_map_level_degree(const orb_map_level *level);

/* Marks the vertices of the triangles whose symmetric Dirichlet energy is above a limit, and clears the other marks.
 * Returns the number of these triangles. */
int32_t orb_map_level_mark_above(const orb_map_level *level, double limit, unsigned char *mark);

/* The summed energy of the triangles of each part, capped for each triangle and times its area; INFINITY where one is
 * flipped. part: of each vertex, −1: none; a triangle has vertices of one part and of none. */
void orb_map_level_part_energies(const orb_map_level *level, const int32_t *part, int32_t parts, double *energy);

/* Symmetric Dirichlet energy of the composed map, capped for each triangle and weighted by area; 1: isometric. */
double orb_map_level_energy(const orb_map_level *level);
/* The same with another cap. */
double orb_map_level_capped_energy(const orb_map_level *level, double cap);

#endif
