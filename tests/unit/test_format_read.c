/* The readers on small files written by hand: every dialect, every prefix, and random damage. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "format/number.h"
#include "orbmorph/format.h"
#include "support_context.h"

static orb_status read_bytes(const void *bytes, size_t size, orb_mesh *mesh) {
  return orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, mesh, NULL);
}

/* Every reader must make the tetrahedron (0,0,0) (1,0,0) (0,1,0) (0,0,1) of these files: volume 1/6. */
static void check_tetrahedron(const void *bytes, size_t size) {
  orb_mesh mesh;
  orb_extent extent;
  orb_status status = read_bytes(bytes, size, &mesh);
  if (status != ORB_OK) {
    fail_msg("%s in %.60s", orb_context_error(ctx)->detail, (const char *)bytes);
  }
  assert_int_equal(mesh.triangle_count, 4);
  assert_int_equal(orb_mesh_repair(ctx, &mesh, ORB_REPAIR_SAFE), ORB_OK);
  orb_mesh_extent(&mesh, &extent);
  assert_int_equal(mesh.vertex_count, 4);
  assert_true(fabs(extent.volume - 1.0 / 6) < 1e-15);
  assert_true(fabs(extent.area - (1.5 + sqrt(3) / 2)) < 1e-15);
  orb_mesh_free(ctx, &mesh);
}

static const char *const TEXTS[] = {
    /* OBJ */
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "# c\r\nv 0. .0 +0e5\r\nv 1e0 0 0\r\nv 0 1d0 0\r\nv 0 0 10E-1\r\nf -4 -2 -3\r\nf -4 -3 -1\r\nf -4 -1 -2 # x\r\nf "
    "-3 \\\r\n-2 -1",
    "o a\ng b c\ns off\nmtllib x.mtl\nvt 0 0\nvn 0 0 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1/1/1 3/1/1 "
    "2/1/1\nf 1//1 2//1 4//1\nusemtl blue paint\nf 1/1 4/1 3/1\nf 2 3 4\nl 1 2\n",
    "f 1 3 2\nf 1 2 4\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0 0 1 1 1 1\nf 1 4 3\nf 2 3 4\n",
    /* OFF */
    "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
    "OFF 4 4 6\n# comment\n0 0 0\n1 0 0 # more\n\n0 1 0\n0 0 1\n3 0 2 1 255 0 0\n3 0 1 3\n3 0 3 2\n3 1 2 3",
    "# first\nCOFF\n4 4\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n0 0 1 9 9 9 255\n3 0 2 1\n3 0 1 3\n3 "
    "0 "
    "3 2\n3 1 2 3\n",
    "NOFF\n4 4 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n0 0 1 0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
    "STOFF\n4 4 0\n0 0 0 0 1\n1 0 0 0 1\n0 1 0 0 1\n0 0 1 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
    "4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n2 0 1\n",
    /* PLY */
    "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty double x\nproperty uchar red\nproperty float y\n"
    "property int z\nproperty list uchar int more\nproperty uchar green\nproperty uchar blue\nelement nothing 1\n"
    "property int a\nelement face 4\nproperty uchar flags\nproperty list uchar int vertex_index\nend_header\n"
    "0 9 0 0 2 7 7 1 1\n1 9 0 0 0 1 1\n0 9 1 0 0 1 1\n0 9 0 1 0 1 1\n5\n0 3 0 2 1\n0 3 0 1 3\n0 3 0 3 2\n0 3 1 2 3\n",
    "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
    "element tristrips 1\r\nproperty list int int vertex_indices\r\nend_header\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 "
    "1\r\n10 0 2 1 3 -1 0 3 2 -1 -1\r\n",
    /* STL */
    "solid a b\nfacet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n"
    "FACET NORMAL 0 -1 0\nouter loop\nvertex 0 -0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\nfacet normal 0 0 "
    "0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\nfacet normal 1 1 1\nouter loop\n"
    "vertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid a b\n",
    /* glTF: float positions, byte indices */
    "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\"meshes\":[{"
    "\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],\"accessors\":[{\"bufferView\":0,"
    "\"componentType\":5121,\"count\":4,\"type\":\"VEC3\"},{\"bufferView\":1,\"componentType\":5121,\"count\":12,"
    "\"type\":\"SCALAR\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":12},{\"buffer\":0,\"byteOffset\":12,"
    "\"byteLength\":12}],\"buffers\":[{\"byteLength\":24,\"uri\":\"data:application/octet-stream;base64,"
    "AAAAAQAAAAEAAAABAAIBAAEDAAMCAQID\"}]}",
};
enum { TEXT_COUNT = sizeof TEXTS / sizeof *TEXTS };

