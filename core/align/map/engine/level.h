/* One level of a composed map: its vertices, each with a place on the fixed shape, and the steps that move them. */
#ifndef ORB_ALIGN_MAP_ENGINE_LEVEL_H
#define ORB_ALIGN_MAP_ENGINE_LEVEL_H

#include "align/map/engine/surface.h"
#include "embed/corner_table.h"

/* A triangle of a vertex's star: neighbours q and r (numbers of the level), cotangents at the vertex, q and r, area. */
typedef struct orb_map_spoke {
  int32_t q, r;
  double cv, cq, cr, area;
} orb_map_spoke;

typedef struct orb_map_level {
  int32_t count, triangle_count;
  int32_t *vertex; /* numbers of the surface */
  int32_t *local;  /* of each vertex of the surface: its number here, −1 */
  int32_t *start;  /* of each vertex's spokes; count + 1 */
  orb_map_spoke *spoke;
  int32_t *triangle;   /* 3 each, numbers of the level */
  orb_place *place;    /* on the fixed shape */
  double *y, *n, *x;   /* position and normal there, point on the sphere; 3 each */
  double *density;     /* of the fixed shape there, see orb_map_surface */
  double *area;        /* a third of the star's */
  double *moved;       /* by each vertex's last step; INFINITY: not yet stepped */
  double *goal, *pull; /* spatial target and the strength of its pull, 0: none */
  unsigned char *pinned;
  int32_t colours, *colour_start, *by_colour;
} orb_map_level;

/* How the sweeps work. */
typedef struct orb_map_rules {
  int soft;       /* flips are allowed against a finite barrier */
  double barrier; /* strength of the hinge barrier on the sphere's determinants */
  double epsilon; /* of the regularised area, over min(a, D/2): the larger, the more freely triangles turn over */
  double omega;   /* over-relaxation */
  double still;   /* a vertex waits while it and its neighbours last moved by less than this */
} orb_map_rules;

/* Gathers the live vertices of a surface; position: 3 a vertex of the surface, area 4π at full resolution. local: an
 * array of the caller, vertex_count. x, place, y, n, density, goal, pull are not set. */
ORB_MUST_CHECK orb_status orb_map_level_create(orb_context *ctx, const orb_corner_table *s, const unsigned char *alive,
                                               const unsigned char *pinned, const double *position, int32_t live,
                                               int32_t *local, orb_map_level *out);
void orb_map_level_free(orb_context *ctx, orb_map_level *level);

/* Sets y, n and density from the place. */
void orb_map_level_refresh(orb_map_level *level, const orb_map_surface *b, int32_t v);
/* Sets place, y, n and density from x. */
void orb_map_level_locate(orb_map_level *level, const orb_map_surface *b, int32_t v, int32_t hint);
/* The same for all vertices. fresh: they have no places yet; else those that are pinned keep theirs, and the others
 * are looked for from where they were. */
ORB_MUST_CHECK orb_status orb_map_level_locate_all(orb_context *ctx, orb_map_level *level, const orb_map_surface *b,
                                                   int fresh);

/* Triangles of the level whose points on the sphere do not turn positively. */
int32_t orb_map_level_flips(const orb_map_level *level);

/* Symmetric Dirichlet energy of the composed map, capped at 20, weighted by area; 1: isometric. */
double orb_map_level_energy(const orb_map_level *level);

#endif
