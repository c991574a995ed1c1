/* Triangles onto a canvas with depths: barycentric coordinates over the bounding box, normals blended, one lamp over
 * the viewer's shoulder, a weaker one from the other side, and light from the sky. */
#include <math.h>

#include "view.h"

static float shade(const float normal[3]) {
  static const float key[3] = {-0.45f, 0.62f, 0.64f}, fill[3] = {0.75f, 0.1f, 0.65f};
  float k = 0, f = 0;
  for (int c = 0; c < 3; c++) {
    k += key[c] * normal[c];
    f += fill[c] * normal[c];
  }
  return 0.16f + 0.08f * normal[1] + 0.72f * (k > 0 ? k : 0) + 0.18f * (f > 0 ? f : 0);
}

static void pixel_color(const view_vertex *const v[3], const float at[3], int front, float edge, float out[3]) {
  float normal[3], length = 0;
  for (int c = 0; c < 3; c++) {
    normal[c] = at[0] * v[0]->normal[c] + at[1] * v[1]->normal[c] + at[2] * v[2]->normal[c];
    length += normal[c] * normal[c];
  }
  length = length > 0 ? sqrtf(length) : 1;
  for (int c = 0; c < 3; c++) {
    normal[c] /= length;
  }
  float light = shade(normal);
  for (int c = 0; c < 3; c++) {
    float color = at[0] * v[0]->color[c] + at[1] * v[1]->color[c] + at[2] * v[2]->color[c];
    out[c] = front ? light * color * edge : c == 0 ? 0.6f : 0.03f;
  }
}

static float cross2(const view_vertex *a, const view_vertex *b, float x, float y) {
  return (b->x - a->x) * (y - a->y) - (b->y - a->y) * (x - a->x);
}

void view_triangle(view_canvas *canvas, const view_vertex *a, const view_vertex *b, const view_vertex *c, int wire) {
  const view_vertex *v[3] = {a, b, c};
  float area = cross2(a, b, c->x, c->y);
  float left = fminf(a->x, fminf(b->x, c->x)), right = fmaxf(a->x, fmaxf(b->x, c->x));
  float top = fminf(a->y, fminf(b->y, c->y)), bottom = fmaxf(a->y, fmaxf(b->y, c->y));
  if (area == 0 || !(left >= -1e6f && right <= 1e6f && top >= -1e6f && bottom <= 1e6f)) {
    return;
  }
  int x0 = (int)floorf(left), x1 = (int)ceilf(right), y0 = (int)floorf(top), y1 = (int)ceilf(bottom);
  x0 = x0 < 0 ? 0 : x0;
  y0 = y0 < 0 ? 0 : y0;
  x1 = x1 >= canvas->width ? canvas->width - 1 : x1;
  y1 = y1 >= canvas->height ? canvas->height - 1 : y1;
  float height[3]; /* of each corner over the edge opposite, in pixels */
  for (int k = 0; k < 3; k++) {
    const view_vertex *p = v[(k + 1) % 3], *q = v[(k + 2) % 3];
    height[k] = fabsf(area) / fmaxf(1e-6f, hypotf(q->x - p->x, q->y - p->y));
  }
  for (int y = y0; y <= y1; y++) {
    for (int x = x0; x <= x1; x++) {
      float px = (float)x + 0.5f, py = (float)y + 0.5f;
      float at[3] = {cross2(b, c, px, py) / area, cross2(c, a, px, py) / area, cross2(a, b, px, py) / area};
      if (at[0] < 0 || at[1] < 0 || at[2] < 0) {
        continue;
      }
      float z = at[0] * a->z + at[1] * b->z + at[2] * c->z;
      long pixel = (long)y * canvas->width + x;
      if (z <= canvas->depth[pixel]) {
        continue;
      }
      canvas->depth[pixel] = z;
      float near = fminf(at[0] * height[0], fminf(at[1] * height[1], at[2] * height[2]));
      pixel_color(v, at, area < 0, wire && near < 0.8f ? 0.45f : 1, canvas->color + 3 * pixel);
    }
  }
}
