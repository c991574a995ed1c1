/* Files that are made to cost much: the time and memory to read them are bounded by their size. Times are compared with
 * those of a harmless file of the same size, so the bounds hold on any machine. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/hash.h"
#include "orbmorph/format.h"
#include "support_context.h"
#include "support_handles.h"
#include "support_zip.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ORB_TEST_SANITIZED 1
#else
#define ORB_TEST_SANITIZED 0
#endif

typedef struct text {
  char *at;
  size_t size, room;
} text;

static void add(text *t, const void *bytes, size_t size) {
  if (t->size + size > t->room) {
    t->room = 2 * (t->room + size);
    t->at = realloc(t->at, t->room);
    assert_non_null(t->at);
  }
  memcpy(t->at + t->size, bytes, size);
  t->size += size;
}

static double cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Reads and repairs; any result will do. */
static double seconds_to_read(const text *t, orb_status *status) {
  orb_mesh mesh;
  double begin = cpu_seconds();
  *status = orb_mesh_read(ctx, (const unsigned char *)t->at, t->size, ORB_FORMAT_AUTO, &mesh, NULL);
  if (*status == ORB_OK) {
    orb_status repaired = orb_mesh_repair(ctx, &mesh, ORB_REPAIR_SAFE);
    (void)repaired; /* a soup of triangles is refused */
    orb_mesh_free(ctx, &mesh);
  }
  return cpu_seconds() - begin;
}

static uint64_t next_random(uint64_t *seed) {
  *seed ^= *seed << 13;
  *seed ^= *seed >> 7;
  *seed ^= *seed << 17;
  return *seed;
}

/* The values are those that CPython 3.11 computes with PYTHONHASHSEED=0. */
static void test_siphash(void **state) {
  (void)state;
  const uint64_t zero[2] = {0, 0};
  uint64_t a[2], b[2];
  assert_true(orb_siphash13(zero, "a", 1) == 0x407448d2b89b1813u);
  assert_true(orb_siphash13(zero, "orbmorph", 8) == 0xd66cea5a6cbd7b5cu);
  assert_true(orb_siphash13(zero, "123456789012345", 15) == 0x43699fe13351339fu);
  orb_hash_key(a);
  orb_hash_key(b);
  assert_true(a[0] != b[0] && a[1] != b[1]);
}

static uint64_t inverse_of(uint64_t odd) {
  uint64_t x = odd;
  for (int i = 0; i < 6; i++) {
    x *= 2 - odd * x;
  }
  return x;
}

/* A third coordinate for which an unkeyed mix of the three, ^ and * and >> 32, ends in the same slot of any table. */
static double colliding(const double xy[2], uint64_t *seed) {
  const uint64_t m = 0xff51afd7ed558ccdu, last = 0xc4ceb9fe1a85ec53u;
  uint64_t hash = 0x9e3779b97f4a7c15u, bits;
  for (int k = 0; k < 2; k++) {
    memcpy(&bits, &xy[k], sizeof bits);
    hash = (hash ^ bits) * m;
    hash ^= hash >> 32;
  }
  for (;;) {
    uint64_t wanted = (next_random(seed) & ~(uint64_t)0xffffff00000) * inverse_of(last);
    wanted ^= wanted >> 32;
    bits = wanted * inverse_of(m) ^ hash;
    double z;
    memcpy(&z, &bits, sizeof z);
    if (z > 1e-30 && z < 1e29) {
      return z;
    }
  }
}

/* A binary PLY of loose triangles. */
static text loose_triangles(int count, int collide) {
  text t = {0};
  char head[300];
  uint64_t seed = 88172645463325252u;
  int length =
      snprintf(head, sizeof head,
               "ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty double x\nproperty double y\n"
               "property double z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n",
               3 * count, count);
  add(&t, head, (size_t)length);
  for (int v = 0; v < 3 * count; v++) {
    double p[3] = {v, (double)(next_random(&seed) >> 40), (double)(next_random(&seed) >> 40)};
    p[2] = collide ? colliding(p, &seed) : p[2];
    add(&t, p, sizeof p);
  }
  for (int32_t f = 0; f < count; f++) {
    const int32_t corners[3] = {3 * f, 3 * f + 1, 3 * f + 2};
    add(&t, "\3", 1);
    add(&t, corners, sizeof corners);
  }
  return t;
}

