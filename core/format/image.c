#include "format/image.h"

/* jpeglib.h needs stdio.h before it. */
#include <stdio.h>

#include <jpeglib.h>
#include <png.h>
#include <setjmp.h>
#include <string.h>

#include "base/buffer.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

static orb_status unreadable(orb_context *ctx) {
  return orb_fail(ctx, ORB_E_CORRUPT, "The image cannot be read as PNG or JPEG.");
}

static orb_status allocate(orb_context *ctx, size_t width, size_t height, orb_pixels *out) {
  if (width == 0 || height == 0 || width > ORB_IMAGE_SIDE_MAX || height > ORB_IMAGE_SIDE_MAX) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The image has %zu × %zu pixels; at most %d a side are read.", width, height,
                    (int)ORB_IMAGE_SIDE_MAX);
  }
  out->width = (int32_t)width;
  out->height = (int32_t)height;
  out->rgba = orb_alloc(ctx, width * height, 4);
  return out->rgba ? ORB_OK : ORB_E_NO_MEMORY;
}

static orb_status decode_png(orb_context *ctx, const unsigned char *bytes, size_t size, orb_pixels *out) {
  png_image image = {.version = PNG_IMAGE_VERSION};
  if (!png_image_begin_read_from_memory(&image, bytes, size)) {
    return unreadable(ctx);
  }
  image.format = PNG_FORMAT_RGBA;
  image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  orb_status status = allocate(ctx, image.width, image.height, out);
  if (status == ORB_OK && !png_image_finish_read(&image, NULL, out->rgba, 0, NULL)) {
    status = unreadable(ctx);
  }
  png_image_free(&image);
  return status;
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

/* From three bytes a pixel to four, in place. */
static void widen_row(unsigned char *row, size_t width) {
  for (size_t x = width; x-- > 0;) {
    unsigned char rgb[3];
    memcpy(rgb, row + 3 * x, sizeof rgb);
    memcpy(row + 4 * x, rgb, sizeof rgb);
    row[4 * x + 3] = 255;
  }
}

/* A function of its own: longjmp leaves modified locals of the function that called setjmp indeterminate. *held: stands
 * for what the library takes for a progressive picture, two bytes for each of three values a pixel. */
static orb_status jpeg_rows(orb_context *ctx, struct jpeg_decompress_struct *info, jpeg_failure *failure,
                            const unsigned char *bytes, size_t size, orb_pixels *out, void **held) {
  if (setjmp(failure->back)) {
    return unreadable(ctx);
  }
  jpeg_create_decompress(info);
  jpeg_mem_src(info, bytes, (unsigned long)size);
  jpeg_read_header(info, TRUE);
  info->out_color_space = JCS_RGB;
  ORB_TRY(allocate(ctx, info->image_width, info->image_height, out));
  *held = orb_alloc(ctx, (size_t)info->image_width * info->image_height, 6);
  if (!*held) {
    return ORB_E_NO_MEMORY;
  }
  jpeg_start_decompress(info);
  while (info->output_scanline < info->output_height) {
    JSAMPROW row = out->rgba + 4 * (size_t)info->output_width * info->output_scanline;
    jpeg_read_scanlines(info, &row, 1);
    widen_row(row, info->output_width);
  }
  jpeg_finish_decompress(info);
  return ORB_OK;
}

static orb_status decode_jpeg(orb_context *ctx, const unsigned char *bytes, size_t size, orb_pixels *out) {
  struct jpeg_decompress_struct info = {0};
  jpeg_failure failure;
  void *held = NULL;
  info.err = jpeg_std_error(&failure.manager);
  failure.manager.error_exit = on_jpeg_error;
  failure.manager.output_message = on_jpeg_message;
  orb_status status = jpeg_rows(ctx, &info, &failure, bytes, size, out, &held);
  jpeg_destroy_decompress(&info);
  orb_free(ctx, held);
  return status;
}

orb_status orb_image_decode(orb_context *ctx, const unsigned char *bytes, size_t size, orb_pixels *out) {
  memset(out, 0, sizeof *out);
  orb_status status = size > 8 && memcmp(bytes, "\x89PNG", 4) == 0    ? decode_png(ctx, bytes, size, out)
                      : size > 3 && memcmp(bytes, "\xff\xd8", 2) == 0 ? decode_jpeg(ctx, bytes, size, out)
                                                                      : unreadable(ctx);
  if (status != ORB_OK) {
    orb_free(ctx, out->rgba);
    memset(out, 0, sizeof *out);
  }
  return status;
}

typedef struct png_sink {
  orb_context *ctx;
  orb_buffer *out;
  orb_status status;
} png_sink;

static void on_png_write(png_structp png, png_bytep bytes, size_t size) {
  png_sink *sink = png_get_io_ptr(png);
  sink->status = orb_buffer_append(sink->ctx, sink->out, bytes, size);
  if (sink->status != ORB_OK) {
    png_error(png, "no memory");
  }
}

static void on_png_flush(png_structp png) {
  (void)png;
}

static void on_png_message(png_structp png, png_const_charp text) {
  (void)png;
  (void)text;
}

static void on_png_error(png_structp png, png_const_charp text) {
  (void)text;
  png_longjmp(png, 1);
}

/* row: room for a row without alpha. */
static void write_rows(png_structp png, const orb_pixels *pixels, int has_alpha, unsigned char *row) {
  size_t width = (size_t)pixels->width;
  for (size_t y = 0; y < (size_t)pixels->height; y++) {
    const unsigned char *from = pixels->rgba + 4 * width * y;
    for (size_t x = 0; !has_alpha && x < width; x++) {
      memcpy(row + 3 * x, from + 4 * x, 3);
    }
    png_write_row(png, has_alpha ? from : row);
  }
}

static int write_png(png_structp png, png_infop info, png_sink *sink, const orb_pixels *pixels, int has_alpha,
                     unsigned char *row) {
  if (setjmp(png_jmpbuf(png))) {
    return 0;
  }
  png_set_write_fn(png, sink, on_png_write, on_png_flush);
  png_set_IHDR(png, info, (png_uint_32)pixels->width, (png_uint_32)pixels->height, 8,
               has_alpha ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  write_rows(png, pixels, has_alpha, row);
  png_write_end(png, NULL);
  return 1;
}

orb_status orb_png_encode(orb_context *ctx, const orb_pixels *pixels, int has_alpha, orb_buffer *out) {
  png_sink sink = {ctx, out, ORB_OK};
  unsigned char *row = orb_alloc(ctx, (size_t)pixels->width, 3);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, on_png_error, on_png_message);
  png_infop info = png ? png_create_info_struct(png) : NULL;
  orb_status status = ORB_OK;
  if (!row || !info || !write_png(png, info, &sink, pixels, has_alpha, row)) {
    status = sink.status != ORB_OK ? sink.status : ORB_E_NO_MEMORY;
  }
  png_destroy_write_struct(&png, &info);
  orb_free(ctx, row);
  return status;
}
