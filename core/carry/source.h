/* A shape that something is carried from. */
#ifndef ORB_CARRY_SOURCE_H
#define ORB_CARRY_SOURCE_H

#include "carry/corner_blend.h"
#include "format/gltf_given.h"
#include "orbmorph/carry.h"

typedef struct orb_carry_source {
  int32_t number; /* of the shape */
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shape;
  const orb_mesh *given; /* before the alignment */
  const orb_shape_file *file;
  orb_corner_blend *blends; /* of the corners of the aligned mesh; NULL: not glTF */
  int32_t *home;            /* see orb_home_triangles(); NULL: not yet needed */
  unsigned char *used;      /* per vertex of the file: whether it is on the closed surface */
} orb_carry_source;

/* Fills blends and used, if the file is glTF. Free also after an error. */
ORB_MUST_CHECK orb_status orb_carry_source_open(orb_context *ctx, orb_carry_source *source);
/* Fills home. */
ORB_MUST_CHECK orb_status orb_carry_source_home(orb_context *ctx, orb_carry_source *source);
void orb_carry_source_close(orb_context *ctx, orb_carry_source *source);

/* Its file for the readers of core/format. */
orb_given_file orb_carry_given(const orb_carry_source *source);

/* The blend of vertices of the file at a vertex of the supermesh: at most ORB_CARRY_BLEND of them, *count, with weights
 * whose sum is 1 up to rounding. */
enum { ORB_CARRY_BLEND = 9 };
typedef struct orb_blend {
  int32_t count, vertex[ORB_CARRY_BLEND];
  double weight[ORB_CARRY_BLEND];
} orb_blend;
void orb_carry_blend(const orb_carry_source *source, int32_t vertex, orb_blend *out);

#endif