static void compare(text harmless, text hostile, double most) {
  orb_status status;
  double usual = seconds_to_read(&harmless, &status);
  assert_int_equal(status, ORB_OK);
  double seconds = seconds_to_read(&hostile, &status);
  if (seconds > most * (usual + 0.02)) {
    fail_msg("%.3f s for %zu bytes, where a harmless file takes %.3f s", seconds, hostile.size, usual);
  }
  free(harmless.at);
  free(hostile.at);
}

static void test_colliding_positions(void **state) {
  (void)state;
  compare(loose_triangles(16000, 0), loose_triangles(16000, 1), 4);
}

enum { FNV_BITS = 17 };

/* The letters that take FNV-1a, modulo 2^17, from a state to 0: three bytes. */
static void colliding_name(char *name, int number) {
  static int32_t suffix[1 << FNV_BITS];
  const uint32_t prime = 16777619u, mask = (1u << FNV_BITS) - 1, back = (uint32_t)inverse_of(prime);
  if (!suffix[0]) {
    memset(suffix, -1, sizeof suffix);
    for (int32_t s = 0; s < 94 * 94 * 94; s++) {
      uint32_t h = 0;
      const int32_t letters[3] = {'!' + s / 94 / 94, '!' + s / 94 % 94, '!' + s % 94};
      for (int k = 2; k >= 0; k--) {
        h = (h * back & mask) ^ (uint32_t)letters[k];
      }
      suffix[h] = s;
    }
  }
  for (char more = 'a';; more++) {
    uint32_t h = 2166136261u;
    int length = sprintf(name, "%c%d", more, number);
    for (int i = 0; i < length; i++) {
      h = (h ^ (unsigned char)name[i]) * prime;
    }
    int32_t s = suffix[h & mask];
    if (s >= 0) {
      sprintf(name + length, "%c%c%c", '!' + s / 94 / 94, '!' + s / 94 % 94, '!' + s % 94);
      return;
    }
  }
}

static text many_materials(int count, int collide) {
  text t = {0};
  char line[100], name[40];
  add(&t, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n", 32);
  for (int i = 0; i < count; i++) {
    snprintf(name, sizeof name, "m%d", i);
    if (collide) {
      colliding_name(name, i);
    }
    add(&t, line, (size_t)snprintf(line, sizeof line, "usemtl %s\nf 1 2 3\n", name));
  }
  return t;
}

static void test_colliding_materials(void **state) {
  (void)state;
  compare(many_materials(15000, 0), many_materials(15000, 1), 6);
}

/* A star, as one face that runs around it many times, or as many faces that each run around it once. */
static text star(int turns, int one_face) {
  text t = {0};
  const char *vertices = "v 3 0 0\nv 1 1 0\nv 0 3 0\nv -1 1 0\nv -3 0 0\nv -1 -1 0\nv 0 -3 0\nv 1 -1 0\nf";
  add(&t, vertices, strlen(vertices));
  for (int i = 0; i < turns; i++) {
    const char *next = one_face || i + 1 == turns ? " 1 2 3 4 5 6 7 8" : " 1 2 3 4 5 6 7 8\nf";
    add(&t, next, strlen(next));
  }
  add(&t, "\n", 1);
  return t;
}

static void test_large_face(void **state) {
  (void)state;
  compare(star(60000, 0), star(60000, 1), 5);
}

static text glb(const char *json, size_t binary) {
  text t = {0};
  size_t length = strlen(json), padded = (length + 3) / 4 * 4;
  uint32_t head[5] = {0x46546c67, 2, (uint32_t)(28 + padded + binary), (uint32_t)padded, 0x4e4f534a};
  uint32_t chunk[2] = {(uint32_t)binary, 0x004e4942};
  unsigned char *zeros = calloc(binary, 1);
  assert_non_null(zeros);
  add(&t, head, sizeof head);
  add(&t, json, length);
  add(&t, "   ", padded - length);
  add(&t, chunk, sizeof chunk);
  add(&t, zeros, binary);
  free(zeros);
  return t;
}

/* Many primitives name one accessor of indices. */
static void test_shared_indices(void **state) {
  (void)state;
  enum { INDICES = 1 << 20, PRIMITIVES = 400 };
  text json = {0};
  char line[500];
  orb_status status;
  add(&json, line,
      (size_t)snprintf(
          line, sizeof line,
          "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":%d}],\"bufferViews\":[{\"buffer\":0,"
          "\"byteLength\":%d}],\"accessors\":[{\"bufferView\":0,\"componentType\":5121,\"type\":\"SCALAR\","
          "\"count\":%d},{\"bufferView\":0,\"componentType\":5126,\"type\":\"VEC3\",\"count\":4}],\"meshes\":"
          "[{\"primitives\":[",
          INDICES, INDICES, INDICES));
  for (int i = 0; i < PRIMITIVES; i++) {
    add(&json, line,
        (size_t)snprintf(line, sizeof line, "%s{\"mode\":5,\"indices\":0,\"attributes\":{\"POSITION\":1}}",
                         i ? "," : ""));
  }
  add(&json, "]}]}", 5);
  text file = glb(json.at, INDICES);
  double seconds = seconds_to_read(&file, &status);
  if (status != ORB_E_TOO_LARGE) {
    fail_msg("status %d after %.3f s for %zu bytes", (int)status, seconds, file.size);
  }
  free(json.at);
  free(file.at);
}

