/* Triangle meshes: the surface of one shape, its checks and its repairs.
 *
 * Half-edges have no struct of their own: half-edge h = 3t + k of triangle t runs from triangles[h] to
 * triangles[orb_next(h)]; the corner h lies at its origin, and the edge opposite to corner h is half-edge orb_next(h).
 */
#ifndef ORBMORPH_MESH_H
#define ORBMORPH_MESH_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { ORB_REPAIR_KINDS_MAX = 16, ORB_NAME_MAX = 128 };

/* One thing that was mended. kind: "triangulate", "weld", "unused-vertices", "duplicate-faces", "degenerate-faces",
 * "reorient", "turn-inside-out", "split-vertices", "fill_holes", "largest_component". */
typedef struct orb_repair {
  const char *kind; /* a literal */
  int64_t count;    /* elements it touched: faces, vertices, holes or pieces, after the kind */
} orb_repair;

/* A base-colour image as it stood in the file. */
typedef struct orb_image {
  unsigned char *bytes;
  size_t size;
  char mime[32]; /* "image/png" or "image/jpeg" */
} orb_image;

typedef struct orb_material {
  char name[ORB_NAME_MAX];
  float base_color[4]; /* linear RGBA; 1,1,1,1 where the file says nothing */
  float metallic, roughness;
  int32_t image;                                  /* in images, −1: none */
  int32_t wrap_s, wrap_t, mag_filter, min_filter; /* glTF sampler enums, 0: not given */
} orb_material;

/* A mesh. All arrays are of the context; optional ones are NULL where the file has none. */
typedef struct orb_mesh {
  int32_t vertex_count, triangle_count;
  double *positions;  /* 3 a vertex, in units of the file: bit for bit the doubles that were parsed */
  int32_t *triangles; /* 3 a triangle, counter-clockwise seen from outside */

  /* The way back to the file. Vertex numbers of a file: OBJ, OFF, PLY in file order; STL 3·facet + corner; glTF the
   * POSITION accessors of all triangle primitives one after another. Triangle numbers: file order, after polygons were
   * made triangles. */
  int32_t file_vertex_count, file_triangle_count;
  int32_t *source;           /* a vertex: the lowest-numbered vertex of the file that it stands for */
  int32_t *vertex_of_source; /* file_vertex_count: the vertex that stands for it, −1 if dropped */
  int32_t *source_triangle;  /* a triangle: its number in the file, −1: made by fill_holes */

  /* Attributes, one a corner (corner h belongs to vertex triangles[h]). */
  float *normals;    /* 3 a corner, unit */
  float *texcoords;  /* 2 a corner, glTF's convention (v down) */
  float *colors;     /* 4 a corner, linear RGBA */
  int32_t *material; /* a triangle; NULL: all 0 */
  int32_t material_count, image_count;
  orb_material *materials;
  orb_image *images;

  int32_t repair_count;
  orb_repair repairs[ORB_REPAIR_KINDS_MAX];
} orb_mesh;

static inline int32_t orb_next(int32_t h) {
  return h % 3 == 2 ? h - 2 : h + 1;
}
static inline int32_t orb_prev(int32_t h) {
  return h % 3 == 0 ? h + 2 : h - 1;
}

/* Frees the arrays and zeroes the struct. */
void orb_mesh_free(orb_context *ctx, orb_mesh *mesh);

/* Frees normals, texture coordinates, colours, materials and images: an embedding needs none of them. */
void orb_mesh_drop_attributes(orb_context *ctx, orb_mesh *mesh);

/* A deep copy. */
ORB_MUST_CHECK orb_status orb_mesh_copy(orb_context *ctx, const orb_mesh *mesh, orb_mesh *out);

typedef struct orb_topology {
  int64_t components;
  double genus; /* (2·components − V + E − F − loops) / 2, meaningful for orientable manifolds */
  int64_t boundary_loops, boundary_edges, nonmanifold_edges, nonmanifold_vertices;
  int consistent; /* neighbours face the same way */
  int orientable; /* a consistent facing exists */
} orb_topology;

