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

/* What a PNG is read from. */
typedef struct png_source {
  orb_context *ctx;
  const unsigned char *bytes;
  size_t left;
  orb_status status; /* of a check for cancellation */
} png_source;

/* The library asks for a few KiB at a time, so this is also where cancellation is noticed. */
static void on_png_read(png_structp png, png_bytep out, size_t size) {
  png_source *source = png_get_io_ptr(png);
  source->status = orb_context_check(source->ctx);
  if (source->status != ORB_OK || size > source->left) {
    png_error(png, "cancelled, or cut short");
  }
  memcpy(out, source->bytes, size);
  source->bytes += size;
  source->left -= size;
}

static void on_png_message(png_structp png, png_const_charp text) {
  (void)png;
  (void)text;
}

static void on_png_error(png_structp png, png_const_charp text) {
  (void)text;
  png_longjmp(png, 1);
}

/* Every kind of PNG as 8 bits of red, green, blue and alpha. */
static int expand_png(png_structp png, png_infop info) {
  png_set_scale_16(png);
  png_set_expand(png);
  png_set_gray_to_rgb(png);
  png_set_add_alpha(png, 255, PNG_FILLER_AFTER);
  int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  return passes;
}

/* A function of its own: see jpeg_rows(). */
static orb_status png_rows(orb_context *ctx, png_structp png, png_infop info, png_source *source, orb_pixels *out) {
  if (setjmp(png_jmpbuf(png))) {
    return source->status != ORB_OK ? source->status : unreadable(ctx);
  }
  png_set_benign_errors(png, 1);
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, NULL, -1); /* texts, profiles, facts about colours */
  png_set_read_fn(png, source, on_png_read);
  png_read_info(png, info);
  ORB_TRY(allocate(ctx, png_get_image_width(png, info), png_get_image_height(png, info), out));
  for (int pass = expand_png(png, info); pass > 0; pass--) {
    ORB_ASSERT(png_get_rowbytes(png, info) == 4 * (size_t)out->width);
    for (size_t y = 0; y < (size_t)out->height; y++) {
      png_read_row(png, out->rgba + 4 * (size_t)out->width * y, NULL);
    }
  }
  return ORB_OK; /* whatever follows the last row does not matter, as to other programs */
}

static orb_status decode_png(orb_context *ctx, const unsigned char *bytes, size_t size, orb_pixels *out) {
  png_source source = {ctx, bytes, size, ORB_OK};
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, on_png_error, on_png_message);
  png_infop info = png ? png_create_info_struct(png) : NULL;
  orb_status status = info ? png_rows(ctx, png, info, &source, out) : ORB_E_NO_MEMORY;
  png_destroy_read_struct(&png, &info, NULL);
  return status;
}

/* Scans of a progressive picture, each of which takes as long as a whole one: programs write about ten. */
enum { SCANS_MOST = 100 };

typedef struct jpeg_failure {
  struct jpeg_error_mgr manager;
  struct jpeg_progress_mgr progress;
  jmp_buf back;
  orb_context *ctx;
  orb_status status; /* of a check for cancellation */
} jpeg_failure;

static void on_jpeg_error(j_common_ptr info) {
  longjmp(((jpeg_failure *)info->err)->back, 1);
}

static void on_jpeg_message(j_common_ptr info) {
  (void)info;
}

/* The library calls it for each row of blocks of each scan. */
static void on_jpeg_progress(j_common_ptr info) {
  jpeg_failure *failure = (jpeg_failure *)info->err;
  failure->status = orb_context_check(failure->ctx);
  if (failure->status != ORB_OK || ((j_decompress_ptr)info)->input_scan_number > SCANS_MOST) {
    longjmp(failure->back, 1);
  }
}

/* From three bytes per pixel to four, in place. */
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
    return failure->status != ORB_OK ? failure->status : unreadable(ctx);
  }
  jpeg_create_decompress(info);
  info->progress = &failure->progress;
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
  jpeg_failure failure = {.progress.progress_monitor = on_jpeg_progress, .ctx = ctx};
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

/* row: room for a row without alpha. */
static void write_rows(png_structp png, png_sink *sink, const orb_pixels *pixels, int has_alpha, unsigned char *row) {
  size_t width = (size_t)pixels->width;
  for (size_t y = 0; y < (size_t)pixels->height; y++) {
    sink->status = orb_context_check(sink->ctx);
    if (sink->status != ORB_OK) {
      png_error(png, "cancelled");
    }
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
  write_rows(png, sink, pixels, has_alpha, row);
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