static void test_texts(void **state) {
  (void)state;
  for (int i = 0; i < TEXT_COUNT; i++) {
    if (strstr(TEXTS[i], "tristrips")) {
      orb_mesh mesh;
      assert_int_equal(read_bytes(TEXTS[i], strlen(TEXTS[i]), &mesh), ORB_OK);
      assert_int_equal(mesh.triangle_count, 3); /* 0 2 1, 1 2 3, 0 3 2 */
      static const int32_t want[9] = {0, 2, 1, 1, 2, 3, 0, 3, 2};
      assert_memory_equal(mesh.triangles, want, sizeof want);
      orb_mesh_free(ctx, &mesh);
    } else {
      check_tetrahedron(TEXTS[i], strlen(TEXTS[i]));
    }
  }
}

static const float PLACE[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const unsigned char FACE[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

static unsigned char *put_number(unsigned char *p, const void *value, size_t size, int big) {
  for (size_t i = 0; i < size; i++) {
    p[i] = ((const unsigned char *)value)[big ? size - 1 - i : i]; /* the tests run on little-endian machines */
  }
  return p + size;
}

static size_t binary_ply(unsigned char *out, int big) {
  unsigned char *p = out + sprintf((char *)out,
                                   "ply\nformat binary_%s_endian 1.0\nelement vertex 4\nproperty double x\nproperty "
                                   "short skip\nproperty float y\nproperty int8 z\nelement face 4\nproperty list "
                                   "uint16 uint vertex_indices\nproperty list uchar float texcoord\nend_header\n",
                                   big ? "big" : "little");
  for (int v = 0; v < 4; v++) {
    double x = (double)PLACE[v][0];
    short skip = 7;
    p = put_number(p, &x, 8, big);
    p = put_number(p, &skip, 2, big);
    p = put_number(p, &PLACE[v][1], 4, big);
    *p++ = (unsigned char)PLACE[v][2];
  }
  for (int f = 0; f < 4; f++) {
    uint16_t three = 3;
    p = put_number(p, &three, 2, big);
    for (int k = 0; k < 3; k++) {
      uint32_t index = FACE[f][k];
      p = put_number(p, &index, 4, big);
    }
    *p++ = 1;
    p = put_number(p, &PLACE[1][0], 4, big);
  }
  return (size_t)(p - out);
}

static size_t binary_stl(unsigned char *out) {
  memset(out, ' ', 80);
  memcpy(out, "solid but binary", 16);
  unsigned char *p = out + 80;
  uint32_t count = 4;
  p = put_number(p, &count, 4, 0);
  for (int f = 0; f < 4; f++) {
    memset(p, 0, 12);
    p += 12;
    for (int k = 0; k < 9; k++) {
      p = put_number(p, &PLACE[FACE[f][k / 3]][k % 3], 4, 0);
    }
    *p++ = 0;
    *p++ = 0;
  }
  return (size_t)(p - out);
}

static size_t binary_off(unsigned char *out) {
  unsigned char *p = out + sprintf((char *)out, "OFF BINARY\n");
  int32_t counts[3] = {4, 4, 0}, three = 3, none = 0;
  for (int i = 0; i < 3; i++) {
    p = put_number(p, &counts[i], 4, 1);
  }
  for (int i = 0; i < 12; i++) {
    p = put_number(p, &PLACE[i / 3][i % 3], 4, 1);
  }
  for (int f = 0; f < 4; f++) {
    p = put_number(p, &three, 4, 1);
    for (int k = 0; k < 3; k++) {
      int32_t index = FACE[f][k];
      p = put_number(p, &index, 4, 1);
    }
    p = put_number(p, &none, 4, 1);
  }
  return (size_t)(p - out);
}

/* Two nested nodes whose rotation by 90° around z, scale and translation cancel out: the tetrahedron again, as a strip
 * of five. */
static size_t binary_glb(unsigned char *out) {
  static const char text[] =
      "{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[1]}],\"nodes\":[{\"mesh\":0,\"rotation\":[0,0,"
      "0.7071067811865476,0.7071067811865476],\"scale\":[2,2,2]},{\"children\":[0],\"matrix\":[0,-0.5,0,0,0.5,0,0,0,0,"
      "0,"
      "0.5,0,1,2,3,1]}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],"
      "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"sparse\":{\"count\":1,"
      "\"indices\":{\"bufferView\":2,\"componentType\":5121},\"values\":{\"bufferView\":3}}},{\"bufferView\":1,"
      "\"componentType\":5123,\"count\":12,\"type\":\"SCALAR\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":48},{"
      "\"buffer\":0,\"byteOffset\":48,\"byteLength\":24},{\"buffer\":0,\"byteOffset\":72,\"byteLength\":1},{\"buffer\":"
      "0,"
      "\"byteOffset\":76,\"byteLength\":12}],\"buffers\":[{\"byteLength\":88}]}";
  size_t length = sizeof text - 1, padded = (length + 3) / 4 * 4;
  memset(out, 0, 20 + padded + 8 + 88);
  uint32_t head[5] = {0x46546c67, 2, (uint32_t)(20 + padded + 8 + 88), (uint32_t)padded, 0x4e4f534a};
  memcpy(out, head, sizeof head);
  memset(out + 20, ' ', padded);
  memcpy(out + 20, text, length);
  uint32_t chunk[2] = {88, 0x004e4942};
  unsigned char *p = out + 20 + padded;
  memcpy(p, chunk, sizeof chunk);
  p += 8;
  memcpy(p, PLACE, 48);
  memset(p + 36, 0x40, 12); /* the last vertex is wrong … */
  for (int i = 0; i < 12; i++) {
    p[48 + 2 * i] = FACE[i / 3][i % 3];
  }
  p[72] = 3; /* … and corrected by the sparse part */
  memcpy(p + 76, PLACE[3], 12);
  return (size_t)(p + 88 - out);
}

static unsigned char binary[5][4096];
static size_t binary_size[5];
static void make_binaries(void) {
  binary_size[0] = binary_ply(binary[0], 0);
  binary_size[1] = binary_ply(binary[1], 1);
  binary_size[2] = binary_stl(binary[2]);
  binary_size[3] = binary_off(binary[3]);
  binary_size[4] = binary_glb(binary[4]);
}

static void test_binaries(void **state) {
  (void)state;
  make_binaries();
  for (int i = 0; i < 5; i++) {
    check_tetrahedron(binary[i], binary_size[i]);
  }
  orb_mesh mesh;
  assert_int_equal(read_bytes(binary[4], binary_size[4], &mesh), ORB_OK);
  for (int i = 0; i < 12; i++) { /* translated by (1, 2, 3); rotations and scales cancel out */
    assert_true(fabs(mesh.positions[i] - ((double)PLACE[i / 3][i % 3] + 1 + i % 3)) < 1e-12);
  }
  orb_mesh_free(ctx, &mesh);
}

/* A damaged file gives a mesh or an error with its position, and nothing leaks. */
static void try_damaged(const unsigned char *bytes, size_t size) {
  unsigned char *copy = malloc(size ? size : 1); /* a sanitizer then sees a read past the end */
  memcpy(copy, bytes, size);
  orb_mesh mesh;
  orb_status status = read_bytes(copy, size, &mesh);
  const orb_error *error = orb_context_error(ctx);
  if (status == ORB_OK) {
    (void)!orb_mesh_repair(ctx, &mesh, ORB_REPAIR_FILL_HOLES | ORB_REPAIR_LARGEST_COMPONENT);
    orb_mesh_free(ctx, &mesh);
  } else if (status == ORB_E_MALFORMED_MESH) {
    assert_true(error->line > 0 || (error->offset >= 0 && error->offset <= (int64_t)size));
  } else {
    assert_true(status == ORB_E_UNKNOWN_FORMAT || status == ORB_E_NOT_FINITE || status == ORB_E_TOO_LARGE);
  }
  assert_int_equal(orb_memory_used(ctx), 0);
  free(copy);
}

static void test_prefixes(void **state) {
  (void)state;
  make_binaries();
  for (int i = 0; i < TEXT_COUNT + 5; i++) {
    const unsigned char *bytes = i < TEXT_COUNT ? (const unsigned char *)TEXTS[i] : binary[i - TEXT_COUNT];
    size_t size = i < TEXT_COUNT ? strlen(TEXTS[i]) : binary_size[i - TEXT_COUNT];
    for (size_t length = 0; length < size; length++) {
      try_damaged(bytes, length);
    }
  }
}

static void test_mutations(void **state) {
  (void)state;
  make_binaries();
  uint64_t seed = 88172645463325252ull;
  for (int round = 0; round < 20000; round++) {
    int i = round % (TEXT_COUNT + 5);
    const unsigned char *bytes = i < TEXT_COUNT ? (const unsigned char *)TEXTS[i] : binary[i - TEXT_COUNT];
    size_t size = i < TEXT_COUNT ? strlen(TEXTS[i]) : binary_size[i - TEXT_COUNT];
    unsigned char damaged[4096];
    memcpy(damaged, bytes, size);
    for (int k = 0; k < 1 + round % 5; k++) {
      seed ^= seed << 13; /* Marsaglia's xorshift */
      seed ^= seed >> 7;
      seed ^= seed << 17;
      damaged[seed % size] = k % 2 ? (unsigned char)(seed >> 40) : (unsigned char)"0123456789-./\n e"[seed >> 60];
    }
    try_damaged(damaged, size);
  }
}

static void expect_error(const char *text, orb_status want, int64_t line) {
  orb_mesh mesh;
  assert_int_equal(read_bytes(text, strlen(text), &mesh), want);
  assert_int_equal(orb_context_error(ctx)->line, line);
}

static void test_errors(void **state) {
  (void)state;
  expect_error("v 0 0 0\nv 1 0 x\n", ORB_E_MALFORMED_MESH, 2);
  expect_error("v 0 0 0\nv 1 0 0\n\nf 1 2 3\n", ORB_E_MALFORMED_MESH, 4);
  expect_error("v 0 0 0\nf 1 0 1\n", ORB_E_MALFORMED_MESH, 2);
  expect_error("v 0 0 0\nv 1 0 0\nv 0 1 0\n", ORB_E_MALFORMED_MESH, 4); /* no faces: the end of the file */
  expect_error("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ORB_E_NOT_FINITE, -1);
  expect_error("v 0 0 0\nv 1.001e30 0 0\nv 0 1 0\nf 1 2 3\n", ORB_E_NOT_FINITE, -1);
  assert_int_equal(orb_context_error(ctx)->vertices[0], 1);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "scale the mesh down"));
  expect_error("4OFF\n1 1 1\n", ORB_E_MALFORMED_MESH, 1);
  expect_error("OFF\n4 4 6\n0 0 0\n1 0 0", ORB_E_MALFORMED_MESH, 4);
  expect_error("nonsense bytes", ORB_E_UNKNOWN_FORMAT, -1);
  orb_mesh mesh;
  assert_int_equal(read_bytes("", 0, &mesh), ORB_E_MALFORMED_MESH);
  assert_int_equal(orb_context_error(ctx)->offset, 0);
  const char *far = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":4,\"uri\":\"x.bin\"}]}";
  assert_int_equal(read_bytes(far, strlen(far), &mesh), ORB_E_MALFORMED_MESH);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "another file"));
}

