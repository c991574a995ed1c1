#include "view_png.h"

#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A function of its own: longjmp leaves modified locals of the function that called setjmp indeterminate. */
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
    snprintf(error, error_size, "cannot write %s: %s", path, strerror(errno));
    return -1;
  }
  unsigned char *row = malloc(3 * (size_t)canvas->width);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
  png_infop info = png ? png_create_info_struct(png) : NULL;
  int rc = row && info ? write_rows(png, info, file, canvas, row) : -1;
  png_destroy_write_struct(&png, &info);
  free(row);
  if (fclose(file) != 0 || rc != 0) {
    snprintf(error, error_size, "cannot write all of %s", path);
    return -1;
  }
  return 0;
}
