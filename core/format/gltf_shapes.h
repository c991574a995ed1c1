/* What a glTF document that is kept gets: the targets and the keys of their animation. */
#ifndef ORB_FORMAT_GLTF_SHAPES_H
#define ORB_FORMAT_GLTF_SHAPES_H

#include "orbmorph/mesh.h"

/* The targets, in the coordinates of the scene: keeping takes them to those of each primitive. */
typedef struct orb_gltf_shapes {
  int32_t target_count, file_vertex_count;
  const char *const *names;       /* target_count */
  const int32_t *on_surface;      /* per vertex of the file, as orb_mesh_read() numbers them; −1: it stays */
  const double *const *positions; /* target_count + 1 lists, 3 per vertex of the surface; first those of the document */
  const double *const *normals;   /* likewise, unit or zero; NULL: targets get no normals */
  int32_t key_count;              /* of the animation "morph"; 0: none */
  const int32_t *key_frames;      /* key_count: 0: the document's shape, k: target k − 1 */
  const double *key_times;        /* seconds */
  orb_document_parts parts;       /* what the surface must consist of */
} orb_gltf_shapes;

#endif
