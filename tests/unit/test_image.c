/* Pictures: every kind of PNG by its definition, even without its last chunk, JPEGs of many scans, and cancellation. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <jpeglib.h>
#include <png.h>

#include "format/image.h"

enum { WIDTH = 13, HEIGHT = 7, SIDE = 24 };

static int setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
static int teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

/* A kind of PNG: what its pixels consist of. */
typedef struct kind {
  int color, depth, channels;
  int has_clear; /* a tRNS chunk */
} kind;

static const kind kinds[] = {
    {PNG_COLOR_TYPE_GRAY, 1, 1, 0},        {PNG_COLOR_TYPE_GRAY, 2, 1, 1},    {PNG_COLOR_TYPE_GRAY, 4, 1, 0},
    {PNG_COLOR_TYPE_GRAY, 8, 1, 1},        {PNG_COLOR_TYPE_GRAY, 16, 1, 0},   {PNG_COLOR_TYPE_GRAY_ALPHA, 8, 2, 0},
    {PNG_COLOR_TYPE_GRAY_ALPHA, 16, 2, 0}, {PNG_COLOR_TYPE_RGB, 8, 3, 0},     {PNG_COLOR_TYPE_RGB, 8, 3, 1},
    {PNG_COLOR_TYPE_RGB, 16, 3, 0},        {PNG_COLOR_TYPE_RGBA, 8, 4, 0},    {PNG_COLOR_TYPE_RGBA, 16, 4, 0},
    {PNG_COLOR_TYPE_PALETTE, 1, 1, 0},     {PNG_COLOR_TYPE_PALETTE, 2, 1, 1}, {PNG_COLOR_TYPE_PALETTE, 4, 1, 0},
    {PNG_COLOR_TYPE_PALETTE, 8, 1, 1},
};

static uint32_t random_of(uint32_t number) {
  number = (number ^ number >> 15) * 2246822519u;
  number = (number ^ number >> 13) * 3266489917u;
  return number ^ number >> 16;
}

/* The sample of a pixel. */
static uint32_t sample_of(const kind *k, int x, int y, int channel) {
  return random_of((uint32_t)(4 * (WIDTH * y + x) + channel)) & ((1u << k->depth) - 1);
}

static png_color palette_of(uint32_t i) {
  return (png_color){(png_byte)(37 * i), (png_byte)(91 * i + 5), (png_byte)(255 - i)};
}

static unsigned char clear_of(uint32_t i) {
  return (unsigned char)(i < 3 ? 60 * i : 255);
}

/* The pixel that the specification defines, in 8 bits per channel. */
static void pixel_of(const kind *k, int x, int y, unsigned char out[4]) {
  const double most = (1 << k->depth) - 1;
  int is_gray = k->channels < 3;
  if (k->color == PNG_COLOR_TYPE_PALETTE) {
    uint32_t i = sample_of(k, x, y, 0);
    png_color color = palette_of(i);
    out[0] = color.red;
    out[1] = color.green;
    out[2] = color.blue;
    out[3] = k->has_clear ? clear_of(i) : 255;
    return;
  }
  for (int c = 0; c < 3; c++) {
    out[c] = (unsigned char)(sample_of(k, x, y, is_gray ? 0 : c) * 255 / most + 0.5);
  }
  out[3] = 255;
  if (k->channels % 2 == 0) {
    out[3] = (unsigned char)(sample_of(k, x, y, k->channels - 1) * 255 / most + 0.5);
  } else if (k->has_clear) { /* the colour of the first pixel is clear */
    int same = 1;
    for (int c = 0; c < k->channels; c++) {
      same &= sample_of(k, x, y, c) == sample_of(k, 0, 0, c);
    }
    out[3] = same ? 0 : 255;
  }
}

typedef struct bytes {
  unsigned char *data;
  size_t size;
} bytes;