/* All attributes are read from the same bytes, each element one byte after the previous one. The process must not grow
 * beyond the budget: the file is read in a separate process, whose peak the kernel reports. */
static void test_overlapping_accessors(void **state) {
  (void)state;
  enum { BYTES = 8 << 20, BUDGET = 64 << 20 };
  char json[2000];
  snprintf(
      json, sizeof json,
      "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":%d}],\"bufferViews\":[{\"buffer\":0,"
      "\"byteLength\":"
      "%d,\"byteStride\":1}],\"accessors\":[{\"bufferView\":0,\"componentType\":5121,\"type\":\"VEC3\",\"count\":%d},"
      "{\"bufferView\":0,\"componentType\":5121,\"type\":\"VEC4\",\"count\":%d},{\"bufferView\":0,\"componentType\":"
      "5121,\"type\":\"VEC2\",\"count\":%d}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":0,"
      "\"COLOR_0\":1,\"TEXCOORD_0\":2}}]}]}",
      BYTES, BYTES, BYTES - 4, BYTES - 4, BYTES - 4);
  text file = glb(json, BYTES);
  struct rusage before;
  assert_int_equal(getrusage(RUSAGE_SELF, &before), 0);
  pid_t child = fork();
  assert_true(child >= 0);
  if (child == 0) {
    orb_context *own;
    orb_mesh mesh;
    if (orb_context_create(&(orb_context_options){.memory_limit = BUDGET, .threads = 1}, &own) != ORB_OK) {
      _exit(2);
    }
    orb_status status = orb_mesh_read(own, (const unsigned char *)file.at, file.size, ORB_FORMAT_GLB, &mesh, NULL);
    _exit(status == ORB_E_NO_MEMORY ? 0 : 1);
  }
  struct rusage used;
  int ended = -1;
  assert_int_equal(wait4(child, &ended, 0, &used), child);
  assert_true(WIFEXITED(ended));
  assert_int_equal(WEXITSTATUS(ended), 0);
  long most = before.ru_maxrss + (BUDGET + (32 << 20)) / 1024; /* KiB */
  if (used.ru_maxrss > most) {
    fail_msg("%ld KiB resident, %ld were allowed", used.ru_maxrss, most);
  }
  free(file.at);
}

/* Processor seconds per byte to read and check an ordinary file, the least of three runs: the measure for the times of
 * the dense files. */
