/* Triangle meshes: the surface of one shape, its checks and its repairs.
 *
 * Half-edges have no struct of their own: half-edge h = 3t + k of triangle t runs from triangles[h] to
 * triangles[orb_next(h)]; corner h lies at its origin, and the edge opposite to corner h is half-edge orb_next(h).
 */
#ifndef ORBMORPH_MESH_H
#define ORBMORPH_MESH_H

#include "orbmorph/context.h"
#include "orbmorph/material.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { ORB_REPAIR_KINDS_MAX = 16 };

/* One kind of repair. kind: "triangulate", "weld", "unused-vertices", "duplicate-faces", "degenerate-faces",
 * "reorient", "turn-inside-out", "split-vertices", "split_nonmanifold", "fill_holes", "largest_component", "part".
 * Handles that were closed are listed one by one: orb_handle. */
typedef struct orb_repair {
  const char *kind; /* a literal */
  int64_t count;    /* faces, edges, vertices, holes or pieces that it changed, depending on the kind */
} orb_repair;

/* A handle that ORB_REPAIR_CLOSE_HANDLES closed: the surface is cut along a loop, and a patch covers each of the two
 * rims. If the loop goes around the handle, the repair cuts the handle. If it goes around the tunnel, the repair fills
 * the tunnel. */
typedef struct orb_handle {
  int32_t start, count; /* the loop: mesh.loop_vertices[start] …, numbers of the file, in order; it is closed */
  double length_relative, area_relative; /* of the loop, to the diagonal; of both patches, to its square */
  int filled;                            /* whether the loop ran around the tunnel */
} orb_handle;

/* An object of the file that has a name: its triangles run to the first one of the next object. */
enum { ORB_PART_NAME = 128 };
typedef struct orb_object {
  int32_t first_triangle;   /* numbers of the file */
  char name[ORB_PART_NAME]; /* UTF-8 without control characters; longer names are cut */
  char node[ORB_PART_NAME]; /* glTF: the name of the node that shows the mesh; it is also the name of a mesh without one
                             */
} orb_object;

/* In source_triangle, for a triangle that a repair made: FILL fills a hole of the file, COVER closes what another
 * repair (close_handles, split_nonmanifold) opened. */
enum { ORB_MADE_FILL = -1, ORB_MADE_COVER = -2 };

/* The meshes of a document that form the closed surface: meshes by number, and nodes by name. A node stands for its
 * mesh and those of the nodes below it. */
typedef struct orb_document_parts {
  const int32_t *meshes;
  const char *const *nodes;
  int32_t mesh_count, node_count; /* both 0: every mesh that the surface uses */
} orb_document_parts;

/* A mesh. The context owns all arrays; optional ones are NULL where the file has none. */
typedef struct orb_mesh {
  int32_t vertex_count, triangle_count;
  double
      *positions; /* 3 per vertex, in units of the file (3MF: in millimetres): exactly the doubles that were parsed */
  int32_t *triangles; /* 3 per triangle, counter-clockwise seen from outside */

  /* The numbers of the file. Vertices: in OBJ, OFF and PLY file order; in STL 3·facet + corner; in glTF the POSITION
   * accessors of all triangle primitives one after another; in 3MF the meshes that the build shows, one after another.
   * Triangles: file order, after polygons are cut into triangles. */
  int32_t file_vertex_count, file_triangle_count;
  int32_t *source;           /* of each vertex: the lowest-numbered vertex of the file that it stands for */
  int32_t *vertex_of_source; /* file_vertex_count: the vertex that stands for it, −1 if dropped */
  int32_t *source_triangle;  /* of each triangle: its number in the file, or ORB_MADE_… */

  /* Attributes of corners (corner h belongs to vertex triangles[h]). */
  float *normals;    /* 3 per corner, unit */
  float *texcoords;  /* 2 per corner, glTF's convention (v down) */
  float *colors;     /* 4 per corner, linear RGBA */
  int32_t *material; /* of each triangle; NULL: all 0 */
  int32_t material_count, material_value_count, image_count, dropped_count;
  orb_material *materials;
  orb_material_value *material_values;
  orb_image *images;
  orb_dropped
      *dropped; /* what the file has and the mesh does not; at most ORB_DROPPED_MAX, the last one counts the rest */

  int32_t repair_count;
  orb_repair repairs[ORB_REPAIR_KINDS_MAX];
  int32_t object_count, handle_count, loop_vertex_count;
  orb_object *objects; /* OBJ: o, or g where there is no o; glTF: meshes; 3MF: objects; NULL: the file names none */
  orb_handle *handles; /* in the order in which they were closed */
  int32_t *loop_vertices;
} orb_mesh;

static inline int32_t orb_next(int32_t h) {
  return h % 3 == 2 ? h - 2 : h + 1;
}
static inline int32_t orb_prev(int32_t h) {
  return h % 3 == 0 ? h + 2 : h - 1;
}

/* Frees the arrays and zeroes the struct. */
ORB_API void orb_mesh_free(orb_context *ctx, orb_mesh *mesh);

/* Frees normals, texture coordinates, colours, materials and images, which an embedding does not need. */
ORB_API void orb_mesh_drop_attributes(orb_context *ctx, orb_mesh *mesh);

/* A deep copy. */
ORB_API ORB_MUST_CHECK orb_status orb_mesh_copy(orb_context *ctx, const orb_mesh *mesh, orb_mesh *out);