/* Measures any index list. O(V + F) expected. */
ORB_MUST_CHECK orb_status orb_mesh_topology(orb_context *ctx, const orb_mesh *mesh, orb_topology *out);

/* The coordinates that are taken: none of larger magnitude, a diagonal of the bounding box of at least this, and of at
 * least this share of the largest coordinate. Assets hold float32, with some 8 steps over such a share; areas, volumes
 * and their products stay well within doubles. */
#define ORB_COORDINATE_MAX 1e30
#define ORB_DIAGONAL_MIN 1e-30
#define ORB_DIAGONAL_SHARE 1e-6

enum {
  ORB_REPAIR_NONE = 0,
  ORB_REPAIR_SAFE = 1,              /* what changes no shape, and only what is needed; each act is counted */
  ORB_REPAIR_FILL_HOLES = 2,        /* implies safe */
  ORB_REPAIR_LARGEST_COMPONENT = 4, /* implies safe; the piece of most triangles */
};

/* Makes a mesh as read fit to embed, in place, or says why it cannot be: afterwards it is closed, manifold, oriented
 * outward, connected, of genus zero, with four triangles or more, and of a size and place that float32 can hold
 * (ORB_E_DEGENERATE, see ORB_DIAGONAL_MIN). With ORB_REPAIR_NONE only a mesh that is wholly
 * inside-out is turned. On failure the mesh is unspecified but valid to free, and the error carries the facts
 * (edges and vertices in the file's numbers). O(V + F) expected. */
ORB_MUST_CHECK orb_status orb_mesh_repair(orb_context *ctx, orb_mesh *mesh, unsigned repair);

/* twin[h] for each of the 3·triangle_count half-edges of a closed manifold index list; ORB_E_INTERNAL if it is not
 * one. O(F) expected. */
ORB_MUST_CHECK orb_status orb_mesh_twins(orb_context *ctx, const int32_t *triangles, int32_t triangle_count,
                                         int32_t vertex_count, int32_t *twin);

/* Surface area, enclosed volume (signed), bounding box and its diagonal. */
typedef struct orb_extent {
  double area, volume, min[3], max[3], diagonal;
} orb_extent;
void orb_mesh_extent(const orb_mesh *mesh, orb_extent *out);

/* A point of a surface: triangle and barycentric coordinates (≥ 0, sum 1) of its three corners in order. */
typedef struct orb_place {
  int32_t triangle;
  double at[3];
} orb_place;

/* The place's position. */
void orb_place_position(const orb_mesh *mesh, const orb_place *place, double out[3]);

/* A place at a vertex: its first incident triangle, coordinate 1 there. O(F) without an index; for landmarks. */
ORB_MUST_CHECK orb_status orb_place_of_vertex(orb_context *ctx, const orb_mesh *mesh, int32_t vertex, orb_place *out);

/* Nearest point of a surface, by a bounding-volume tree. Building O(F log F), a query O(log F) typical. The tree
 * borrows positions and triangles. Queries from any thread. */
typedef struct orb_nearest orb_nearest;
ORB_MUST_CHECK orb_status orb_nearest_create(orb_context *ctx, const double *positions, const int32_t *triangles,
                                             int32_t triangle_count, orb_nearest **out);
void orb_nearest_destroy(orb_context *ctx, orb_nearest *tree);
/* The nearest place to p, closer than max_distance2 (INFINITY: no bound); returns the squared distance, INFINITY and
 * triangle −1 if none is closer. Ties go to the lowest triangle number. */
double orb_nearest_query(const orb_nearest *tree, const double p[3], double max_distance2, orb_place *out);
/* The answer of orb_nearest_query() without a bound, bit for bit, but sooner, the nearer `known` is: a place with its
 * squared distance, both as orb_triangle_nearest() gave them, or triangle −1 if there is none. */
double orb_nearest_query_from(const orb_nearest *tree, const double p[3], const orb_place *known,
                              double known_distance2, orb_place *out);
/* The nearest point of the triangle of these three corners (9 numbers): its coordinates; returns the squared distance.
 * A triangle without area counts as its edges. */
double orb_triangle_nearest(const double *corners, const double p[3], double at[3]);

#ifdef __cplusplus
}
#endif
#endif
