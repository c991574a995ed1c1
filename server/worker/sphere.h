/* Reads a stored sphere, the sphere.ply that callers download. The file is validated although this program wrote it:
 * its size must match the counts, and every point must lie on the unit sphere. */
#ifndef ORB_WORKER_SPHERE_H
#define ORB_WORKER_SPHERE_H

#include <stddef.h>
#include <stdint.h>

/* The first point in the bytes. Points are SPHERE_STRIDE bytes apart, 3 unaligned doubles each. NULL: the bytes are not
 * a valid sphere of a mesh with these counts. */
enum { SPHERE_STRIDE = 52 };
const unsigned char *sphere_points(const unsigned char *bytes, size_t size, int32_t vertices, int32_t triangles);

#endif
