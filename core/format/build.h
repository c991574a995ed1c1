/* What readers fill while they go through a file, and the mesh that results.
 *
 * Faces may name vertices that come later in a file, so only orb_build_finish() checks indices and cuts polygons into
 * triangles. All arrays grow with what has been read: a count in a header reserves nothing.
 */
#ifndef ORB_FORMAT_BUILD_H
#define ORB_FORMAT_BUILD_H

#include "base/printf.h"
#include "orbmorph/format.h"

enum {
  ORB_FACE_CORNERS_MAX = 1 << 24, /* corners of one face; bounds the scratch memory that cutting it takes */
  ORB_MATERIALS_MAX = 65536,      /* materials of a file; bounds the hash table of their names */
  ORB_OBJECTS_MAX = 65536         /* objects that keep their names; bounds the memory for them */
};

/* One corner of a face, 0-based; −1: none. */
typedef struct orb_corner {
  int32_t vertex, texcoord, normal;
} orb_corner;

typedef struct orb_build {
  orb_context *ctx;
  int64_t max_triangles;
  double *positions; /* 3 per vertex */
  float *colors;     /* 4 per vertex, as in the file; NULL: none */
  float *normals;    /* 3 a normal */
  float *texcoords;  /* 2 a texture coordinate, v up unless texcoords_v_down */
  int64_t vertices, vertex_room, color_room, normal_count, normal_room, texcoord_count, texcoord_room;
  int by_vertex;           /* normals and texture coordinates belong to vertices, not to corners */
  int colors_are_srgb;     /* orb_build_finish() converts them to linear */
  int texcoords_v_down;    /* already in glTF's convention */
  int32_t *corner_vertex;  /* the corners of all faces, one face after another */
  orb_corner *corner_more; /* replaces corner_vertex once a corner has a texture coordinate or normal of its own */
  int64_t corners, corner_room, more_room;
  int32_t *face_size; /* NULL while all faces are triangles */
  int32_t *face_material;
  int64_t faces, size_room, material_room, triangles;
  int32_t largest_face;
  int32_t material; /* of the faces to come; −1 before the file names one */
  orb_material *materials;
  int32_t *material_slots;
  int64_t material_count, materials_room;
  orb_material_value *material_values; /* those of one material after another */
  int64_t value_count, value_room;
  orb_dropped *dropped;
  int32_t dropped_count;
  orb_object *objects; /* first_triangle counts triangles, as polygons are cut later into size − 2 each */
  int64_t object_count, object_room;
  int objects_dropped;                                      /* the file has more than ORB_OBJECTS_MAX */
  int64_t highest_vertex, highest_texcoord, highest_normal; /* indices that a face names, and where: line or offset */
  int64_t highest_vertex_where, highest_texcoord_where, highest_normal_where;
} orb_build;

void orb_build_init(orb_build *build, orb_context *ctx);
void orb_build_free(orb_build *build);

ORB_MUST_CHECK orb_status orb_build_vertex(orb_build *build, const double position[3]);
/* The colour of the vertex last added; earlier vertices without one are white. */
ORB_MUST_CHECK orb_status orb_build_color(orb_build *build, const double *rgba, int channels);
ORB_MUST_CHECK orb_status orb_build_normal(orb_build *build, const double normal[3]);
ORB_MUST_CHECK orb_status orb_build_texcoord(orb_build *build, const double texcoord[2]);

/* The first adds a corner to the current face, the second ends the face. where: line or offset, for messages. */
ORB_MUST_CHECK orb_status orb_build_corner(orb_build *build, orb_corner corner, int64_t where);
ORB_MUST_CHECK orb_status orb_build_face_end(orb_build *build, int64_t corners);

/* Gives the named material to the faces to come. */
ORB_MUST_CHECK orb_status orb_build_use_material(orb_build *build, const unsigned char *name, size_t length);

/* The faces to come belong to an object of this name. */
ORB_MUST_CHECK orb_status orb_build_object(orb_build *build, const unsigned char *name, size_t length);
/* The node that shows the object last added. */
void orb_build_object_node(orb_build *build, const unsigned char *name, size_t length);

/* Notes what the file has and the mesh does not; see orb_dropped_add(). */
ORB_MUST_CHECK orb_status orb_build_drop(orb_build *build, const char *what, const char *where, const char *why);

/* Fails with ORB_E_MALFORMED_MESH at a line of a text (is_text) or at a byte offset. */
orb_status orb_build_malformed(orb_context *ctx, int is_text, int64_t where, const char *format, ...) ORB_PRINTF(4, 5);

/* Grows an array (the address of its pointer) to hold `need` elements of `element` bytes; *room: how many it holds. */
ORB_MUST_CHECK orb_status orb_build_grow(orb_context *ctx, void *array, int64_t *room, int64_t need, size_t element);

#endif
