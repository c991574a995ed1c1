/* Textures of glTF files: valid pictures are kept, data that only begins like a picture is dropped, samplers have valid
 * values. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "format/texture.h"
#include "orbmorph/format.h"
#include "support_context.h"

/* A red pixel, by zlib. */
static const unsigned char PNG[] = {0x89, 'P',  'N',  'G',  0x0d, 0x0a, 0x1a, 0x0a, 0,   0,    0,    13,   'I',  'H',
                                    'D',  'R',  0,    0,    0,    1,    0,    0,    0,   1,    8,    2,    0,    0,
                                    0,    0x90, 0x77, 0x53, 0xde, 0,    0,    0,    12,  'I',  'D',  'A',  'T',  0x78,
                                    0x9c, 0x63, 0xf8, 0xcf, 0xc0, 0,    0,    3,    1,   1,    0,    0xc9, 0xfe, 0x92,
                                    0xef, 0,    0,    0,    0,    'I',  'E',  'N',  'D', 0xae, 0x42, 0x60, 0x82};
enum { PNG_IDAT = 33, PNG_IDAT_END = PNG_IDAT + 12 + 12 };

/* SOI, a comment, a baseline frame of 2×1 in grey, the start of a scan. */
static const unsigned char JPEG[] = {0xff, 0xd8, 0xff, 0xfe, 0, 4, 'h', 'i', 0xff, 0xff, 0xc0, 0,
                                     11,   8,    0,    1,    0, 2, 1,   1,   0x11, 0,    0xff, 0xda,
                                     0,    8,    1,    1,    0, 0, 63,  0,   0x2a, 0xff, 0xd9};
enum { JPEG_FRAME = 11, JPEG_SCAN_END = 32 };

static int type_is(const unsigned char *bytes, size_t size, const char *type) {
  const char *got = orb_image_type(bytes, size);
  return type ? got && strcmp(got, type) == 0 : !got;
}

/* The detected type after one byte was changed. */
static int changed_is(const unsigned char *bytes, size_t size, size_t at, unsigned char value, const char *type) {
  unsigned char copy[128];
  memcpy(copy, bytes, size);
  copy[at] = value;
  return type_is(copy, size, type);
}

static void test_png(void **state) {
  (void)state;
  for (size_t size = 0; size <= sizeof PNG; size++) {
    assert_true(type_is(PNG, size, size < PNG_IDAT_END ? NULL : "image/png"));
  }
  static const struct {
    size_t at;
    unsigned char value;
  } wrong[] = {{4, '\n'},
               {11, 12},
               {12, 'X'},
               {19, 0},
               {23, 0},
               {16, 0x80},
               {24, 3},
               {24, 4},
               {24, 0},
               {25, 1},
               {25, 7},
               {25, 3},
               {26, 1},
               {27, 1},
               {28, 2},
               {PNG_IDAT, 0x7f},
               {PNG_IDAT + 4, 'X'}};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    assert_true(changed_is(PNG, sizeof PNG, wrong[i].at, wrong[i].value, NULL));
  }
  assert_true(changed_is(PNG, sizeof PNG, 24, 16, "image/png"));
  /* gAMA must have four bytes; an unknown chunk may have any number */
  unsigned char more[sizeof PNG + 17];
  memcpy(more, PNG, PNG_IDAT);
  memcpy(more + PNG_IDAT, "\0\0\0\5gAMA\0\0\xb1\x8f\0crc.", 17);
  memcpy(more + PNG_IDAT + 17, PNG + PNG_IDAT, sizeof PNG - PNG_IDAT);
  assert_true(type_is(more, sizeof more, NULL));
  memcpy(more + PNG_IDAT + 4, "gAMb", 4);
  assert_true(type_is(more, sizeof more, "image/png"));
  unsigned char junk[64];
  memset(junk, 'j', sizeof junk);
  memcpy(junk, PNG, 8);
  assert_true(type_is(junk, sizeof junk, NULL));
}

