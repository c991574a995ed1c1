/* The asset: a supermesh as binary glTF 2.0 with one morph target for each further shape. */
#ifndef ORBMORPH_ASSET_H
#define ORBMORPH_ASSET_H

#include "orbmorph/transfer.h"

#ifdef __cplusplus
extern "C" {
#endif

/* AUTO: SIMILARITY for the shapes whose frame clearly differs from the first one's: larger or smaller by a factor of
 * more than 1.5, rotated by more than 30°, or farther away than half the diagonal of the first shape; NONE for the
 * others. If a rotation by right angles lies within 30° of the best rotation and fits nearly as well, AUTO uses it:
 * such differences come from the axes of the file, and smaller ones from the posture of the shape.
 * AUTO_UNSURE: AUTO for a correspondence that may be wrong. Shapes are scaled and moved, but not rotated, unless they
 * fit so well that it does not matter which parts correspond, right angles make them fit far better, so that their
 * files have other axes, or their places correspond to opposite ones, so that they would collapse on the way.
 * orb_merge() takes it for AUTO where the match is unsure.
 */
typedef enum orb_fit { ORB_FIT_NONE = 0, ORB_FIT_RIGID, ORB_FIT_SIMILARITY, ORB_FIT_AUTO, ORB_FIT_AUTO_UNSURE } orb_fit;
typedef enum orb_animation { ORB_ANIMATION_PINGPONG = 0, ORB_ANIMATION_NONE } orb_animation;
typedef enum orb_holes { ORB_HOLES_REOPEN = 0, ORB_HOLES_FILLED } orb_holes;
typedef enum orb_path { ORB_PATH_LINEAR = 0, ORB_PATH_RIGID } orb_path;

/* A morph target besides the shapes. */
typedef struct orb_asset_target {
  char name[ORB_NAME_MAX];
  float *moves; /* 3 per supermesh vertex, from the first shape */
} orb_asset_target;

typedef struct orb_asset_options {
  int normals;             /* write normals; default: 1 */
  orb_animation animation; /* default: ORB_ANIMATION_PINGPONG */
  orb_fit fit;             /* default: ORB_FIT_AUTO */
  orb_path path;           /* default: ORB_PATH_LINEAR */
  int32_t path_steps;      /* for ORB_PATH_RIGID: in-between targets for each pair of neighbours; default: 3 */
  int colors;              /* also write the colours of the later shapes, as morphed attributes; default: 0 */
  orb_holes holes;         /* ORB_HOLES_REOPEN (default): omit the triangles that fill holes of the first shape, if the
                              supermesh has their rims */
  /* split_count lists of a number for each corner of the supermesh: corners share a vertex of the file only if their
     numbers agree in every list. The lists that are NULL are skipped. */
  const int32_t *const *splits;
  int32_t split_count;
  int32_t target_count;
  const orb_asset_target *targets; /* they come after the shapes and in-betweens, and no animation shows them */
} orb_asset_options;
ORB_API void orb_asset_defaults(orb_asset_options *options);

/* What was written. */
typedef struct orb_asset_facts {
  int32_t vertex_count;       /* of the primitives, one after another; after splits for normals, seams, materials */
  int32_t triangle_count;     /* without those that fill holes of the first shape that are open again */
  int32_t primitive_count;    /* one for each material that is used */
  int32_t target_count;       /* later shapes, then in-betweens, then those of the options */
  int32_t morphed_attributes; /* of all targets together; glTF requires clients to support only 8 at once */
  int32_t nudged_vertices;    /* moved by units in the last place to keep them distinct, see orb_asset_write() */
} orb_asset_facts;

/* Appends the GLB. names: shape_count names of the morph targets (the first names the mesh); equal names get a number.
 * The base is the first shape; the targets are the later shapes in their order, then the in-betweens. facts may be
 * NULL.
 *
 * Normals: those of the file if it has any; vertices are split to keep its hard edges. Otherwise angle-weighted vertex
 * normals of the input surface, interpolated at each place. The copies of a split vertex have bit-equal POSITION and
 * deltas. Texture coordinates, materials and their images are those of the first shape. Parts whose material has a
 * texture that bends normals get tangents, which morph like normals.
 *
 * Two supermesh vertices that would coincide in every shape after rounding to float32 are kept distinct. One of them
 * moves on the first shape: the one that is not a landmark, else the one with the higher number. It moves along one
 * coordinate, by as few units in its last place as possible, at most 16, and if that does not suffice, along several,
 * by at most 6 units in the last place of the largest one. ORB_E_NOT_CERTIFIED if even that does not: if thousands
 * coincide.
 *
 * Errors: ORB_E_BAD_OPTION, ORB_E_TOO_LARGE (4 GiB), ORB_E_NO_MEMORY. Stage "write". O(V·N). */
ORB_API ORB_MUST_CHECK orb_status orb_asset_write(orb_context *ctx, const orb_supermesh *supermesh,
                                                  const orb_aligned_shape *shapes, const char *const *names,
                                                  const orb_asset_options *options, orb_asset_facts *facts,
                                                  orb_buffer *out);

/* Lists what the files of the shapes have and the asset does not: *list (allocated from the context, freed by the
 * caller; NULL if empty) has *count entries, at most ORB_DROPPED_MAX. Free *list on an error, too. */
ORB_API ORB_MUST_CHECK orb_status orb_asset_dropped(orb_context *ctx, const orb_aligned_shape *shapes,
                                                    int32_t shape_count, const orb_asset_options *options,
                                                    orb_dropped **list, int32_t *count);

typedef struct orb_fit_report {
  orb_fit kind; /* what was done: never AUTO; NONE for the first shape */
  double scale, rotation_degrees;
  double translation_relative; /* distance that the mean of the shape's fitted points moves, divided by the first
                                  shape's diagonal */
  double up_degrees;           /* angle by which the y axis is rotated */
} orb_fit_report;

/* How orb_asset_write() moves each shape: 16 doubles per shape, column-major as in glTF, which take the shape's own
 * coordinates to those of the asset. The identity for the first shape, and for all with ORB_FIT_NONE; else a rotation,
 * a translation and, with ORB_FIT_SIMILARITY, a uniform scale. reports: one per shape, or NULL. O(V·N). */
ORB_API ORB_MUST_CHECK orb_status orb_asset_transforms(orb_context *ctx, const orb_supermesh *supermesh,
                                                       const orb_aligned_shape *shapes, orb_fit fit, double *out,
                                                       orb_fit_report *reports);

/* As orb_asset_write(), and maps each vertex of the file to its supermesh vertex: *vertices (allocated from the
 * context, freed by the caller) has facts->vertex_count numbers, the vertices of the primitives one after another. */
ORB_API ORB_MUST_CHECK orb_status orb_asset_write_mapped(orb_context *ctx, const orb_supermesh *supermesh,
                                                         const orb_aligned_shape *shapes, const char *const *names,
                                                         const orb_asset_options *options, orb_asset_facts *facts,
                                                         orb_buffer *out, int32_t **vertices);

/* As orb_asset_write_mapped(), for a supermesh of ORB_REMESH_TEMPLATE: the vertices and triangles of the base are those
 * of `file`, the first shape as orb_mesh_read() gave it, before repairs. Nothing is welded, nudged or omitted; a
 * vertex whose corners have several texture coordinates, normals or colours gets copies after the others. Triangles
 * keep their order within their material, and there is a primitive for each material. All primitives have the same
 * accessors of vertices, so each vertex is in the asset once; *vertices and facts->vertex_count have it once for each
 * primitive. ORB_E_TOO_LARGE: with that they would have more than 2³¹ − 1. Vertices of the file that are not on the
 * closed surface stay where they are in every target; their entry in *vertices is −1. No tangents and no colours
 * of later shapes are written. */
ORB_API ORB_MUST_CHECK orb_status orb_asset_write_template(orb_context *ctx, const orb_supermesh *supermesh,
                                                           const orb_aligned_shape *shapes, const orb_mesh *file,
                                                           const char *const *names, const orb_asset_options *options,
                                                           orb_asset_facts *facts, orb_buffer *out, int32_t **vertices);

/* A glTF or GLB file. */
typedef struct orb_document {
  const orb_mesh *mesh; /* as orb_mesh_read() gave it, before repairs */
  const unsigned char *bytes;
  size_t size;
  orb_document_parts parts; /* the surface must have vertices of each of these meshes, and of no other one */
} orb_document;

/* As orb_asset_write_template(), where the first shape came as glTF or GLB: appends that document as a GLB, with
 * targets added to the meshes that form the closed surface. The bytes of its first buffer do not change, nor does
 * anything else: nodes, skins, weights, materials, animations, extensions. Existing targets come first;
 * mesh.extras.firstShape is the number of the first target that is a shape. Where such a mesh is compressed, the
 * document is unpacked, and says so in *list. Targets are in the coordinates of each mesh. *vertices: those of the
 * triangle primitives of all meshes, one after another.
 *
 * *list (allocated from the context, freed by the caller, NULL if empty) has *count entries: what the asset lacks. Free
 * it on an error, too. ORB_E_BAD_OPTION: the document cannot be kept; the message says why. */
ORB_API ORB_MUST_CHECK orb_status orb_asset_write_document(orb_context *ctx, const orb_supermesh *supermesh,
                                                           const orb_aligned_shape *shapes,
                                                           const orb_document *document, const char *const *names,
                                                           const orb_asset_options *options, orb_asset_facts *facts,
                                                           orb_buffer *out, int32_t **vertices, orb_dropped **list,
                                                           int32_t *count);

#ifdef __cplusplus
}
#endif
#endif
