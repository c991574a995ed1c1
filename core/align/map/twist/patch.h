/* A part of the fixed shape that may be a limb: flags of vertices, and rings of vertices around it. */
#ifndef ORB_ALIGN_MAP_TWIST_PATCH_H
#define ORB_ALIGN_MAP_TWIST_PATCH_H

#include "align/map/engine/surface.h"

enum {
  ORB_PATCH_LIMB = 1, /* a vertex of the limb */
  ORB_PATCH_END = 2   /* a vertex of what lies beyond: it keeps its place */
};

typedef struct orb_map_patch {
  orb_context *ctx;
  const orb_map_surface *b;
  unsigned char *inside;  /* one flag for each vertex of the surface: 0, ORB_PATCH_LIMB or ORB_PATCH_END */
  unsigned char *next;    /* the same while the part grows */
  unsigned char *reached; /* 1 for the vertices of the end that have a neighbour in the limb */
  int32_t *joined;        /* a representative of each vertex's piece; a forest */
  int32_t *corner;        /* a half-edge out of each vertex */
  int32_t *rim;           /* the last ring that was added */
  int32_t rim_count;
} orb_map_patch;

ORB_MUST_CHECK orb_status orb_map_patch_create(orb_context *ctx, const orb_map_surface *b, orb_map_patch *patch);
void orb_map_patch_free(orb_map_patch *patch);

/* Makes patch->joined tell the connected pieces of vertices whose flags have this value. O(n). */
void orb_map_patch_join(orb_map_patch *patch, const unsigned char *flag, int value);

/* The share of the surface in triangles with all corners inside. */
double orb_map_patch_share(const orb_map_patch *patch);

/* Pieces of the outside that the part separates from the greatest one become inside, with this flag. */
ORB_MUST_CHECK orb_status orb_map_patch_fill(orb_map_patch *patch, int flag);

/* Makes patch->next a copy of the flags, and patch->rim the vertices inside with a neighbour outside. */
void orb_map_patch_find_rim(orb_map_patch *patch);

/* Adds the ring of vertices around the rim to patch->next, and makes it the new rim. Returns its length. */
double orb_map_patch_dilate(orb_map_patch *patch);

/* Sets patch->reached. */
void orb_map_patch_reach(orb_map_patch *patch);

#endif
