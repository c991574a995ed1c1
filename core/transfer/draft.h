/* The draft of an asset: what the steps of orb_asset_write() hand to each other.
 *
 *   frames:  the shapes, fitted, in-betweens, targets, as doubles (asset.c, path.c, targets.c)
 *   rounded: base and deltas as float32, vertices kept distinct (distinct.c)
 *   wedges:  normals, texture coordinates, colours at corners   (wedge.c, texcoord.c, tangent.c)
 *   split:   the vertices of the file, by material              (split.c)
 *   packed:  the binary chunk and its accessors                 (pack.c, materials.c)
 */
#ifndef ORB_TRANSFER_DRAFT_H
#define ORB_TRANSFER_DRAFT_H

#include "orbmorph/asset.h"
#include "transfer/wedge.h"

/* The part of the mesh that has one material: triangles with their own vertices. */
typedef struct orb_draft_part {
  int32_t material; /* index into the materials of the first shape's mesh */
  int32_t vertex_count, triangle_count;
  uint32_t *indices; /* 3 per triangle, into the part's vertices */
  int32_t *corners;  /* per vertex: a supermesh corner with its values */
} orb_draft_part;

typedef struct orb_draft {
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shapes;
  const orb_asset_options *options;
  int32_t shape_count, frame_count;
  int32_t between_count; /* frames after the shapes that are in-betweens; then come the targets of the options */
  double **positions;    /* frame_count × 3·vertex_count */
  float *base;           /* 3·vertex_count */
  float **deltas;        /* (frame_count − 1) × 3·vertex_count */
  orb_wedges *normals;   /* frame_count; NULL: none */
  orb_wedges *colors;    /* shape_count; width 0: none */
  orb_wedges texcoords;  /* of the first shape; width 0: none */
  orb_wedges *tangents;  /* frame_count; NULL: no material needs them */
  int32_t color_count;   /* frames whose colours are written: 0, 1 or all */
  int32_t *home; /* per supermesh triangle: the first shape's triangle that holds its centre; NULL: not needed */
  int has_holes; /* triangles whose home fills a hole of the first shape are omitted */
  int32_t part_count;
  orb_draft_part *parts;
  int shares_vertices; /* all parts have the vertices of the first one, which owns the list of their corners */
  int32_t nudged;
} orb_draft;

#endif
