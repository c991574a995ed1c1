/* What the XML of a 3MF package says, before its objects are placed: 3mf_xml.c fills it, 3mf_place.c makes the mesh.
 *
 * Everything that is stored counts against a limit that follows from the size of the file (orb_3mf_count()), and
 * whatever callers name is found through hash tables. Lengths are in millimetres. */
#ifndef ORB_FORMAT_3MF_MODEL_H
#define ORB_FORMAT_3MF_MODEL_H

#include "format/build.h"

enum { ORB_3MF_FREE = 16384 }; /* elements that a file may have besides one for each of its bytes */

/* An affine map: a row for each of x, y and z, then the translation; points are rows. */
typedef struct orb_3mf_map {
  double row[4][3];
} orb_3mf_map;

/* An object that a component or an item of the build shows. */
typedef struct orb_3mf_use {
  int32_t part; /* the XML file that defines it */
  int64_t id;
  orb_3mf_map map;
} orb_3mf_use;

typedef enum orb_3mf_kind { ORB_3MF_OBJECT, ORB_3MF_GROUP } orb_3mf_kind;

/* An object, or a group of materials or colours. */
typedef struct orb_3mf_resource {
  int64_t id;
  int32_t part;
  orb_3mf_kind kind;
  int is_used;              /* by a component */
  int32_t material;         /* of triangles that name none: its index in materials; −1: none */
  int64_t vertex, triangle; /* the first ones */
  int64_t vertices, triangles;
  int64_t first, count; /* an object's components, a group's materials */
  char name[ORB_PART_NAME];
} orb_3mf_resource;

typedef struct orb_3mf_material {
  char name[ORB_NAME_MAX]; /* "": a colour of a group */
  char hex[10];            /* "#RRGGBBAA"; "": none */
  int32_t made;            /* its number in the orb_build, −1: not yet */
} orb_3mf_material;

typedef struct orb_3mf_triangle {
  int32_t vertex[3], material; /* −1: the object's */
} orb_3mf_triangle;

typedef struct orb_3mf_model {
  orb_context *ctx;
  int64_t limit, counted; /* of elements */
  double *positions;
  orb_3mf_triangle *triangles;
  orb_3mf_use *components, *items;
  orb_3mf_resource *resources;
  orb_3mf_material *materials;
  int32_t *slots; /* a hash table of the resources by part and id: number + 1, 0: free */
  int64_t vertex_count, triangle_count, component_count, item_count, resource_count, material_count;
  int64_t vertex_room, triangle_room, component_room, item_room, resource_room, material_room, slot_count;
} orb_3mf_model;

void orb_3mf_model_init(orb_3mf_model *model, orb_context *ctx, size_t file_size);
void orb_3mf_model_free(orb_3mf_model *model);

/* Counts elements against the limit; ORB_E_TOO_LARGE beyond. */
ORB_MUST_CHECK orb_status orb_3mf_count(orb_3mf_model *model, int64_t elements);

/* Adds a resource, which becomes the last; ORB_E_MALFORMED_MESH at that line if the part has one of this id. */
ORB_MUST_CHECK orb_status orb_3mf_add(orb_3mf_model *model, int32_t part, int64_t id, orb_3mf_kind kind, int64_t line);

/* NULL: there is none. */
orb_3mf_resource *orb_3mf_find(const orb_3mf_model *model, int32_t part, int64_t id);

/* Places the items of the build; where it has none, all objects that no other has as a component. */
ORB_MUST_CHECK orb_status orb_3mf_place(orb_3mf_model *model, orb_build *build);

#endif