static void test_jpeg(void **state) {
  (void)state;
  for (size_t size = 0; size <= sizeof JPEG; size++) {
    assert_true(type_is(JPEG, size, size < JPEG_SCAN_END ? NULL : "image/jpeg"));
  }
  static const struct {
    size_t at;
    unsigned char value;
  } wrong[] = {{2, 0},
               {3, 0xd9},
               {5, 1},
               {5, 200},
               {JPEG_FRAME - 1, 0xc3},
               {JPEG_FRAME + 1, 12},
               {JPEG_FRAME + 2, 12},
               {JPEG_FRAME + 4, 0},
               {JPEG_FRAME + 6, 0},
               {JPEG_FRAME + 7, 2},
               {23, 0xfe}};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    assert_true(changed_is(JPEG, sizeof JPEG, wrong[i].at, wrong[i].value, NULL));
  }
  assert_true(changed_is(JPEG, sizeof JPEG, JPEG_FRAME - 1, 0xc2, "image/jpeg"));
  unsigned char junk[64];
  memset(junk, 'j', sizeof junk);
  memcpy(junk, JPEG, 4);
  assert_true(type_is(junk, sizeof junk, NULL));
}

/* A copy of an image with a part inserted at `at`, and the image after it is stripped. */
static size_t stripped(const unsigned char *image, size_t size, size_t at, const char *part, size_t length,
                       unsigned char *out) {
  memcpy(out, image, at);
  memcpy(out + at, part, length);
  memcpy(out + at + length, image + at, size - at);
  assert_non_null(orb_image_type(out, size + length));
  return orb_image_strip(out, size + length);
}

/* Stripping removes colour chunks and keeps the others, and leaves an image without colour chunks unchanged. It does
 * not check the checksums of chunks. */
static void test_profiles_are_stripped(void **state) {
  (void)state;
  static const struct {
    const char *bytes;
    size_t length;
    int stays;
  } chunks[] = {{"\0\0\0\1sRGB\0crc.", 13, 0},
                {"\0\0\0\4gAMA\0\0\xb1\x8f"
                 "crc.",
                 16, 0},
                {"\0\0\0\40cHRM01234567890123456789012345678901crc.", 44, 0},
                {"\0\0\0\5iCCPname\0crc.", 17, 0},
                {"\0\0\0\11pHYs\0\0\0\1\0\0\0\2\1crc.", 21, 0},
                {"\0\0\0\11pHYs\0\0\0\2\0\0\0\2\1crc.", 21, 1},
                {"\0\0\0\4tEXtabcdcrc.", 16, 1}};
  unsigned char out[sizeof PNG + sizeof JPEG + 64];
  for (size_t i = 0; i < sizeof chunks / sizeof *chunks; i++) {
    size_t size = stripped(PNG, sizeof PNG, PNG_IDAT, chunks[i].bytes, chunks[i].length, out);
    assert_int_equal(size, sizeof PNG + (chunks[i].stays ? chunks[i].length : 0));
    if (chunks[i].stays) {
      assert_memory_equal(out + PNG_IDAT, chunks[i].bytes, chunks[i].length);
    } else {
      assert_memory_equal(out, PNG, sizeof PNG);
    }
  }
  assert_int_equal(stripped(PNG, sizeof PNG, 0, "", 0, out), sizeof PNG);
  assert_int_equal(stripped(JPEG, sizeof JPEG, 2, "\xff\xe2\0\20ICC_PROFILE\0\1\1", 18, out), sizeof JPEG);
  assert_memory_equal(out, JPEG, sizeof JPEG);
  assert_int_equal(stripped(JPEG, sizeof JPEG, 2, "\xff\xee\0\16Adobe\0d\0\0\0\0\1", 16, out), sizeof JPEG + 16);
  assert_int_equal(stripped(JPEG, sizeof JPEG, 2, "\xff\xff\xe2\0\6MPF\0", 9, out), sizeof JPEG + 1); /* fill stays */
}

