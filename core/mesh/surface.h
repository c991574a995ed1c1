/* A mesh and its twins while it is checked and repaired: orientation, pieces, fans, boundary loops. */
#ifndef ORB_MESH_SURFACE_H
#define ORB_MESH_SURFACE_H

#include "mesh/edges.h"

typedef struct orb_surface {
  orb_context *ctx;
  orb_mesh *mesh;
  int32_t *twin;
  orb_edges edges;
  /* Set by orb_surface_pieces(); outside it, `reversed` serves as scratch flags of faces. */
  int32_t *piece;          /* of each face; pieces are connected over edges of two faces */
  unsigned char *reversed; /* of each face: whether it faces against the first face of its piece */
  int32_t piece_count;
  int32_t conflict; /* a half-edge across which no orientation is consistent, −1: none */
} orb_surface;

ORB_MUST_CHECK orb_status orb_surface_open(orb_context *ctx, orb_mesh *mesh, orb_surface *surface);
void orb_surface_close(orb_surface *surface);
/* Computes twin and edges again, after faces were added, removed or reversed. */
ORB_MUST_CHECK orb_status orb_surface_rematch(orb_surface *surface);

/* Fills piece, reversed, piece_count and conflict. O(F). */
ORB_MUST_CHECK orb_status orb_surface_pieces(orb_surface *surface);

/* The fans of faces around vertices. */
typedef struct orb_fans {
  int64_t fans,
      pinched; /* fans of all vertices; vertices of several fans, of which the first pinched_count are listed */
  int32_t pinched_count, pinched_vertices[ORB_ERROR_ITEMS];
  int64_t joins; /* unions of pieces at shared vertices: piece_count − joins bodies do not touch */
} orb_fans;

/* Counts fans, of a consistent orientation without crowded edges, after orb_surface_pieces(). split: each fan of a
 * vertex after the first gets a vertex of its own. O(F). */
ORB_MUST_CHECK orb_status orb_surface_fans(orb_surface *surface, int split, orb_fans *out);

/* The open half-edge after the open half-edge h along the boundary, of a consistent orientation. */
int32_t orb_surface_next_open(const orb_surface *surface, int32_t h);

/* Counts the boundary loops, of a consistent orientation. O(F). */
ORB_MUST_CHECK orb_status orb_surface_loops(orb_surface *surface, int64_t *loops);

#endif
