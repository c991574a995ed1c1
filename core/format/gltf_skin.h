/* A skin that an asset gets from another document. */
#ifndef ORB_FORMAT_GLTF_SKIN_H
#define ORB_FORMAT_GLTF_SKIN_H

#include <stddef.h>
#include <stdint.h>

/* The closed surface of the asset, as it is on the document's shape and on the base; both in the coordinates of the
 * asset. */
typedef struct orb_skin_surface {
  int32_t count;                /* of its vertices; 0: the skeleton stays as it is */
  const double *before, *after; /* 3 per vertex: on the shape, on the base */
  const double *area;           /* of each vertex: the area of the base that it stands for */
  const uint16_t (*joints)[4];
  const float (*weights)[4]; /* the sum is 1 */
} orb_skin_surface;

/* A skin of a document, and which of its joints move the vertices. */
typedef struct orb_added_skin {
  const unsigned char *bytes; /* the document; NULL: no skin is added */
  size_t size;
  int32_t skin, joint_count;
  double place[16], moved[16]; /* from its meshes to its scene, and from there to the asset; column-major */
  const uint16_t *joints;      /* 4 per vertex of all triangle primitives */
  const float *weights;        /* likewise; the sum is 1 */
  orb_skin_surface surface;
} orb_added_skin;

#endif