/* The tetrahedron of legs `scale` with its right angle at (far, far, far). */
static orb_status repair_tetrahedron(double scale, double far) {
  static const double at[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  char text[1024];
  int length = 0;
  for (int v = 0; v < 4; v++) {
    length += sprintf(text + length, "v %.17g %.17g %.17g\n", far + scale * at[v][0], far + scale * at[v][1],
                      far + scale * at[v][2]);
  }
  length += sprintf(text + length, "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  orb_mesh mesh;
  assert_int_equal(read_bytes(text, (size_t)length, &mesh), ORB_OK);
  orb_status status = orb_mesh_repair(ctx, &mesh, ORB_REPAIR_SAFE);
  orb_mesh_free(ctx, &mesh);
  return status;
}

/* The diagonal is sqrt(3) times the leg. */
static void test_range(void **state) {
  (void)state;
  assert_int_equal(repair_tetrahedron(1e30, 0), ORB_OK);
  assert_int_equal(repair_tetrahedron(1e-30, 0), ORB_OK);
  assert_int_equal(repair_tetrahedron(1, 1e6), ORB_OK);
  assert_int_equal(repair_tetrahedron(0.5e-30, 0), ORB_E_DEGENERATE);
  assert_int_equal(repair_tetrahedron(1e-200, 0), ORB_E_DEGENERATE);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "scale it up"));
  assert_int_equal(repair_tetrahedron(1, -2e6), ORB_E_DEGENERATE);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "move it to the origin"));
}

