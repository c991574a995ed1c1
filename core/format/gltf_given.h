/* What the vertices of a glTF document have besides positions, in the numbers of orb_mesh_read(). */
#ifndef ORB_FORMAT_GLTF_GIVEN_H
#define ORB_FORMAT_GLTF_GIVEN_H

#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A document, and which of its vertices count: those on the closed surface. */
typedef struct orb_given_file {
  const unsigned char *bytes;
  size_t size;
  int32_t vertex_count;
  const unsigned char *used; /* vertex_count */
} orb_given_file;

enum { ORB_GIVEN_SETS = 8 }; /* of colours, of texture coordinates: sets of higher numbers are not read */

/* Sets of colours (4 numbers per vertex; white where a primitive has none) or texture coordinates (2; zeros). A set
 * counts if a vertex that counts has it. */
typedef struct orb_given_sets {
  int32_t count, width;
  int32_t number[ORB_GIVEN_SETS]; /* of COLOR_n or TEXCOORD_n */
  float *values[ORB_GIVEN_SETS];
} orb_given_sets;
/* prefix: "COLOR_" or "TEXCOORD_". Free also after an error. */
ORB_MUST_CHECK orb_status orb_given_sets_read(orb_context *ctx, const orb_given_file *file, const char *prefix,
                                              orb_given_sets *out);
void orb_given_sets_free(orb_context *ctx, orb_given_sets *sets);

enum { ORB_GIVEN_JOINTS = 65535, ORB_GIVEN_TARGETS = 256 };

/* The skin of the meshes on the surface. */
typedef struct orb_given_skin {
  int32_t skin, joint_count;
  int32_t influences; /* of a vertex */
  uint16_t *joints;   /* influences a vertex */
  float *weights;     /* likewise; not negative */
  double place[16];   /* the transform of the meshes to the scene, column-major */
} orb_given_skin;
/* skin −1: there is none. ORB_E_BAD_OPTION: the meshes on the surface have several. Free also after an error. */
ORB_MUST_CHECK orb_status orb_given_skin_read(orb_context *ctx, const orb_given_file *file, orb_given_skin *out);
void orb_given_skin_free(orb_context *ctx, orb_given_skin *skin);

/* The morph targets of the meshes on the surface; those of equal names are one. */
typedef struct orb_given_targets {
  int32_t count;
  char (*names)[ORB_NAME_MAX];
  float **moves; /* 3 per vertex, in the coordinates of the scene; zeros where a mesh does not have the target */
} orb_given_targets;
/* Free also after an error. */
ORB_MUST_CHECK orb_status orb_given_targets_read(orb_context *ctx, const orb_given_file *file, orb_given_targets *out);
void orb_given_targets_free(orb_context *ctx, orb_given_targets *targets);

/* The triangles of all primitives of a document as numbers of its vertices, with their texture coordinates: the set
 * that the base colour texture of their material uses, else the first. Those of strips and fans are omitted. */
typedef struct orb_given_charts {
  int32_t triangle_count, vertex_count;
  int32_t *triangles; /* 3 per triangle */
  int32_t *material;  /* of each triangle; −1: none */
  float *uv;          /* 2 per vertex */
  unsigned char *has; /* of each vertex: whether it has texture coordinates */
} orb_given_charts;
/* Free also after an error. */
ORB_MUST_CHECK orb_status orb_given_charts_read(orb_context *ctx, const unsigned char *bytes, size_t size,
                                                orb_given_charts *out);
void orb_given_charts_free(orb_context *ctx, orb_given_charts *charts);

/* A name in an asset: one that was given, and a number that makes it unique. */
typedef char orb_given_name[ORB_NAME_MAX + 32];

/* The names of the last `count` targets of a document's mesh on the surface; names that it does not give stay as they
 * are. on_surface: of its vertices, −1: not on it. */
ORB_MUST_CHECK orb_status orb_given_last_targets(orb_context *ctx, const unsigned char *bytes, size_t size,
                                                 const int32_t *on_surface, int32_t vertex_count, int32_t count,
                                                 orb_given_name *names);

#ifdef __cplusplus
}
#endif
#endif
