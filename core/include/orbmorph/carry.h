/* Carrying what shapes have besides a surface to the supermesh: a skin, colours, texture coordinates, morph targets,
 * and textures. */
#ifndef ORBMORPH_CARRY_H
#define ORBMORPH_CARRY_H

#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum orb_carry_what {
  ORB_CARRY_SKIN = 0, /* joints and weights of the vertices, and the skeleton */
  ORB_CARRY_COLOR,    /* all sets of colours of vertices */
  ORB_CARRY_TEXCOORD, /* all sets of texture coordinates */
  ORB_CARRY_TARGETS,  /* the morph targets of the file */
  ORB_CARRY_TEXTURE,  /* base colour textures, baked into the texture coordinates of the first shape */
  ORB_CARRY_COUNT
} orb_carry_what;

/* The name on the wire, such as "skin"; NULL if there is no such thing. */
ORB_API const char *orb_carry_name(orb_carry_what what);

enum { ORB_CARRY_MAX = 64, ORB_BAKE_LEAST = 16, ORB_BAKE_MOST = 8192 /* texels a side */ };

typedef struct orb_carry {
  int32_t from; /* the shape; of a texture: not the first one */
  orb_carry_what what;
  int32_t resolution; /* of a texture: texels a side, ORB_BAKE_LEAST to ORB_BAKE_MOST; 0: as fine as its own */
} orb_carry;

/* The uploaded file of a shape. */
typedef struct orb_shape_file {
  const int32_t *corners;     /* the vertices of its triangles, 3 per triangle, in the numbers of the file */
  const unsigned char *bytes; /* glTF or GLB; NULL: another format */
  size_t size;
} orb_shape_file;

/* What was carried. */
typedef struct orb_carried {
  int32_t from;
  orb_carry_what what;
  char as[ORB_NAME_MAX + 32]; /* its name in the asset: "COLOR_0", "JOINTS_0", the name of a target or a variant */
  int32_t resolution;         /* of a texture: texels a side */
  int64_t shared_texels;      /* that several triangles of the first shape use */
} orb_carried;

#ifdef __cplusplus
}
#endif
#endif