/* strtod() is an independent judge of correct rounding. */
static void test_numbers(void **state) {
  (void)state;
  uint64_t seed = 0x9e3779b97f4a7c15ull;
  for (int i = 0; i < 300000; i++) {
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    char text[64];
    double value;
    memcpy(&value, &seed, sizeof value);
    if (i % 3 == 0 && isfinite(value)) {
      snprintf(text, sizeof text, "%.17g", value);
    } else if (i % 3 == 1) {
      snprintf(text, sizeof text, "%.*f", (int)(seed % 20), ldexp((double)(int64_t)seed, -(int)(seed >> 58)));
    } else {
      snprintf(text, sizeof text, "%llue%d", (unsigned long long)(seed >> seed % 40), (int)(seed % 60) - 30);
    }
    double got = 0;
    const unsigned char *end =
        orb_number_parse((const unsigned char *)text, (const unsigned char *)text + strlen(text), &got);
    assert_ptr_equal(end, text + strlen(text));
    double want = strtod(text, NULL);
    if (memcmp(&got, &want, sizeof got) != 0) {
      fail_msg("%s: %.17g, not %.17g", text, got, want);
    }
  }
  char lengthy[3000];
  memset(lengthy, '0', sizeof lengthy);
  static const char halfway[] = "1.00000000000000011102230246251565404236316680908203125";
  memcpy(lengthy, halfway, sizeof halfway - 1); /* halfway between two doubles */
  lengthy[2998] = '1';
  double got = 0;
  assert_non_null(orb_number_parse((const unsigned char *)lengthy, (const unsigned char *)lengthy + 2999, &got));
  assert_true(got == 1.0000000000000002);
  assert_null(orb_number_parse((const unsigned char *)".", (const unsigned char *)"." + 1, &got));
}

