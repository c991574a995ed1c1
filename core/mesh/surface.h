/* A mesh with its twins while it is checked and mended: facing, pieces, fans, boundary loops. */
#ifndef ORB_MESH_SURFACE_H
#define ORB_MESH_SURFACE_H

#include "mesh/edges.h"

typedef struct orb_surface {
  orb_context *ctx;
  orb_mesh *mesh;
  int32_t *twin;
  orb_edges edges;
  /* of orb_surface_pieces() */
  int32_t *piece;        /* a face; pieces hang together over edges of two faces */
  unsigned char *turned; /* a face: against the first face of its piece */
  int32_t piece_count;
  int32_t conflict; /* a half-edge over which no facing is consistent, −1: none */
} orb_surface;

ORB_MUST_CHECK orb_status orb_surface_open(orb_context *ctx, orb_mesh *mesh, orb_surface *surface);
void orb_surface_close(orb_surface *surface);
ORB_MUST_CHECK orb_status orb_surface_rematch(orb_surface *surface);

/* Fills piece, turned, piece_count, conflict. O(F). */
ORB_MUST_CHECK orb_status orb_surface_pieces(orb_surface *surface);

/* The fans of faces around vertices, for a consistent facing without crowded edges. split: each fan after the first of
 * a vertex gets a vertex of its own. first_piece (vertex_count, or NULL): of each vertex's first fan. Otherwise only
 * counts: used vertices, fans, vertices of several fans (the first ORB_ERROR_ITEMS of them listed). */
typedef struct orb_fans {
  int64_t used, fans, pinched;
  int32_t pinched_count, pinched_vertices[ORB_ERROR_ITEMS];
  int64_t joins; /* pairs of pieces that hang together at vertices only: pieces − joins are apart in space */
} orb_fans;
ORB_MUST_CHECK orb_status orb_surface_fans(orb_surface *surface, int split, orb_fans *out);

/* The open half-edge after the open half-edge h, around the boundary of a consistent facing. */
int32_t orb_surface_next_open(const orb_surface *surface, int32_t h);
ORB_MUST_CHECK orb_status orb_surface_loops(orb_surface *surface, int64_t *loops);

/* Closes each boundary loop with triangles. */
ORB_MUST_CHECK orb_status orb_surface_fill(orb_surface *surface);

#endif
