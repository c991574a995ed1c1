/* Rasterizes by barycentric coordinates over the bounding box of a triangle. Normals are interpolated; a lamp over the
 * viewer's shoulder, a weaker one from the other side and light from above shade them. */
#include "view_canvas.h"

#include <math.h>
#include <stdlib.h>

int view_canvas_make(view_canvas *canvas, int width, int height) {
  size_t pixels = (size_t)width * (size_t)height;
  *canvas = (view_canvas){width, height, malloc(3 * pixels * sizeof(float)), malloc(pixels * sizeof(float))};
  if (!canvas->color || !canvas->depth) {
    view_canvas_free(canvas);
    return -1;
  }
  return 0;
}

void view_canvas_clear(view_canvas *canvas) {
  size_t width = (size_t)canvas->width, pixels = width * (size_t)canvas->height;
  for (size_t i = 0; i < pixels; i++) {
    float tone = 0.90f - 0.12f * (float)(i / width) / (float)canvas->height;
    canvas->color[3 * i] = canvas->color[3 * i + 1] = canvas->color[3 * i + 2] = tone;
    canvas->depth[i] = -INFINITY;
  }
}

void view_canvas_free(view_canvas *canvas) {
  free(canvas->color);
  free(canvas->depth);
  *canvas = (view_canvas){0};
}

static unsigned char srgb(float linear) {
  float v = !(linear > 0) ? 0 : linear >= 1 ? 1 : linear; /* a file may hold any float: NaN becomes black */
  v = v <= 0.0031308f ? 12.92f * v : 1.055f * powf(v, 1 / 2.4f) - 0.055f;
  return (unsigned char)(v * 255 + 0.5f);
}

void view_canvas_row(const view_canvas *canvas, int y, unsigned char *row) {
  for (int x = 0; x < canvas->width / 2; x++) {
    for (int c = 0; c < 3; c++) {
      float sum = 0;
      for (int k = 0; k < 4; k++) {
        sum += canvas->color[3 * ((long)(2 * y + k / 2) * canvas->width + 2 * x + k % 2) + c];
      }
      row[3 * x + c] = srgb(sum / 4);
    }
  }
}

static float shade(const float normal[3]) {
  static const float key[3] = {-0.45f, 0.62f, 0.64f}, fill[3] = {0.75f, 0.1f, 0.65f};
  float k = 0, f = 0;
  for (int c = 0; c < 3; c++) {
    k += key[c] * normal[c];
    f += fill[c] * normal[c];
  }
  return 0.16f + 0.08f * normal[1] + 0.72f * (k > 0 ? k : 0) + 0.18f * (f > 0 ? f : 0);
}

static float blend(const float at[3], float a, float b, float c) {
  return at[0] * a + at[1] * b + at[2] * c;
}

static void pixel_color(const view_vertex *const v[3], const float at[3], const view_paint *paint, float span,
                        float out[3]) {
  float normal[3], length = 0, texel[3] = {1, 1, 1};
  for (int c = 0; c < 3; c++) {
    normal[c] = blend(at, v[0]->normal[c], v[1]->normal[c], v[2]->normal[c]);
    length += normal[c] * normal[c];
  }
  length = length > 0 ? sqrtf(length) : 1;
  for (int c = 0; c < 3; c++) {
    normal[c] /= length;
  }
  if (paint->texture) {
    view_texture_sample(paint->texture, blend(at, v[0]->uv[0], v[1]->uv[0], v[2]->uv[0]),
                        blend(at, v[0]->uv[1], v[1]->uv[1], v[2]->uv[1]), span, texel);
  }
  float light = shade(normal);
  for (int c = 0; c < 3; c++) {
    float color = blend(at, v[0]->color[c], v[1]->color[c], v[2]->color[c]);
    out[c] = light * color * texel[c] * paint->material.factor[c];
  }
}

static float cross2(const view_vertex *a, const view_vertex *b, float x, float y) {
  return (b->x - a->x) * (y - a->y) - (b->y - a->y) * (x - a->x);
}

/* Pixels of the texture per pixel of the canvas in each direction, from the areas of the triangle in both. */
static float texture_span(const view_vertex *const v[3], const view_texture *texture, float area) {
  if (!texture) {
    return 1;
  }
  float du1 = v[1]->uv[0] - v[0]->uv[0], dv1 = v[1]->uv[1] - v[0]->uv[1];
  float du2 = v[2]->uv[0] - v[0]->uv[0], dv2 = v[2]->uv[1] - v[0]->uv[1];
  float texels = fabsf(du1 * dv2 - du2 * dv1) * (float)texture->width[0] * (float)texture->height[0];
  return sqrtf(texels / fabsf(area));
}

static int clip(float value, int most) {
  return value < 0 ? 0 : value > (float)most ? most : (int)value;
}

void view_triangle(view_canvas *canvas, const view_vertex *const v[3], const view_paint *paint) {
  const view_vertex *a = v[0], *b = v[1], *c = v[2];
  float area = cross2(a, b, c->x, c->y), span = texture_span(v, paint->texture, area);
  float left = fminf(a->x, fminf(b->x, c->x)), right = fmaxf(a->x, fmaxf(b->x, c->x));
  float top = fminf(a->y, fminf(b->y, c->y)), bottom = fmaxf(a->y, fmaxf(b->y, c->y));
  if (area == 0 || !(left >= -1e6f && right <= 1e6f && top >= -1e6f && bottom <= 1e6f)) {
    return;
  }
  int x0 = clip(floorf(left), canvas->width), x1 = clip(ceilf(right), canvas->width - 1);
  int y0 = clip(floorf(top), canvas->height), y1 = clip(ceilf(bottom), canvas->height - 1);
  float height[3]; /* of each corner over the opposite edge, in pixels */
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
      float z = blend(at, a->z, b->z, c->z);
      long pixel = (long)y * canvas->width + x;
      if (z <= canvas->depth[pixel]) {
        continue;
      }
      canvas->depth[pixel] = z;
      float *out = canvas->color + 3 * pixel;
      float near = fminf(at[0] * height[0], fminf(at[1] * height[1], at[2] * height[2]));
      pixel_color(v, at, paint, span, out);
      for (int k = 0; k < 3; k++) {
        out[k] =
            paint->inside && area > 0 ? (k == 0 ? 0.6f : 0.03f) : out[k] * (paint->wire && near < 0.8f ? 0.45f : 1);
      }
    }
  }
}
