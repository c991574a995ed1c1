#include "worker/sphere.h"

#include <math.h>
#include <string.h>

enum { HEADER_MOST = 4096, POINT_OFFSET = 24, FACE_BYTES = 13 };

const unsigned char *sphere_points(const unsigned char *bytes, size_t size, int32_t vertices, int32_t triangles) {
  static const char mark[] = "end_header\n";
  const unsigned char *end = memmem(bytes, size < HEADER_MOST ? size : HEADER_MOST, mark, sizeof mark - 1);
  if (!end || vertices < 0 || triangles < 0) {
    return NULL;
  }
  size_t head = (size_t)(end - bytes) + sizeof mark - 1;
  if (size != head + (size_t)vertices * SPHERE_STRIDE + (size_t)triangles * FACE_BYTES) {
    return NULL;
  }
  const unsigned char *first = bytes + head + POINT_OFFSET;
  for (size_t v = 0; v < (size_t)vertices; v++) {
    double p[3];
    memcpy(p, first + v * SPHERE_STRIDE, sizeof p);
    double length = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    if (!(fabs(length - 1) <= 1e-9)) { /* also NaN */
      return NULL;
    }
  }
  return first;
}
