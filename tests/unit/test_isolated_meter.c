/* What Draco's entropy coder takes for its tables counts in the budget of a job: 768 bytes for each byte of a file that
 * is made for that. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "isolate/meter.h"
#include "isolate/sandbox.h"
#include "orbmorph/format.h"

enum {
  LENGTH = 200000,        /* of the probabilities of symbols, in bytes */
  SYMBOLS = 64 * LENGTH,  /* a byte may stand for 64 symbols that do not occur */
  SYMBOL_BYTES = 12,      /* of Draco's table, for each */
  MOST = SYMBOLS / 2 * 12 /* bytes: half of the table */
};

typedef struct bytes {
  unsigned char *at;
  size_t size;
} bytes;

static void put(bytes *to, const void *from, size_t size) {
  memcpy(to->at + to->size, from, size);
  to->size += size;
}

static void put_number(bytes *to, uint32_t value) {
  put(to,
      (const unsigned char[]){(unsigned char)value, (unsigned char)(value >> 8), (unsigned char)(value >> 16),
                              (unsigned char)(value >> 24)},
      4);
}

/* A tetrahedron, by the method that lists faces. The values of its positions are said to be coded with so many symbols;
 * the table of their probabilities is not valid, but it is allocated before that is seen. */
static void put_draco(bytes *to) {
  static const unsigned char head[] = {'D',  'R', 'A', 'C', 'O', 2, 2, 1, 0, 0, 0, 4, 4, /* faces and vertices */
                                       1,                                                /* faces are not compressed: */
                                       0,    2,   1,   0,   1,   3, 1, 2, 3, 0, 3, 2,    /* their corners */
                                       1,                                                /* decoder of attributes, */
                                       1,    0,   5,   3,   0,   0, /* of positions that are integers */
                                       1,                           /* integers, */
                                       0xfe,                        /* not predicted, */
                                       1,    1,   18};              /* compressed by one table, of 18 bits */
  put(to, head, sizeof head);
  for (uint32_t symbols = SYMBOLS; symbols > 0; symbols >>= 7) {
    const unsigned char part = (unsigned char)((symbols & 127) | (symbols > 127 ? 128 : 0));
    put(to, &part, 1);
  }
  memset(to->at + to->size, 0xff, LENGTH);
  to->size += LENGTH;
  while (to->size % 4 > 0) {
    to->at[to->size++] = 0;
  }
}

static bytes write_glb(void) {
  static const char json[] =
      "{\"asset\":{\"version\":\"2.0\"},\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],"
      "\"buffers\":[{\"byteLength\":%8zu}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":%8zu}],"
      "\"accessors\":[{\"componentType\":5125,\"count\":12,\"type\":\"SCALAR\"},"
      "{\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"}],\"meshes\":[{\"primitives\":[{\"attributes\":"
      "{\"POSITION\":1},\"indices\":0,\"extensions\":{\"KHR_draco_mesh_compression\":{\"bufferView\":0,"
      "\"attributes\":{\"POSITION\":0}}}}]}],\"nodes\":[{\"mesh\":0}],\"scenes\":[{\"nodes\":[0]}]}";
  bytes draco = {malloc(LENGTH + 1024), 0}, glb = {malloc(LENGTH + 4096), 0};
  char text[1024];
  assert_true(draco.at && glb.at);
  put_draco(&draco);
  size_t length = (size_t)snprintf(text, sizeof text, json, draco.size, draco.size);
  for (; length % 4 > 0; length++) {
    text[length] = ' ';
  }
  put(&glb, "glTF", 4);
  put_number(&glb, 2);
  put_number(&glb, (uint32_t)(12 + 8 + length + 8 + draco.size));
  put_number(&glb, (uint32_t)length);
  put(&glb, "JSON", 4);
  put(&glb, text, length);
  put_number(&glb, (uint32_t)draco.size);
  put(&glb, "BIN", 4);
  put(&glb, draco.at, draco.size);
  free(draco.at);
  return glb;
}

/* Reads the file with this budget; returns the status, and the most that counted. */
static orb_status read_with(const bytes *glb, size_t budget, orb_meter_fn meter, size_t *peak) {
  orb_context *ctx;
  orb_mesh mesh;
  assert_int_equal(
      orb_context_create(&(orb_context_options){.memory_limit = budget, .threads = 1, .meter = meter}, &ctx), ORB_OK);
  const orb_status status = orb_mesh_read(ctx, glb->at, glb->size, ORB_FORMAT_GLB, &mesh, NULL);
  print_message("status %d, %.1f MB of %.1f: %s\n", (int)status, (double)orb_memory_peak(ctx) / 1e6,
                (double)budget / 1e6, orb_context_error(ctx)->detail);
  *peak = orb_memory_peak(ctx);
  assert_int_equal(orb_memory_used(ctx), 0); /* what was charged is given back */
  orb_context_destroy(ctx);
  return status;
}

static void test_tables_count(void **state) {
  (void)state;
  bytes glb = write_glb();
  size_t without, with, small;
  if (SANDBOX_SANITIZED) {
    free(glb.at);
    skip();
  }
  assert_int_equal(read_with(&glb, 1 << 30, NULL, &without), ORB_E_MALFORMED_MESH);
  assert_true(without < MOST); /* the file does what it is made for */
  assert_int_equal(read_with(&glb, 1 << 30, meter_set, &with), ORB_E_MALFORMED_MESH);
  assert_true(with >= (size_t)SYMBOLS * SYMBOL_BYTES);
  assert_int_equal(read_with(&glb, MOST, meter_set, &small), ORB_E_NO_MEMORY);
  free(glb.at);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_tables_count)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
