/* The base colour of a shape at its places: textures, factors and colours of vertices. */
#ifndef ORB_CARRY_TEXELS_H
#define ORB_CARRY_TEXELS_H

#include "format/image.h"
#include "orbmorph/mesh.h"

typedef struct orb_texels {
  const orb_mesh *mesh;
  orb_pixels *images; /* of the mesh; those that no base colour uses have no pixels */
  int has_alpha;      /* some material shows it */
  float linear[256];  /* of a byte of sRGB */
} orb_texels;

/* Decodes the images. Free also after an error. ORB_E_BAD_OPTION: an image cannot be read. */
ORB_MUST_CHECK orb_status orb_texels_open(orb_context *ctx, const orb_mesh *mesh, orb_texels *out);
void orb_texels_close(orb_context *ctx, orb_texels *texels);

/* Whether the mesh has a base colour texture. */
int orb_texels_has(const orb_mesh *mesh);

/* How many texels of its textures the surface shows. */
double orb_texels_count(const orb_texels *texels);

/* The colour at a place, as 8 bits of sRGB and of alpha. Thread-safe. */
void orb_texels_at(const orb_texels *texels, const orb_place *place, unsigned char out[4]);

#endif
