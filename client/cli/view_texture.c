#include "view_texture.h"

/* jpeglib.h needs stdio.h before it. */
#include <stdio.h>

#include <jpeglib.h>
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_TEXTURE_SIDE = 16384 };
#define MAX_TEXTURE_PIXELS ((size_t)1 << 28)

static int allowed(size_t width, size_t height) {
  return width > 0 && height > 0 && width <= MAX_TEXTURE_SIDE && height <= MAX_TEXTURE_SIDE &&
         width * height <= MAX_TEXTURE_PIXELS;
}

static int decode_png(const unsigned char *bytes, size_t size, view_texture *out) {
  png_image image = {.version = PNG_IMAGE_VERSION};
  const png_color white = {255, 255, 255};
  if (!png_image_begin_read_from_memory(&image, bytes, size)) {
    return -1;
  }
  if (allowed(image.width, image.height)) {
    image.format = PNG_FORMAT_RGB;
    out->width[0] = (int)image.width;
    out->height[0] = (int)image.height;
    out->pixels[0] = malloc(PNG_IMAGE_SIZE(image));
  }
  int fine = out->pixels[0] && png_image_finish_read(&image, &white, out->pixels[0], 0, NULL);
  png_image_free(&image);
  return fine ? 0 : -1;
}

typedef struct jpeg_failure {
  struct jpeg_error_mgr manager;
  jmp_buf back;
} jpeg_failure;

static void on_jpeg_error(j_common_ptr info) {
  longjmp(((jpeg_failure *)info->err)->back, 1);
}

static void on_jpeg_message(j_common_ptr info) {
  (void)info;
}

/* A function of its own: longjmp leaves modified locals of the function that called setjmp indeterminate. */
static int jpeg_rows(struct jpeg_decompress_struct *info, jpeg_failure *failure, const unsigned char *bytes,
                     size_t size, view_texture *out) {
  if (setjmp(failure->back)) {
    return -1;
  }
  jpeg_mem_src(info, bytes, (unsigned long)size);
  jpeg_read_header(info, TRUE);
  info->out_color_space = JCS_RGB;
  jpeg_start_decompress(info);
  if (!allowed(info->output_width, info->output_height)) {
    return -1;
  }
  out->width[0] = (int)info->output_width;
  out->height[0] = (int)info->output_height;
  out->pixels[0] = malloc(3 * (size_t)info->output_width * info->output_height);
  while (out->pixels[0] && info->output_scanline < info->output_height) {
    JSAMPROW row = out->pixels[0] + 3 * (size_t)info->output_width * info->output_scanline;
    jpeg_read_scanlines(info, &row, 1);
  }
  if (out->pixels[0]) {
    jpeg_finish_decompress(info);
  }
  return out->pixels[0] ? 0 : -1;
}

static int decode_jpeg(const unsigned char *bytes, size_t size, view_texture *out) {
  struct jpeg_decompress_struct info;
  jpeg_failure failure;
  info.err = jpeg_std_error(&failure.manager);
  failure.manager.error_exit = on_jpeg_error;
  failure.manager.output_message = on_jpeg_message;
  jpeg_create_decompress(&info);
  int rc = jpeg_rows(&info, &failure, bytes, size, out);
  jpeg_destroy_decompress(&info);
  return rc;
}

static unsigned char encoded(float linear) {
  float v = linear <= 0.0031308f ? 12.92f * linear : 1.055f * powf(linear, 1 / 2.4f) - 0.055f;
  return (unsigned char)(v * 255 + 0.5f);
}

static float linear_of(unsigned char srgb) {
  float v = (float)srgb / 255;
  return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

/* Makes the next level: each pixel is the mean of four. The last row or column of an odd side is dropped; a side of one
 * pixel stays. */
static int halve(view_texture *t, int level, const float linear[256]) {
  int w = t->width[level], h = t->height[level], width = w > 1 ? w / 2 : 1, height = h > 1 ? h / 2 : 1;
  const unsigned char *from = t->pixels[level];
  unsigned char *to = malloc(3 * (size_t)width * (size_t)height);
  for (int y = 0; to && y < height; y++) {
    for (int x = 0; x < 3 * width; x++) {
      float sum = 0;
      for (int k = 0; k < 4; k++) {
        int sx = 2 * (x / 3) + k % 2, sy = 2 * y + k / 2;
        sx = sx < w ? sx : w - 1;
        sy = sy < h ? sy : h - 1;
        sum += linear[from[3 * ((size_t)sy * (size_t)w + (size_t)sx) + (size_t)(x % 3)]];
      }
      to[3 * (size_t)y * (size_t)width + (size_t)x] = encoded(sum / 4);
    }
  }
  t->width[level + 1] = width;
  t->height[level + 1] = height;
  t->pixels[level + 1] = to;
  return to ? 0 : -1;
}

int view_texture_decode(const unsigned char *bytes, size_t size, view_texture *out) {
  float linear[256];
  memset(out, 0, sizeof *out);
  int rc = size > 8 && memcmp(bytes, "\x89PNG", 4) == 0    ? decode_png(bytes, size, out)
           : size > 3 && memcmp(bytes, "\xff\xd8", 2) == 0 ? decode_jpeg(bytes, size, out)
                                                           : -1;
  for (int i = 0; i < 256; i++) {
    linear[i] = linear_of((unsigned char)i);
  }
  out->levels = 1;
  while (rc == 0 && out->levels < VIEW_LEVELS &&
         (out->width[out->levels - 1] > 1 || out->height[out->levels - 1] > 1)) {
    rc = halve(out, out->levels - 1, linear);
    out->levels++;
  }
  if (rc != 0) {
    view_texture_free(out);
  }
  return rc;
}

void view_texture_free(view_texture *texture) {
  for (int level = 0; level < VIEW_LEVELS; level++) {
    free(texture->pixels[level]);
  }
  memset(texture, 0, sizeof *texture);
}

/* Maps a column or row into the image as the wrap mode says. */
static int wrapped(int at, int size, int wrap) {
  if (wrap == VIEW_CLAMP) {
    return at < 0 ? 0 : at >= size ? size - 1 : at;
  }
  int period = wrap == VIEW_MIRROR ? 2 * size : size, rest = at % period;
  rest += rest < 0 ? period : 0;
  return rest < size ? rest : period - 1 - rest;
}

void view_texture_sample(const view_texture *t, float u, float v, float span, float out[3]) {
  int level = span > 1 ? (int)(log2f(fminf(span, 1 << VIEW_LEVELS)) + 0.5f) : 0;
  level = level < t->levels ? level : t->levels - 1;
  float x = u * (float)t->width[level] - 0.5f, y = v * (float)t->height[level] - 0.5f;
  out[0] = out[1] = out[2] = 0;
  if (!(fabsf(x) < 1e8f && fabsf(y) < 1e8f)) {
    return;
  }
  int x0 = (int)floorf(x), y0 = (int)floorf(y);
  float fx = x - (float)x0, fy = y - (float)y0;
  for (int k = 0; k < 4; k++) {
    int column = wrapped(x0 + k % 2, t->width[level], t->wrap[0]),
        row = wrapped(y0 + k / 2, t->height[level], t->wrap[1]);
    const unsigned char *p = t->pixels[level] + 3 * ((size_t)row * (size_t)t->width[level] + (size_t)column);
    float weight = (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
    for (int c = 0; c < 3; c++) {
      out[c] += weight * linear_of(p[c]);
    }
  }
}