static double usual_seconds_a_byte(void) {
  text ordinary = loose_triangles(16000, 0);
  double least = HUGE_VAL;
  for (int i = 0; i < 3; i++) {
    orb_status status;
    double seconds = seconds_to_read(&ordinary, &status);
    assert_int_equal(status, ORB_OK);
    least = fmin(least, seconds / (double)ordinary.size);
  }
  free(ordinary.at);
  return least;
}

/* A binary PLY file of triangles as far as its header. */
static text ply_head(int vertices, int triangles) {
  text t = {0};
  char head[300];
  add(&t, head,
      (size_t)snprintf(head, sizeof head,
                       "ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
                       "property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n",
                       vertices, triangles));
  return t;
}

/* A bowl: a fan of so many triangles from the bottom to the rim, which is one hole. */
static text bowl(int edges) {
  text t = ply_head(edges + 1, edges);
  for (int v = 0; v <= edges; v++) {
    const double angle = 2 * 3.14159265358979323846 * v / edges;
    const float p[3] = {v ? (float)cos(angle) : 0, v ? (float)sin(angle) : 0, v ? 0 : -1};
    add(&t, p, sizeof p);
  }
  for (int f = 0; f < edges; f++) {
    const int32_t corners[3] = {0, 1 + (f + 1) % edges, 1 + f};
    add(&t, "\3", 1);
    add(&t, corners, sizeof corners);
  }
  return t;
}

/* Fills the hole of a bowl with so many edges, and compares triangles, memory and time with what docs/limits.md says.
 * All memory counts in the budget, that of the sparse matrix by which the fill is made fair as well; what the daemon
 * allows it is in server/budget.c. */
static void fill_bowl(int edges, int least, int most, double megabytes) {
  text file = bowl(edges);
  struct rusage before;
  assert_int_equal(getrusage(RUSAGE_SELF, &before), 0);
  pid_t child = fork();
  assert_true(child >= 0);
  if (child == 0) {
    orb_context *own;
    orb_mesh mesh;
    struct rusage used;
    if (orb_context_create(&(orb_context_options){.threads = 1}, &own) != ORB_OK ||
        orb_mesh_read(own, (const unsigned char *)file.at, file.size, ORB_FORMAT_PLY, &mesh, NULL) != ORB_OK ||
        orb_mesh_repair(own, &mesh, ORB_REPAIR_FILL_HOLES) != ORB_OK || getrusage(RUSAGE_SELF, &used) != 0) {
      _exit(1);
    }
    const double peak = (double)orb_memory_peak(own) / (1 << 20);
    const double resident = (double)(used.ru_maxrss - before.ru_maxrss) / 1024;
    const int made = (int)mesh.triangle_count - edges;
    print_message("a hole of %d edges: %d triangles, %.0f MB, %.0f MB resident\n", edges, made, peak, resident);
    _exit(made < least || made > most ? 2 : peak > megabytes ? 3 : !ORB_TEST_SANITIZED && resident > peak + 16 ? 4 : 0);
  }
  int ended = -1;
  struct rusage used;
  assert_int_equal(wait4(child, &ended, 0, &used), child);
  assert_true(WIFEXITED(ended));
  assert_int_equal(WEXITSTATUS(ended), 0);
  const double seconds = (double)used.ru_utime.tv_sec + 1e-6 * (double)used.ru_utime.tv_usec;
  const double usual = usual_seconds_a_byte(), times = seconds / (double)file.size / usual;
  print_message("%.2f s for %zu bytes, %.0f times an ordinary file\n", seconds, file.size, times);
  /* Each triangle costs what 3,000 bytes of an ordinary file cost, or less. */
  assert_true(ORB_TEST_SANITIZED || seconds < 3000 * usual * (most + 1000));
  free(file.at);
}

static void test_filled_hole(void **state) {
  (void)state;
  fill_bowl(680, 12 * 680, 16384, 40);             /* as fine as its rim */
  fill_bowl(4000, 4 * 4000 / 2, 16384 + 4000, 40); /* coarser: the mesh has 4,000 triangles */
  fill_bowl(20000, 20000 - 2, 20000 - 2, 40);      /* flat */
}