static void test_attributes(void **state) {
  (void)state;
  orb_mesh mesh;
  const char *text =
      "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvt 0.25 0.75\nvt 1 0\nvt 0 0\nvn 0 0 2\nusemtl red\nf 1/1/1 2/2/1 "
      "3/3/1\n";
  assert_int_equal(read_bytes(text, strlen(text), &mesh), ORB_OK);
  assert_true(mesh.texcoords[0] == 0.25f && mesh.texcoords[1] == 0.25f); /* v runs down */
  assert_true(mesh.normals[2] == 1 && mesh.normals[0] == 0);
  assert_true(mesh.colors[0] == 1 && mesh.colors[1] == 0 && mesh.colors[5] == 1 && mesh.colors[10] == 1);
  assert_int_equal(mesh.material_count, 1);
  assert_string_equal(mesh.materials[0].name, "red");
  assert_int_equal(mesh.material[0], 0);
  orb_mesh_free(ctx, &mesh);
}

/* A mesh keeps 65,536 names; the faces of all further objects belong to one without a name, and this is noted. */
static void test_many_objects(void **state) {
  (void)state;
  enum { OBJECTS = 65539, LINE = 24 };
  char *text = malloc((size_t)LINE * OBJECTS + 64);
  assert_non_null(text);
  int n = sprintf(text, "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  for (int i = 0; i < OBJECTS; i++) {
    n += sprintf(text + n, "o part%d\nf 1 2 3\n", i);
  }
  orb_mesh mesh;
  assert_int_equal(read_bytes(text, (size_t)n, &mesh), ORB_OK);
  assert_int_equal(mesh.triangle_count, OBJECTS);
  assert_int_equal(mesh.object_count, 65537);
  assert_string_equal(mesh.objects[65535].name, "part65535");
  assert_string_equal(mesh.objects[65536].name, "");
  assert_int_equal(mesh.objects[65536].first_triangle, 65536);
  assert_int_equal(mesh.dropped_count, 1);
  assert_string_equal(mesh.dropped[0].what, "names of objects");
  orb_mesh_free(ctx, &mesh);
  free(text);
}

