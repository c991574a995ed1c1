/* Paths of base edges on a sheet. */
#ifndef ORB_ALIGN_PIN_PATHS_H
#define ORB_ALIGN_PIN_PATHS_H

#include "align/sheet/sheet.h"

/* The flags of paths on a sheet. An edge of the base is named by its lesser half-edge. */
typedef struct orb_paths {
  int32_t *path;      /* of each half-edge of the sheet: the base edge on whose path it lies, −1: none */
  unsigned char *on;  /* of each vertex: it lies on a path or is a base vertex */
  int32_t half_edges; /* capacities */
  int32_t vertices;
} orb_paths;

void orb_paths_free(orb_context *ctx, orb_paths *paths);

/* Splits an edge that lies on no path at its middle, and keeps the flags of paths. */
ORB_MUST_CHECK orb_status orb_paths_split(orb_context *ctx, orb_sheet *sheet, orb_paths *paths, int32_t h,
                                          int32_t *vertex);

/* Makes room for the flags of a sheet that has grown. */
ORB_MUST_CHECK orb_status orb_paths_fit(orb_context *ctx, const orb_sheet *sheet, orb_paths *paths);

#endif
