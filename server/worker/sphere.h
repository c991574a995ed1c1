/* The stored sphere is the sphere.ply that callers get. Its layout is ours, yet nothing of it is believed: the size
 * must fit the counts, and every point must lie on the unit sphere. */
#ifndef ORB_WORKER_SPHERE_H
#define ORB_WORKER_SPHERE_H

#include <stddef.h>
#include <stdint.h>

/* Where the points begin in the bytes; they lie SPHERE_STRIDE apart, 3 doubles each, not aligned. NULL: the bytes are
 * not the sphere of a mesh with so many vertices and triangles. */
enum { SPHERE_STRIDE = 52 };
const unsigned char *sphere_points(const unsigned char *bytes, size_t size, int32_t vertices, int32_t triangles);

#endif
