/* One level of a composed map: its vertices, each with a place on the fixed shape, and the steps that move them. */
#ifndef ORB_ALIGN_COMPOSE_LEVEL_H
#define ORB_ALIGN_COMPOSE_LEVEL_H

#include "align/compose.h"
#include "embed/surface.h"

/* A triangle of a vertex's star: neighbours q and r (numbers of the level), cotangents at the vertex, q and r, area. */
typedef struct cm_spoke {
  int32_t q, r;
  double cv, cq, cr, area;
} cm_spoke;

typedef struct cm_level {
  int32_t count, triangle_count;
  int32_t *vertex; /* numbers of the surface */
  int32_t *local;  /* of each vertex of the surface: its number here, −1 */
  int32_t *start;  /* of each vertex's spokes; count + 1 */
  cm_spoke *spoke;
  int32_t *triangle;   /* 3 each, numbers of the level */
  orb_place *place;    /* on the fixed shape */
  double *y, *n, *x;   /* position and normal there, point on the sphere; 3 each */
  double *density;     /* of the fixed shape there, see cm_surface */
  double *area;        /* a third of the star's */
  double *moved;       /* by each vertex's last step; INFINITY: not yet stepped */
  double *goal, *pull; /* spatial target and the strength of its pull, 0: none */
  unsigned char *pinned;
  int32_t colours, *colour_start, *by_colour;
} cm_level;

/* How the sweeps work. */
typedef struct cm_rules {
  int soft;       /* flips are allowed against a finite barrier */
  double barrier; /* strength of the hinge barrier on the sphere's determinants */
  double epsilon; /* of the regularised area, over min(a, D/2): the larger, the more freely triangles turn over */
  double omega;   /* over-relaxation */
  double still;   /* a vertex waits while it and its neighbours last moved by less than this */
} cm_rules;

/* Gathers the live vertices of a surface; position: 3 a vertex of the surface, area 4π at full resolution. local: an
 * array of the caller, vertex_count. x, place, y, n, density, goal, pull are not set. */
ORB_MUST_CHECK orb_status cm_level_create(orb_context *ctx, const orb_surface *s, const unsigned char *alive,
                                          const unsigned char *pinned, const double *position, int32_t live,
                                          int32_t *local, cm_level *out);
void cm_level_free(orb_context *ctx, cm_level *level);

/* Sets y, n and density from the place. */
void cm_level_refresh(cm_level *level, const cm_surface *b, int32_t v);
/* Sets place, y, n and density from x. */
void cm_level_locate(cm_level *level, const cm_surface *b, int32_t v, int32_t hint);
/* The same for all vertices. fresh: they have no places yet; else those that are pinned keep theirs, and the others
 * are looked for from where they were. */
ORB_MUST_CHECK orb_status cm_level_locate_all(orb_context *ctx, cm_level *level, const cm_surface *b, int fresh);

/* One pass of damped Newton steps over all vertices that are not pinned, colour by colour. *moved: mean length;
 * *stepped: how many vertices did not wait. */
ORB_MUST_CHECK orb_status cm_level_sweep(orb_context *ctx, cm_level *level, const cm_surface *b, const cm_rules *rules,
                                         double *moved, int32_t *stepped);
/* The step of one vertex. */
void cm_level_step(cm_level *level, const cm_surface *b, const cm_rules *rules, int32_t v);

/* Moves a vertex to a place if that lowers the energy of its star and flips nothing; returns whether. */
int cm_level_try(cm_level *level, const cm_surface *b, const cm_rules *rules, int32_t v, const orb_place *place);

/* Triangles of the level whose points on the sphere do not turn positively. */
int32_t cm_level_flips(const cm_level *level);
/* Marks the vertices of such triangles, and so many rings about them; the others' marks are 0. next: room for as many
 * (compose_untangle.c). */
ORB_MUST_CHECK orb_status cm_level_mark_flips(orb_context *ctx, const cm_level *level, int rings, unsigned char *mark,
                                              unsigned char *next);
/* Optimises flipped neighbourhoods on the sphere until no flip is left (compose_untangle.c); *left: how many are;
 * *work: falls by the steps it took. Only x changes, and only near flips. */
ORB_MUST_CHECK orb_status cm_level_untangle(orb_context *ctx, cm_level *level, int32_t *left, int64_t *work);

/* Symmetric Dirichlet energy of the composed map, capped at 20, weighted by area; 1: isometric. */
double cm_level_energy(const cm_level *level);

#endif