/* A torus of n times n squares, and what its loops are: around the tube n edges, through the hole as many. */
static text torus(int n) {
  text t = ply_head(n * n, 2 * n * n);
  for (int i = 0; i < n * n; i++) {
    const double a = 2 * M_PI * (i / n) / n, b = 2 * M_PI * (i % n) / n;
    const float p[3] = {(float)((3 + cos(b)) * cos(a)), (float)((3 + cos(b)) * sin(a)), (float)sin(b)};
    add(&t, p, sizeof p);
  }
  for (int i = 0; i < n * n; i++) {
    const int32_t r = i / n * n, s = (i / n + 1) % n * n, c = i % n, d = (i % n + 1) % n;
    const int32_t corners[2][3] = {{r + c, s + c, s + d}, {r + c, s + d, r + d}};
    for (int k = 0; k < 2; k++) {
      add(&t, "\3", 1);
      add(&t, corners[k], sizeof corners[k]);
    }
  }
  return t;
}

/* Closes handles, and compares the time with what docs/limits.md says: each triangle costs what 3,000 bytes of an
 * ordinary file cost, or less, however long the loops are. */
static void close_handles(text file, orb_format format, double size, int handles) {
  orb_mesh mesh;
  const orb_repair_options options = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = size};
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)file.at, file.size, format, &mesh, NULL), ORB_OK);
  const int triangles = mesh.triangle_count;
  const double begin = cpu_seconds();
  assert_int_equal(orb_mesh_repair_with(ctx, &mesh, &options), ORB_OK);
  const double seconds = cpu_seconds() - begin, usual = usual_seconds_a_byte();
  print_message("%d handles of %d triangles: %.2f s, as %.0f bytes of an ordinary file a triangle\n", handles,
                triangles, seconds, seconds / usual / triangles);
  assert_int_equal(mesh.handle_count, handles);
  assert_true(ORB_TEST_SANITIZED || seconds < 3000 * usual * triangles);
  orb_mesh_free(ctx, &mesh);
  free(file.at);
}

static void test_closed_handles(void **state) {
  (void)state;
  text plate = {0};
  plate.at = handles_plate(3000, &plate.size);
  close_handles(plate, ORB_FORMAT_OBJ, 1, 3000);
  close_handles(torus(ORB_TEST_SANITIZED ? 60 : 300), ORB_FORMAT_PLY, 1, 1);
}

/* An object whose look-ups pass a million members. */
static void test_many_members(void **state) {
  (void)state;
  text json = {0};
  char line[64];
  orb_status status;
  add(&json, "{\"asset\":{\"version\":\"2.0\"},\"accessors\":[{", 42);
  for (int i = 0; i < 1000; i++) {
    add(&json, line, (size_t)snprintf(line, sizeof line, "%s\"m%d\":0", i ? "," : "", i));
  }
  add(&json, "}]}", 3);
  (void)seconds_to_read(&json, &status);
  assert_int_equal(status, ORB_E_TOO_LARGE);
  free(json.at);
}

/* The densest known file of each format: the fewest bytes for a triangle with all attributes. */
static text dense_obj(int size) {
  text t = {0};
  const char *head = "v 3 0 0 1 0 0\nv 0 3 0\nv 0 0 3\nvt 0 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2 3\nf";
  add(&t, head, strlen(head));
  for (int i = 0; i < size / 6; i++) {
    add(&t, " 1 2 3", 6);
  }
  return t;
}

static text dense_off(int size) {
  text t = {0};
  char head[100];
  int corners = size / 6 * 3;
  add(&t, head, (size_t)snprintf(head, sizeof head, "STCNOFF\n3 1 0\n"));
  for (int v = 0; v < 3; v++) {
    add(&t, head, (size_t)snprintf(head, sizeof head, "%d %d 0 0 0 1 1 0 0 1 0 0\n", v, v % 2));
  }
  add(&t, head, (size_t)snprintf(head, sizeof head, "%d", corners));
  for (int i = 0; i < corners / 3; i++) {
    add(&t, " 0 1 2", 6);
  }
  return t;
}

