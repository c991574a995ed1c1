/* The landmark walk: landmarks walk to their common targets on a coarse level. */
#ifndef ORB_ALIGN_PIN_WALK_H
#define ORB_ALIGN_PIN_WALK_H

#include "align/sheet/sheet.h"
#include "embed/newton/hierarchy.h"

/* The level on which the landmarks of a shape arrived. */
typedef struct orb_walk_level {
  orb_hierarchy *hierarchy; /* at its tetrahedron; its landmarks, and no other vertices, were kept */
  int32_t live;             /* vertices of the level */
  double *points;           /* of those, 3 per vertex of the mesh */
} orb_walk_level;

typedef struct orb_walk_options {
  orb_preset preset; /* of the embeddings */
  int32_t coarse;    /* least vertices of the level */
  int keep_angles;   /* of the embeddings, rather than areas */
} orb_walk_options;

void orb_walk_level_free(orb_context *ctx, orb_walk_level *level);

/* Embeds the shapes again, together: on a coarse level the landmarks walk to their spherical means and are pinned
 * there, and the level is refined to the full meshes. *stuck 0: all arrived and every embedding is certified; 1: the
 * sheets are unchanged. last: NULL, or receives the level of the last shape, which then is not refined: its sheet is
 * unchanged too. It is empty if the landmarks are stuck or the call fails. Shapes walk side by side. */
ORB_MUST_CHECK orb_status orb_pin_walk(orb_context *ctx, orb_sheet *sheets, int32_t shape_count,
                                       const int32_t *landmarks, int32_t count, const orb_walk_options *options,
                                       orb_walk_level *last, int *stuck);

#endif
