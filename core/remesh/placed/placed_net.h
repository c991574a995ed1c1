/* A placed net: a net that stands for all shapes. Each net vertex has a place and a position on every shape, and each
 * vertex of a shape (an item) is listed at the net vertex or net triangle that holds it. The distance between the net's
 * surfaces and the shapes can therefore be proved at any time, see bound.h. */
#ifndef ORB_REMESH_PLACED_PLACED_NET_H
#define ORB_REMESH_PLACED_PLACED_NET_H

#include "remesh/common/job.h"
#include "remesh/placed/pack.h"
#include "sphere/net.h"
#include "sphere/trace.h"

/* "Mark": a 64-bit digest of what a search depends on (marks.h), kept where the search found nothing, so that it is
 * repeated only after a change. 0 means none. */
typedef struct orb_placed_net {
  const orb_remesh_job *job;
  orb_net net;
  int32_t shape_count, capacity; /* capacity: of the arrays below, in net vertices */
  orb_sphere_view *view;         /* per shape */
  orb_pack *pack;                /* per shape: the same and its positions, for tracing */
  double **position;             /* per shape: its vertices, divided by its diagonal */
  double **vertex_normal;        /* per shape: smooth unit normals of its vertices */
  double *at;                    /* per net vertex, 3 per shape: its position, divided by the shape's diagonal */
  double *normal;                /* per net vertex, 3 per shape: the shape's smooth normal there, unit */
  orb_spot *spot;                /* per net vertex, one per shape: where it lies */
  unsigned char *fixed;          /* per net vertex: it is a landmark and must stay */
  uint64_t *no_move;             /* per net vertex: mark of the star in which no better point was found */
  uint64_t *no_collapse;         /* per net vertex: mark of the surroundings in which it could not be removed */
  uint64_t *no_repair;           /* per triangle, two: marks of the surroundings in which no repair was found */
  uint64_t *not_inverted;        /* per triangle: mark of the corners with which it was found not to be inverted */
  uint64_t *within;              /* per half-edge: mark of the edge that was proved to stay within the limit */
  /* Items: the vertices of all shapes, shape after shape. Each is in the list of one net vertex or triangle. */
  int32_t *item_begin; /* shape_count + 1: the first item of each shape */
  int32_t *item_next;
  int32_t *item_shape;
  int32_t *vertex_items, *triangle_items; /* heads of the lists, −1: empty */
  int gave_up;                            /* refinement stopped early, see orb_placed_refine() */
  /* Edges that stay, see orb_placed_keep(): lists of the other ends. NULL: there are none. */
  int32_t *kept_first; /* per net vertex: head of its list, −1: empty */
  int32_t *kept_to, *kept_next;
  int32_t kept_count, kept_given; /* entries; of them, those of the edges given */
} orb_placed_net;

/* Starts from the shape with the most triangles and inserts the vertices of the other shapes. */
ORB_MUST_CHECK orb_status orb_placed_create(orb_context *ctx, const orb_remesh_job *job, orb_placed_net *placed);
/* Starts from a copy of a certified triangulation. */
ORB_MUST_CHECK orb_status orb_placed_create_on(orb_context *ctx, const orb_remesh_job *job, const orb_net *net,
                                               orb_placed_net *placed);
void orb_placed_free(orb_context *ctx, orb_placed_net *placed);

/* Makes room for `more` further net vertices. */
ORB_MUST_CHECK orb_status orb_placed_reserve(orb_context *ctx, orb_placed_net *placed, int64_t more);

/* Position and smooth normal of net vertex v on shape s. */
static inline const double *orb_placed_position(const orb_placed_net *placed, int32_t v, int32_t s) {
  return placed->at + 3 * ((int64_t)v * placed->shape_count + s);
}

static inline const double *orb_placed_normal(const orb_placed_net *placed, int32_t v, int32_t s) {
  return placed->normal + 3 * ((int64_t)v * placed->shape_count + s);
}

/* The item's point on the sphere, and its position in space divided by the shape's diagonal. */
const double *orb_placed_item_point(const orb_placed_net *placed, int32_t item);
const double *orb_placed_item_position(const orb_placed_net *placed, int32_t item);

/* Refinement never flips these edges; the halves of one that is split stay as well. Call it once. */
ORB_MUST_CHECK orb_status orb_placed_keep(orb_context *ctx, orb_placed_net *placed, const int32_t (*ends)[2],
                                          int64_t count);
/* Whether the edge of h stays. */
int orb_placed_keeps(const orb_placed_net *placed, int32_t h);

/* Splits net edge h at p if all four triangles stay positive, and assigns the items of the two triangles again. Returns
 * the new vertex, or −1. Needs room for one vertex. */
int32_t orb_placed_split(orb_placed_net *placed, int32_t h, const double p[3]);

/* Makes p, which lies in triangle t, a vertex. Returns it, or the vertex that is already there. Needs room for one. */
int32_t orb_placed_insert(orb_placed_net *placed, int32_t t, const double p[3]);

/* Moves the items of a list into the lists of the triangles that hold them, by walks from triangle `start`. */
void orb_placed_assign(orb_placed_net *placed, int32_t list, int32_t start);
/* The same where the given triangles hold all the items. Touches only these triangles: others may change meanwhile. */
void orb_placed_assign_among(orb_placed_net *placed, int32_t list, const int32_t *triangles, int count);

/* Computes spot, position and normal of v on shape s from the vertex's point, starting at triangle `hint`; −1: none is
 * known. */
void orb_placed_locate(orb_placed_net *placed, int32_t v, int32_t s, int32_t hint);
/* The same, starting from its old spot. */
static inline void orb_placed_locate_on(orb_placed_net *placed, int32_t v, int32_t s) {
  orb_placed_locate(placed, v, s, placed->spot[(int64_t)v * placed->shape_count + s].h / 3);
}

/* Copies a vertex's point, spots, positions and normals over those of another, or of the number after the last. */
void orb_placed_copy_vertex(orb_placed_net *placed, int32_t to, int32_t from);

/* The number of live triangles. O(triangles). */
int64_t orb_placed_live(const orb_placed_net *placed);
/* Renumbers the live vertices and triangles, in the same order, so that no dead ones lie between them. */
ORB_MUST_CHECK orb_status orb_placed_compact(orb_context *ctx, orb_placed_net *placed);

#endif