static text dense_ply(int size) {
  text t = {0};
  char head[600];
  add(&t, head,
      (size_t)snprintf(head, sizeof head,
                       "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar x\nproperty uchar y\n"
                       "property uchar z\nproperty uchar nx\nproperty uchar ny\nproperty uchar nz\nproperty uchar s\n"
                       "property uchar t\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
                       "element tristrips 1\nproperty list int uchar vertex_indices\nend_header\n"));
  for (int v = 0; v < 3; v++) {
    const unsigned char row[11] = {(unsigned char)v, v == 1, 0, 0, 0, 1, 0, 0, 9, 9, 9};
    add(&t, row, sizeof row);
  }
  int32_t count = size;
  add(&t, &count, sizeof count);
  for (int i = 0; i < size; i++) {
    const unsigned char index = (unsigned char)(i % 3);
    add(&t, &index, 1);
  }
  return t;
}

static text dense_stl(int size) {
  text t = {0};
  char head[80] = "";
  uint32_t count = (uint32_t)size / 50;
  float facet[13] = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0};
  add(&t, head, sizeof head);
  add(&t, &count, sizeof count);
  for (uint32_t i = 0; i < count; i++) {
    facet[3] = (float)i;
    add(&t, facet, 50);
  }
  return t;
}

static text dense_glb(int size) {
  char json[2000];
  const int vertex = 4096;
  snprintf(
      json, sizeof json,
      "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":%d}],\"bufferViews\":[{\"buffer\":0,"
      "\"byteLength\":"
      "%d}],\"accessors\":[{\"bufferView\":0,\"componentType\":5121,\"type\":\"SCALAR\",\"count\":%d},"
      "{\"bufferView\":0,\"componentType\":5121,\"type\":\"VEC3\",\"count\":256},{\"bufferView\":0,\"componentType\":"
      "5121,"
      "\"type\":\"VEC2\",\"count\":256}],\"materials\":[{}],\"meshes\":[{\"primitives\":[{\"mode\":5,\"material\":0,"
      "\"indices\":0,\"attributes\":{\"POSITION\":1,\"NORMAL\":1,\"COLOR_0\":1,\"TEXCOORD_0\":2}}]}]}",
      vertex + size, vertex + size, size);
  text t = glb(json, (size_t)(vertex + size));
  for (size_t i = t.size - (size_t)(vertex + size); i < t.size; i++) {
    t.at[i] = (char)(i % 3); /* indices and coordinates in one */
  }
  return t;
}

/* One triangle per byte, shown by items of one object; as much XML in small elements as the archive may unpack to; the
 * rest of the bytes is a file that the reader does not need. */
static text dense_3mf(int size) {
  text xml = {0};
  archive a = {0};
  char line[200];
  unsigned char *rest = malloc((size_t)size);
  const char *head =
      "<model xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources><basematerials id=\"1\">"
      "<base name=\"m\" displaycolor=\"#FF8000\"/></basematerials><object id=\"2\" pid=\"1\" pindex=\"0\"><mesh>"
      "<vertices><vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/>"
      "</vertices><triangles>";
  assert_non_null(rest);
  add(&xml, head, strlen(head));
  for (int i = 0; i < 1000; i++) {
    add(&xml, line, (size_t)snprintf(line, sizeof line, "<triangle v1=\"0\" v2=\"1\" v3=\"2\"/>"));
  }
  add(&xml, line, (size_t)snprintf(line, sizeof line, "</triangles></mesh></object></resources><build>"));
  for (int i = 0; i < size / 1100; i++) {
    add(&xml, line, (size_t)snprintf(line, sizeof line, "<item objectid=\"2\"/>"));
  }
  while (xml.size < (size_t)size * 49) {
    add(&xml, "<a/>", 4);
  }
  add(&xml, line, (size_t)snprintf(line, sizeof line, "</build></model>"));
  archive_add(&a, "3D/3dmodel.model", xml.at, xml.size, 1);
  uint64_t seed = 88172645463325252u;
  for (int i = 0; i < size; i++) {
    rest[i] = (unsigned char)next_random(&seed);
  }
  archive_add(&a, "thumbnail.png", rest, (size_t)size - a.size, 0);
  archive_end(&a);
  free(rest);
  free(xml.at);
  free(a.directory);
  return (text){(char *)a.bytes, a.size, a.room};
}

