/* Generates supermeshes: one triangulated ball is the sphere, the surface of every shape and the supermesh. */
#ifndef SUPPORT_SUPERMESH_H
#define SUPPORT_SUPERMESH_H

#include <cjson/cJSON.h>

#include "orbmorph/asset.h"

enum { SYNTHETIC_SHAPES_MAX = 8 };

typedef struct synthetic {
  orb_supermesh supermesh;
  orb_aligned_shape shapes[SYNTHETIC_SHAPES_MAX];
} synthetic;

/* The position on shape s of the point p of the unit sphere. */
typedef void (*synthetic_map)(int32_t shape, const double p[3], double out[3]);

/* A ball with the given number of splits; every supermesh vertex is a vertex of every shape. */
synthetic synthetic_make(orb_context *ctx, int levels, int32_t shape_count, synthetic_map map);
void synthetic_free(orb_context *ctx, synthetic *made);

/* Parses the container of a GLB, independently of the writer. */
typedef struct glb {
  cJSON *json;
  const unsigned char *binary;
  size_t binary_size;
} glb;
glb glb_open(const orb_buffer *bytes);
void glb_close(glb *file);
/* Component c of element i of an accessor. */
double glb_value(const glb *file, int accessor, int element, int component);
int glb_count(const glb *file, int accessor);
int glb_attribute(const cJSON *attributes, const char *name); /* −1: none */

#endif