typedef struct orb_topology {
  int64_t components;
  double genus; /* (2·components − V + E − F − loops) / 2, meaningful for orientable manifolds */
  int64_t boundary_loops, boundary_edges, nonmanifold_edges, nonmanifold_vertices;
  int consistent; /* neighbouring triangles face the same way */
  int orientable; /* a consistent orientation exists */
} orb_topology;

/* Measures any list of triangles, also one that does not form a surface. O(V + F) expected. */
ORB_API ORB_MUST_CHECK orb_status orb_mesh_topology(orb_context *ctx, const orb_mesh *mesh, orb_topology *out);

/* Limits of coordinates: their largest magnitude; the least diagonal of the bounding box; and the least diagonal as a
 * share of the largest coordinate. Assets hold float32, which has about 8 steps over such a share; areas, volumes and
 * their products stay well within doubles. */
#define ORB_COORDINATE_MAX 1e30
#define ORB_DIAGONAL_MIN 1e-30
#define ORB_DIAGONAL_SHARE 1e-6

enum {
  ORB_REPAIR_NONE = 0,
  ORB_REPAIR_SAFE = 1,              /* only what is needed and changes no shape; each repair is counted */
  ORB_REPAIR_FILL_HOLES = 2,        /* implies safe */
  ORB_REPAIR_LARGEST_COMPONENT = 4, /* implies safe; keeps the piece with the most triangles */
  ORB_REPAIR_PART = 16,             /* implies safe; keeps the piece that orb_repair_options names */
  ORB_REPAIR_CLOSE_HANDLES = 8,     /* implies safe; see orb_repair_options.handle_size */
  ORB_REPAIR_SPLIT = 32,            /* implies safe; splits edges of more than two faces and vertices at which bodies
                                     * touch, before a piece is chosen, and fills the holes that this opens in a closed
                                     * surface */
};

/* Prepares a mesh for embedding, in place, or reports why it cannot be embedded. Afterwards it is closed, manifold,
 * oriented outward, or as its file is where what fills holes has a quarter of its area, connected, of genus zero, has
 * four triangles or more, and a size and position that float32 can hold (otherwise ORB_E_DEGENERATE, see
 * ORB_DIAGONAL_MIN). With ORB_REPAIR_NONE the only change is to reverse a mesh that is wholly inside out. On failure
 * the contents of the mesh are unspecified but can be freed, and the error has the facts (edges and vertices in the
 * file's numbers). O(V + F) expected. */
ORB_API ORB_MUST_CHECK orb_status orb_mesh_repair(orb_context *ctx, orb_mesh *mesh, unsigned repair);

#define ORB_HANDLE_SIZE 0.05
/* The most that a request may allow: a path from end to end of the mesh and back, with room for detours. */
#define ORB_HANDLE_SIZE_MOST 10

typedef struct orb_repair_options {
  unsigned repair;
  double handle_size; /* handles are closed along loops of at most this length, relative to the diagonal; 0: 0.05 */
  int32_t part;       /* with ORB_REPAIR_PART: pieces are numbered by their triangles, the largest is 0 */
  char part_name[ORB_PART_NAME]; /* unless "": the largest piece with this name, instead of a number. A piece has the
                                  * name of the object that most of its triangles belong to. If no piece has the name,
                                  * the largest one whose node has it; else the one with an object of this name */
} orb_repair_options;

/* The same with options. */
ORB_API ORB_MUST_CHECK orb_status orb_mesh_repair_with(orb_context *ctx, orb_mesh *mesh,
                                                       const orb_repair_options *options);

/* Fills twin[h] for each of the 3·triangle_count half-edges of a closed oriented manifold; ORB_E_INTERNAL if the list
 * is not one. O(F) expected. */
ORB_API ORB_MUST_CHECK orb_status orb_mesh_twins(orb_context *ctx, const int32_t *triangles, int32_t triangle_count,
                                                 int32_t vertex_count, int32_t *twin);

/* Surface area, signed enclosed volume, bounding box and its diagonal. */
typedef struct orb_extent {
  double area, volume, min[3], max[3], diagonal;
} orb_extent;
ORB_API void orb_mesh_extent(const orb_mesh *mesh, orb_extent *out);

/* A point of a surface: triangle and barycentric coordinates (≥ 0, sum 1) of its three corners in order. */
typedef struct orb_place {
  int32_t triangle;
  double at[3];
} orb_place;

/* The position of a place in space; exactly that of the vertex where a coordinate is 1. */
ORB_API void orb_place_position(const orb_mesh *mesh, const orb_place *place, double out[3]);

/* A place at a vertex: its first incident triangle, coordinate 1 there. O(F): meant for landmarks. */
ORB_API ORB_MUST_CHECK orb_status orb_place_of_vertex(orb_context *ctx, const orb_mesh *mesh, int32_t vertex,
                                                      orb_place *out);

/* Nearest points of a surface, by a bounding-volume tree: O(F log F) to build, O(log F) for a typical query. Any thread
 * may query. The tree copies what it needs of positions and triangles. */
typedef struct orb_nearest orb_nearest;
ORB_API ORB_MUST_CHECK orb_status orb_nearest_create(orb_context *ctx, const double *positions,
                                                     const int32_t *triangles, int32_t triangle_count,
                                                     orb_nearest **out);
ORB_API void orb_nearest_destroy(orb_context *ctx, orb_nearest *tree);
/* Finds the nearest place whose squared distance to p is below max_distance2 (INFINITY: no bound). Returns that squared
 * distance; INFINITY, with triangle −1, if there is no such place. Ties go to the lowest triangle number. */
ORB_API double orb_nearest_query(const orb_nearest *tree, const double p[3], double max_distance2, orb_place *out);

#ifdef __cplusplus
}
#endif
#endif