static void base64(const unsigned char *bytes, size_t size, char *out) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < size; i += 3) {
    unsigned v = (unsigned)bytes[i] << 16 | (i + 1 < size ? (unsigned)bytes[i + 1] << 8 : 0) |
                 (i + 2 < size ? (unsigned)bytes[i + 2] : 0);
    *out++ = digits[v >> 18];
    *out++ = digits[v >> 12 & 63];
    *out++ = i + 1 < size ? digits[v >> 6 & 63] : '=';
    *out++ = i + 2 < size ? digits[v & 63] : '=';
  }
  *out = 0;
}

/* A triangle with a texture: the mesh read from it. */
static void read_textured(const unsigned char *image, size_t size, const char *sampler, orb_mesh *mesh) {
  static const float places[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  unsigned char raw[sizeof places];
  memcpy(raw, places, sizeof raw);
  char text[2048], places_text[128], image_text[256];
  base64(raw, sizeof raw, places_text);
  base64(image, size, image_text);
  int length = snprintf(
      text, sizeof text,
      "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0}]}"
      "],"
      "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],\"bufferViews\":[{"
      "\"buffer\":0,\"byteLength\":36}],\"buffers\":[{\"byteLength\":36,\"uri\":\"data:;base64,%s\"}],\"materials\":[{"
      "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],\"textures\":[{\"source\":0,\"sampler\":0}],"
      "\"samplers\":[%s],\"images\":[{\"uri\":\"data:image/png;base64,%s\"}]}",
      places_text, sampler, image_text);
  assert_in_range(length, 1, sizeof text - 1);
  if (orb_mesh_read(ctx, (unsigned char *)text, (size_t)length, ORB_FORMAT_AUTO, mesh, NULL) != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
}

static void test_junk_is_left_out(void **state) {
  (void)state;
  orb_mesh mesh;
  read_textured(PNG, sizeof PNG, "{}", &mesh);
  assert_int_equal(mesh.image_count, 1);
  assert_int_equal(mesh.materials[0].base_texture.image, 0);
  assert_memory_equal(mesh.images[0].bytes, PNG, sizeof PNG);
  assert_string_equal(mesh.images[0].mime, "image/png");
  orb_mesh_free(ctx, &mesh);
  read_textured(JPEG, sizeof JPEG, "{}", &mesh);
  assert_string_equal(mesh.images[0].mime, "image/jpeg"); /* whatever type the file states */
  orb_mesh_free(ctx, &mesh);
  read_textured(PNG, PNG_IDAT, "{}", &mesh);
  assert_int_equal(mesh.image_count, 0);
  assert_int_equal(mesh.material_count, 1);
  assert_int_equal(mesh.materials[0].base_texture.image, -1);
  orb_mesh_free(ctx, &mesh);
}

static void test_samplers(void **state) {
  (void)state;
  orb_mesh mesh;
  read_textured(PNG, sizeof PNG, "{\"wrapS\":33071,\"wrapT\":33648,\"magFilter\":9728,\"minFilter\":9987}", &mesh);
  assert_int_equal(mesh.materials[0].base_texture.wrap_s, 33071);
  assert_int_equal(mesh.materials[0].base_texture.wrap_t, 33648);
  assert_int_equal(mesh.materials[0].base_texture.mag_filter, 9728);
  assert_int_equal(mesh.materials[0].base_texture.min_filter, 9987);
  orb_mesh_free(ctx, &mesh);
  /* 98607 is 33071 + 65536; a filter with mipmaps is not valid for magnification */
  read_textured(PNG, sizeof PNG, "{\"wrapS\":5,\"wrapT\":98607,\"magFilter\":9984,\"minFilter\":77}", &mesh);
  assert_int_equal(mesh.image_count, 1);
  assert_int_equal(mesh.materials[0].base_texture.wrap_s, 0);
  assert_int_equal(mesh.materials[0].base_texture.wrap_t, 0);
  assert_int_equal(mesh.materials[0].base_texture.mag_filter, 0);
  assert_int_equal(mesh.materials[0].base_texture.min_filter, 0);
  orb_mesh_free(ctx, &mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_png), cmocka_unit_test(test_jpeg),
                                     cmocka_unit_test(test_profiles_are_stripped),
                                     cmocka_unit_test(test_junk_is_left_out), cmocka_unit_test(test_samplers)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
