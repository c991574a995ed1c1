/* Baking: the base colour of a shape as pictures in the texture coordinates of an asset, one for each of its materials.
 */
#ifndef ORB_CARRY_BAKE_H
#define ORB_CARRY_BAKE_H

#include "carry/texels.h"
#include "format/gltf_given.h"
#include "orbmorph/remesh.h"

typedef struct orb_bake_job {
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shape;
  int32_t number;                 /* of the shape */
  const orb_given_charts *charts; /* of the asset */
  const int32_t *vertices;        /* of each vertex of the charts, its supermesh vertex; −1: none */
  int32_t vertex_count;           /* of `vertices` */
  int32_t resolution;             /* 0: as fine as the textures of the shape */
} orb_bake_job;

typedef struct orb_baked_image {
  int32_t material; /* of the asset; −1: none */
  orb_buffer png;
} orb_baked_image;

typedef struct orb_baked {
  int32_t resolution, image_count;
  orb_baked_image *images;
  int has_alpha;
  int64_t shared; /* texels that several triangles of the asset use */
} orb_baked;

/* The refusal where the first shape has no texture coordinates. */
orb_status orb_bake_refuse(orb_context *ctx);

/* Each texel within a triangle of the asset gets the colour at its place on the shape, others that of their neighbours:
 * at first along the rims of charts, then the mean. Free also after an error. ORB_E_BAD_OPTION: no triangle of the
 * asset has texture coordinates, or an image of the shape cannot be read. */
ORB_MUST_CHECK orb_status orb_bake(orb_context *ctx, const orb_bake_job *job, orb_baked *out);
void orb_baked_free(orb_context *ctx, orb_baked *baked);

#endif