static void on_write(png_structp png, png_bytep data, size_t size) {
  bytes *out = png_get_io_ptr(png);
  out->data = realloc(out->data, out->size + size);
  assert_non_null(out->data);
  memcpy(out->data + out->size, data, size);
  out->size += size;
}

static void set_colors(png_structp png, png_infop info, const kind *k) {
  png_color palette[256];
  png_byte clear[256];
  png_color_16 first = {0, (png_uint_16)sample_of(k, 0, 0, 0), (png_uint_16)sample_of(k, 0, 0, 1),
                        (png_uint_16)sample_of(k, 0, 0, 2), (png_uint_16)sample_of(k, 0, 0, 0)};
  for (uint32_t i = 0; i < 256; i++) {
    palette[i] = palette_of(i);
    clear[i] = clear_of(i);
  }
  if (k->color == PNG_COLOR_TYPE_PALETTE) {
    png_set_PLTE(png, info, palette, 1 << k->depth);
  }
  if (k->has_clear) {
    int is_palette = k->color == PNG_COLOR_TYPE_PALETTE;
    png_set_tRNS(png, info, is_palette ? clear : NULL, is_palette ? 1 << k->depth : 0, is_palette ? NULL : &first);
  }
}

/* gamma: adds a chunk that declares linear colours, which glTF tells readers to ignore. */
static bytes write_png(const kind *k, int interlaced, int gamma) {
  bytes out = {0};
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
  png_infop info = png_create_info_struct(png);
  unsigned char rows[HEIGHT][8 * WIDTH], *list[HEIGHT];
  png_set_write_fn(png, &out, on_write, NULL);
  png_set_IHDR(png, info, WIDTH, HEIGHT, k->depth, k->color, interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  set_colors(png, info, k);
  if (gamma) {
    png_set_gAMA(png, info, 1.0);
  }
  for (int y = 0; y < HEIGHT; y++) {
    unsigned char *at = list[y] = rows[y];
    for (int i = 0; i < WIDTH * k->channels; i++) {
      uint32_t sample = sample_of(k, i / k->channels, y, i % k->channels);
      if (k->depth == 16) {
        *at++ = (unsigned char)(sample >> 8);
      }
      *at++ = (unsigned char)sample;
    }
  }
  png_set_rows(png, info, list);
  png_write_png(png, info, PNG_TRANSFORM_PACKING, NULL);
  png_destroy_write_struct(&png, &info);
  return out;
}

static void assert_shows(orb_context *ctx, const kind *k, const unsigned char *data, size_t size) {
  orb_pixels made;
  assert_int_equal(orb_image_decode(ctx, data, size, &made), ORB_OK);
  assert_true(made.width == WIDTH && made.height == HEIGHT);
  for (int p = 0; p < WIDTH * HEIGHT; p++) {
    unsigned char wanted[4];
    pixel_of(k, p % WIDTH, p / WIDTH, wanted);
    assert_memory_equal(made.rgba + (size_t)4 * (size_t)p, wanted, 4);
  }
  orb_free(ctx, made.rgba);
}

static void every_kind_of_png(void **state) {
  for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
    for (int way = 0; way < 4; way++) {
      bytes file = write_png(&kinds[i], way & 1, way & 2);
      assert_shows(*state, &kinds[i], file.data, file.size);
      free(file.data);
    }
  }
}

/* Other programs show a PNG whose last chunk is missing. A PNG whose pixels are missing has no picture. */
static void png_without_its_end(void **state) {
  enum { IEND = 12 }; /* bytes of the last chunk: length, name, checksum */
  for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
    for (int interlaced = 0; interlaced < 2; interlaced++) {
      bytes file = write_png(&kinds[i], interlaced, 0);
      assert_memory_equal(file.data + file.size - IEND + 4, "IEND", 4);
      assert_shows(*state, &kinds[i], file.data, file.size - IEND);
      orb_pixels made;
      assert_int_equal(orb_image_decode(*state, file.data, file.size - IEND - 12, &made), ORB_E_CORRUPT);
      assert_null(made.rgba);
      free(file.data);
    }
  }
}

