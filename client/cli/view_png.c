/* A canvas into a PNG: 2 × 2 pixels averaged in linear light, then sRGB. */
#include <errno.h>
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "view.h"

static unsigned char srgb(float linear) {
  float v = !(linear > 0) ? 0 : linear >= 1 ? 1 : linear; /* colours of a file may be anything: no number is black */
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

/* Apart, for setjmp and locals do not mix well. */
static int write_rows(png_structp png, png_infop info, FILE *file, const view_canvas *canvas, unsigned char *row) {
  if (setjmp(png_jmpbuf(png))) {
    return -1;
  }
  png_init_io(png, file);
  png_set_IHDR(png, info, (png_uint_32)(canvas->width / 2), (png_uint_32)(canvas->height / 2), 8, PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  for (int y = 0; y < canvas->height / 2; y++) {
    view_canvas_row(canvas, y, row);
    png_write_row(png, row);
  }
  png_write_end(png, info);
  return 0;
}

int view_png_write(const char *path, const view_canvas *canvas, char *error, size_t error_size) {
  FILE *file = fopen(path, "wb");
  if (!file) {
    snprintf(error, error_size, "%s cannot be written: %s", path, strerror(errno));
    return -1;
  }
  unsigned char *row = malloc(3 * (size_t)canvas->width);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
  png_infop info = png ? png_create_info_struct(png) : NULL;
  int rc = row && info ? write_rows(png, info, file, canvas, row) : -1;
  png_destroy_write_struct(&png, &info);
  free(row);
  if (fclose(file) != 0 || rc != 0) {
    snprintf(error, error_size, "%s could not be written in full", path);
    return -1;
  }
  return 0;
}