/* The figures of docs/limits.md for ordinary files. The daemon reserves 9 bytes per byte of the file for the first
 * check. */
static void test_ordinary_memory(void **state) {
  (void)state;
  text ordinary = loose_triangles(16000, 0);
  orb_context *own;
  orb_mesh mesh;
  assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &own), ORB_OK);
  assert_int_equal(orb_mesh_read(own, (const unsigned char *)ordinary.at, ordinary.size, ORB_FORMAT_AUTO, &mesh, NULL),
                   ORB_OK);
  orb_status repaired = orb_mesh_repair(own, &mesh, ORB_REPAIR_SAFE);
  (void)repaired;
  double peak = (double)orb_memory_peak(own) / (double)ordinary.size;
  print_message("an ordinary file: %.1f bytes per byte\n", peak);
  assert_true(peak > 1 && peak <= 5.5);
  orb_mesh_free(own, &mesh);
  orb_context_destroy(own);
  free(ordinary.at);
}

/* docs/limits.md has these multiples. */
static void test_multiples(void **state) {
  (void)state;
  const double usual = usual_seconds_a_byte();
  static const struct {
    const char *format;
    text (*make)(int size);
    double memory; /* bytes for each byte of the file */
    double times;  /* of an ordinary file of the same size */
  } rows[] = {{"obj", dense_obj, 110, 300}, {"off", dense_off, 110, 300}, {"ply", dense_ply, 200, 400},
              {"stl", dense_stl, 12, 20},   {"glb", dense_glb, 200, 300}, {"3mf", dense_3mf, 120, 1000}};
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    enum { SIZE = 1 << 20 };
    text t = rows[i].make(SIZE);
    orb_context *own;
    orb_mesh mesh;
    assert_int_equal(orb_context_create(&(orb_context_options){.threads = 1}, &own), ORB_OK);
    double begin = cpu_seconds();
    orb_format format = orb_format_detect((const unsigned char *)t.at, t.size);
    assert_string_equal(orb_format_name(format), rows[i].format);
    orb_status status = orb_mesh_read(own, (const unsigned char *)t.at, t.size, ORB_FORMAT_AUTO, &mesh, NULL);
    double seconds = cpu_seconds() - begin;
    if (status != ORB_OK) {
      fail_msg("%s: %s", rows[i].format, orb_context_error(own)->detail);
    }
    orb_status repaired = orb_mesh_repair(own, &mesh, ORB_REPAIR_SAFE);
    (void)repaired;
    double both = cpu_seconds() - begin, peak = (double)orb_memory_peak(own) / (double)t.size;
    print_message("%s: %.1f bytes and %.0f ns a byte to read, %.0f ns with the check, %.1f times an ordinary file\n",
                  rows[i].format, peak, 1e9 * seconds / (double)t.size, 1e9 * both / (double)t.size,
                  both / (double)t.size / usual);
    assert_true(peak <= rows[i].memory);
    assert_true(both < rows[i].times * usual * (double)t.size);
    int is_bare = rows[i].make == dense_stl || rows[i].make == dense_3mf; /* these formats have neither */
    assert_true((mesh.normals && mesh.texcoords) || is_bare);
    orb_mesh_free(own, &mesh);
    orb_context_destroy(own);
    free(t.at);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_siphash),
      cmocka_unit_test(test_colliding_positions),
      cmocka_unit_test(test_colliding_materials),
      cmocka_unit_test(test_large_face),
      cmocka_unit_test(test_shared_indices),
      cmocka_unit_test(test_overlapping_accessors),
      cmocka_unit_test(test_filled_hole),
      cmocka_unit_test(test_closed_handles),
      cmocka_unit_test(test_many_members),
      cmocka_unit_test(test_ordinary_memory),
      cmocka_unit_test(test_multiples),
  };
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
