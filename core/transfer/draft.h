/* The draft of an asset: what the steps of orb_asset_write() hand to each other.
 *
 *   frames:  the shapes, fitted, and in-betweens, as doubles   (asset.c, path.c)
 *   rounded: base and deltas as float32, vertices kept apart    (distinct.c)
 *   wedges:  normals, texture coordinates, colours at corners   (wedge.c, texcoord.c)
 *   split:   the vertices of the file, by material              (split.c)
 *   packed:  the binary chunk and its accessors                 (pack.c)
 */
#ifndef ORB_TRANSFER_DRAFT_H
#define ORB_TRANSFER_DRAFT_H

#include "orbmorph/asset.h"
#include "transfer/wedge.h"

/* A part of the mesh that has one material: triangles over vertices of its own. */
typedef struct orb_draft_part {
  int32_t material; /* of the first shape's mesh */
  int32_t vertex_count, triangle_count;
  uint32_t *indices; /* 3 a triangle, into the part's vertices */
  int32_t *corners;  /* a vertex: a supermesh corner that has its values */
} orb_draft_part;

typedef struct orb_draft {
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shapes;
  const orb_asset_options *options;
  int32_t shape_count, frame_count;
  double **positions;   /* frame_count × 3·vertex_count */
  float *base;          /* 3·vertex_count */
  float **deltas;       /* (frame_count − 1) × 3·vertex_count */
  orb_wedges *normals;  /* frame_count; NULL: none */
  orb_wedges *colors;   /* shape_count; width 0: none */
  orb_wedges texcoords; /* of the first shape; width 0: none */
  int32_t color_count;  /* frames whose colours are written: 0, 1, or all of them */
  int32_t *home;        /* a supermesh triangle: the first shape's triangle under its centre; NULL: not needed */
  int32_t part_count;
  orb_draft_part *parts;
  int32_t nudged;
} orb_draft;

/* For each supermesh triangle, the triangle of the shape in which its centre lies. Stage "write". */
ORB_MUST_CHECK orb_status orb_home_triangles(orb_context *ctx, const orb_supermesh *supermesh,
                                             const orb_aligned_shape *shape, int32_t s, int32_t *out);

/* Texture coordinates of a shape. No supermesh triangle straddles a seam: a corner beyond one gets the coordinates of
 * the point where the straight way from the triangle's centre meets the seam. */
ORB_MUST_CHECK orb_status orb_wedge_texcoords(orb_context *ctx, const orb_supermesh *supermesh,
                                              const orb_aligned_shape *shape, const int32_t *home, orb_wedges *out);

/* Fills the frames after the shapes: positions, normals, colours. */
ORB_MUST_CHECK orb_status orb_draft_path(orb_context *ctx, orb_draft *draft);

/* Fills draft->parts. Triangles and vertices are put in an order that suits the graphics processor's caches. */
ORB_MUST_CHECK orb_status orb_draft_split(orb_context *ctx, orb_draft *draft);

/* Appends the GLB of a finished draft. */
ORB_MUST_CHECK orb_status orb_draft_write(orb_context *ctx, const orb_draft *draft, const char *const *names,
                                          orb_asset_facts *facts, orb_buffer *out);

#endif