/* A grey JPEG. scans: 0 for one that is not progressive; otherwise it has one scan for each of the 64 coefficients, and
 * this many more that refine the last bit of one. */
static bytes write_jpeg(int scans) {
  struct jpeg_compress_struct info = {0};
  struct jpeg_error_mgr errors;
  jpeg_scan_info script[128];
  int count = 0, refined = scans - 64;
  unsigned char *data = NULL;
  unsigned long size = 0;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  jpeg_mem_dest(&info, &data, &size);
  info.image_width = info.image_height = SIDE;
  info.input_components = 1;
  info.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&info);
  for (int k = 0; scans && k < 64; k++) {
    script[count++] = (jpeg_scan_info){1, {0}, k, k, 0, k >= 64 - refined};
  }
  for (int k = 64 - refined; scans && k < 64; k++) {
    script[count++] = (jpeg_scan_info){1, {0}, k, k, 1, 0};
  }
  if (scans) {
    info.scan_info = script;
    info.num_scans = count;
  }
  jpeg_start_compress(&info, TRUE);
  for (int y = 0; y < SIDE; y++) {
    unsigned char row[SIDE], *at = row;
    for (int x = 0; x < SIDE; x++) {
      row[x] = (unsigned char)random_of((uint32_t)(SIDE * y + x));
    }
    jpeg_write_scanlines(&info, &at, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  return (bytes){data, size};
}

/* The scans have the same coefficients, so they show the same picture; too many scans are refused. */
static void scans_have_a_limit(void **state) {
  orb_context *ctx = *state;
  bytes plain = write_jpeg(0);
  orb_pixels wanted, made;
  assert_int_equal(orb_image_decode(ctx, plain.data, plain.size, &wanted), ORB_OK);
  static const int fine[] = {64, 65, 100};
  for (int i = 0; i < 3; i++) {
    bytes file = write_jpeg(fine[i]);
    assert_int_equal(orb_image_decode(ctx, file.data, file.size, &made), ORB_OK);
    assert_memory_equal(made.rgba, wanted.rgba, (size_t)4 * SIDE * SIDE);
    orb_free(ctx, made.rgba);
    free(file.data);
  }
  static const int many[] = {101, 127};
  for (int i = 0; i < 2; i++) {
    bytes file = write_jpeg(many[i]);
    assert_int_equal(orb_image_decode(ctx, file.data, file.size, &made), ORB_E_CORRUPT);
    assert_null(made.rgba);
    free(file.data);
  }
  orb_free(ctx, wanted.rgba);
  free(plain.data);
}

/* A cancelled job says so, and does not say that its pictures are bad. */
static void cancelling_is_no_bad_picture(void **state) {
  orb_context *ctx = *state;
  bytes files[] = {write_png(&kinds[0], 0, 0), write_png(&kinds[11], 1, 0), write_jpeg(0), write_jpeg(64)};
  orb_pixels made, given = {1, 1, (unsigned char[]){1, 2, 3, 4}};
  orb_buffer out = {0};
  orb_context_cancel(ctx);
  for (int i = 0; i < 4; i++) {
    assert_int_equal(orb_image_decode(ctx, files[i].data, files[i].size, &made), ORB_E_CANCELLED);
    assert_null(made.rgba);
    free(files[i].data);
  }
  assert_int_equal(orb_png_encode(ctx, &given, 1, &out), ORB_E_CANCELLED);
  orb_buffer_free(ctx, &out);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(every_kind_of_png, setup, teardown),
      cmocka_unit_test_setup_teardown(png_without_its_end, setup, teardown),
      cmocka_unit_test_setup_teardown(scans_have_a_limit, setup, teardown),
      cmocka_unit_test_setup_teardown(cancelling_is_no_bad_picture, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
