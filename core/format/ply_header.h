/* The header of a PLY file. */
#ifndef ORB_FORMAT_PLY_HEADER_H
#define ORB_FORMAT_PLY_HEADER_H

#include "format/build.h"
#include "format/text.h"

enum { PLY_ELEMENTS_MAX = 32, PLY_PROPERTIES_MAX = 128 }; /* of a header; both fit the stack */

typedef enum ply_type { PLY_NONE, PLY_I8, PLY_U8, PLY_I16, PLY_U16, PLY_I32, PLY_U32, PLY_F32, PLY_F64 } ply_type;

/* What a property means; of several with the same role the first counts. */
typedef enum ply_role {
  PLY_OTHER,
  PLY_X,
  PLY_Y,
  PLY_Z,
  PLY_NX,
  PLY_NY,
  PLY_NZ,
  PLY_RED,
  PLY_GREEN,
  PLY_BLUE,
  PLY_ALPHA,
  PLY_S,
  PLY_T,
  PLY_INDICES,
  PLY_ROLES
} ply_role;

typedef struct ply_property {
  ply_type type, count_type; /* count_type other than PLY_NONE: a list */
  ply_role role;
} ply_property;

typedef struct ply_element {
  enum { PLY_SKIP, PLY_VERTICES, PLY_FACES, PLY_STRIPS } kind;
  int64_t count;
  int first, properties; /* in ply_header.property */
  unsigned roles;        /* set of the roles it has */
} ply_element;

typedef struct ply_header {
  enum { PLY_ASCII, PLY_LITTLE, PLY_BIG } encoding;
  int elements, properties;
  int names_texture; /* a comment says "TextureFile" */
  ply_element element[PLY_ELEMENTS_MAX];
  ply_property property[PLY_PROPERTIES_MAX];
} ply_header;

/* Reads the header; `text` is then at the first byte of the data. */
ORB_MUST_CHECK orb_status orb_ply_header(orb_context *ctx, orb_text *text, ply_header *header);

/* In bytes. */
int orb_ply_type_size(ply_type type);

#endif