/* Each refusal names the limit that the file exceeds. */
static void test_limits(void **state) {
  (void)state;
  enum { CORNERS = (1 << 24) + 1 };
  char *text = malloc(2 * (size_t)CORNERS + 64);
  assert_non_null(text);
  int n = sprintf(text, "v 0 0 0\nf");
  for (int i = 0; i < CORNERS; i++) {
    memcpy(text + n + 2 * (size_t)i, " 1", 2);
  }
  orb_mesh mesh;
  orb_context *roomy = NULL;
  const orb_context_options options = {.max_triangles = 1 << 25};
  assert_int_equal(orb_context_create(&options, &roomy), ORB_OK);
  assert_int_equal(
      orb_mesh_read(roomy, (const unsigned char *)text, (size_t)n + 2 * (size_t)CORNERS, ORB_FORMAT_OBJ, &mesh, NULL),
      ORB_E_TOO_LARGE);
  assert_non_null(strstr(orb_context_error(roomy)->detail, "A face has 16777217 corners, and at most 16777216"));
  orb_context_destroy(roomy);
  free(text);

  orb_context *tight = NULL;
  const orb_context_options three = {.max_triangles = 3};
  assert_int_equal(orb_context_create(&three, &tight), ORB_OK);
  assert_int_equal(
      orb_mesh_read(tight, (const unsigned char *)TEXTS[0], strlen(TEXTS[0]), ORB_FORMAT_AUTO, &mesh, NULL),
      ORB_E_TOO_LARGE);
  assert_non_null(strstr(orb_context_error(tight)->detail, "more than 3 triangles"));
  orb_context_destroy(tight);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_texts),        cmocka_unit_test(test_binaries),
                                     cmocka_unit_test(test_errors),       cmocka_unit_test(test_range),
                                     cmocka_unit_test(test_numbers),      cmocka_unit_test(test_prefixes),
                                     cmocka_unit_test(test_mutations),    cmocka_unit_test(test_attributes),
                                     cmocka_unit_test(test_many_objects), cmocka_unit_test(test_limits)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
