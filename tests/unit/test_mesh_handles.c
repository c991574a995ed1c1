/* Closing handles: which are cut, which stay, and the loops of those that are refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "mesh/cycles.h"
#include "numeric/vec3.h"
#include "orbmorph/format.h"
#include "support_context.h"
#include "support_handles.h"
#include "support_shapes.h"
#include "support_shared.h"

static orb_mesh read_text(char *text, size_t size) {
  orb_mesh mesh;
  assert_int_equal(orb_mesh_read(ctx, (unsigned char *)text, size, ORB_FORMAT_OBJ, &mesh, NULL), ORB_OK);
  free(text);
  return mesh;
}

/* A loop is closed and simple, runs along edges of the mesh as read, and leaves its faces connected: such a curve
 * cannot bound a disc. */
static void check_loop(const orb_mesh *raw, const int32_t *loop, int count) {
  assert_true(count >= 3);
  int32_t faces = raw->triangle_count, *next = malloc((size_t)raw->vertex_count * sizeof *next), edges = 0;
  int32_t *root = malloc((size_t)faces * sizeof *root), pieces = faces;
  int32_t *twin = malloc(3 * (size_t)faces * sizeof *twin);
  assert_int_equal(orb_mesh_twins(ctx, raw->triangles, faces, raw->vertex_count, twin), ORB_OK);
  memset(next, 0xff, (size_t)raw->vertex_count * sizeof *next);
  for (int i = 0; i < count; i++) {
    assert_in_range(loop[i], 0, raw->vertex_count - 1);
    assert_int_equal(next[loop[i]], -1);
    next[loop[i]] = loop[(i + 1) % count];
  }
  for (int32_t t = 0; t < faces; t++) {
    root[t] = t;
  }
  for (int32_t h = 0; h < 3 * faces; h++) {
    int32_t a = raw->triangles[h], b = raw->triangles[orb_next(h)], s = h / 3, t = twin[h] / 3;
    if (next[a] == b || next[b] == a) {
      edges += next[a] == b;
      continue;
    }
    while (root[s] != s) {
      s = root[s] = root[root[s]];
    }
    while (root[t] != t) {
      t = root[t] = root[root[t]];
    }
    pieces -= s != t;
    root[s] = t;
  }
  assert_int_equal(edges, count);
  assert_int_equal(pieces, 1);
  free(next);
  free(root);
  free(twin);
}

/* The area of the fan over a loop around its centre. */
static double disc_of(const orb_mesh *raw, const int32_t *loop, int count) {
  double centre[3] = {0, 0, 0}, area = 0;
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      centre[k] += raw->positions[3 * loop[i] + k] / count;
    }
  }
  for (int i = 0; i < count; i++) {
    double u[3], w[3], n[3];
    orb_sub(raw->positions + 3 * loop[i], centre, u);
    orb_sub(raw->positions + 3 * loop[(i + 1) % count], centre, w);
    orb_cross(u, w, n);
    area += 0.5 * orb_length(n);
  }
  return area;
}

/* How often the surface surrounds the centre of a loop: its solid angle (Van Oosterom and Strackee 1983) over 4π. */
static double winding(const orb_mesh *raw, const int32_t *loop, int count) {
  double centre[3] = {0, 0, 0}, total = 0;
  for (int i = 0; i < count; i++) {
    for (int k = 0; k < 3; k++) {
      centre[k] += raw->positions[3 * loop[i] + k] / count;
    }
  }
  for (int32_t t = 0; t < raw->triangle_count; t++) {
    double p[3][3], l[3], n[3];
    for (int k = 0; k < 3; k++) {
      orb_sub(raw->positions + 3 * raw->triangles[3 * t + k], centre, p[k]);
      l[k] = orb_length(p[k]);
    }
    orb_cross(p[1], p[2], n);
    total += 2 * atan2(orb_dot(p[0], n), l[0] * l[1] * l[2] + orb_dot(p[0], p[1]) * l[2] + orb_dot(p[1], p[2]) * l[0] +
                                             orb_dot(p[2], p[0]) * l[1]);
  }
  return total / (4 * M_PI);
}

/* Every face of the file still exists with its corners at their places; the others are patches. */
static void check_faces_stay(const orb_mesh *raw, const orb_mesh *mesh) {
  int32_t kept = 0;
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    int32_t from = mesh->source_triangle[t];
    if (from < 0) {
      continue;
    }
    assert_int_equal(from, kept++);
    for (int k = 0; k < 3; k++) {
      assert_memory_equal(mesh->positions + 3 * mesh->triangles[3 * t + k],
                          raw->positions + 3 * raw->triangles[3 * from + k], 3 * sizeof(double));
    }
  }
  assert_int_equal(kept, raw->triangle_count);
}

/* tell: the body is so thick that no tube pierces it, so `filled` says on which side of it a loop is. Returns the
 * processor time of the closing, in seconds. */
static double close_all(orb_mesh *plain, int count, unsigned seed, double size, int tell) {
  size_t length;
  int made;
  char *text = handles_stitch(plain, count, seed, &length, &made);
  assert_int_equal(made, count);
  orb_mesh raw = read_text(text, length), mesh;
  orb_topology topology;
  orb_extent extent;
  assert_int_equal(orb_mesh_copy(ctx, &raw, &mesh), ORB_OK);
  assert_int_equal(orb_mesh_topology(ctx, &raw, &topology), ORB_OK);
  assert_true(topology.genus == count);
  orb_mesh_extent(&raw, &extent);
  const orb_repair_options options = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = size};
  clock_t start = clock();
  assert_int_equal(orb_mesh_repair_with(ctx, &mesh, &options), ORB_OK);
  double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
  assert_int_equal(orb_mesh_topology(ctx, &mesh, &topology), ORB_OK);
  assert_true(topology.genus == 0 && topology.components == 1 && topology.boundary_loops == 0);
  assert_true(topology.nonmanifold_edges == 0 && topology.nonmanifold_vertices == 0 && topology.consistent);
  assert_int_equal(mesh.handle_count, count);
  check_faces_stay(&raw, &mesh);
  double changed = 0, made_area = 0;
  for (int i = 0; i < count; i++) {
    const orb_handle *handle = &mesh.handles[i];
    const int32_t *loop = mesh.loop_vertices + handle->start;
    double around = 0, area = handle->area_relative * extent.diagonal * extent.diagonal;
    check_loop(&raw, loop, handle->count);
    for (int k = 0; k < handle->count; k++) {
      around += sqrt(orb_distance2(raw.positions + 3 * loop[k], raw.positions + 3 * loop[(k + 1) % handle->count]));
    }
    assert_true(fabs(around / extent.diagonal - handle->length_relative) < 1e-12);
    assert_true(handle->length_relative <= (size > 0 ? size : ORB_HANDLE_SIZE));
    assert_true(area > 0 && area <= 3 * disc_of(&raw, loop, handle->count));
    assert_true(!tell || fabs(winding(&raw, loop, handle->count) - !handle->filled) < 1e-6);
    changed += area;
  }
  for (int32_t t = 0; t < mesh.triangle_count; t++) {
    if (mesh.source_triangle[t] < 0) {
      assert_int_equal(mesh.source_triangle[t], ORB_MADE_COVER);
      double u[3], w[3], n[3];
      const int32_t *c = mesh.triangles + 3 * t;
      orb_sub(mesh.positions + 3 * c[1], mesh.positions + 3 * c[0], u);
      orb_sub(mesh.positions + 3 * c[2], mesh.positions + 3 * c[0], w);
      orb_cross(u, w, n);
      made_area += 0.5 * orb_length(n);
    }
  }
  assert_true(fabs(changed - made_area) < 1e-12 * extent.diagonal * extent.diagonal);
  orb_mesh_free(ctx, &mesh);
  orb_mesh_free(ctx, &raw);
  return seconds;
}

static void test_spheres(void **state) {
  (void)state;
  static const struct {
    int levels, count;
    double size;
  } cases[] = {{4, 1, 0.2}, {5, 2, 0.1}, {5, 12, 0.1}, {6, 50, 0}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    orb_mesh ball = shape_ball(ctx, cases[i].levels);
    close_all(&ball, cases[i].count, 7, cases[i].size, 1);
    shape_free(ctx, &ball);
  }
}

/* Cuts each triangle into four at the middles of its edges, so that there is room for more handles. */
static orb_mesh cut_into_four(const orb_mesh *mesh) {
  int32_t corners = 3 * mesh->triangle_count;
  size_t room = (size_t)(mesh->vertex_count + corners) * 100 + 1, size = 0;
  int32_t *twin = malloc((size_t)corners * sizeof *twin), *middle = malloc((size_t)corners * sizeof *middle);
  char *text = malloc(room);
  int32_t next = mesh->vertex_count;
  assert_true(twin && middle && text);
  assert_int_equal(orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin), ORB_OK);
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    const double *p = mesh->positions + 3 * v;
    size += (size_t)snprintf(text + size, room - size, "v %.17g %.17g %.17g\n", p[0], p[1], p[2]);
  }
  for (int32_t h = 0; h < corners; h++) {
    const double *a = mesh->positions + 3 * mesh->triangles[h], *b = mesh->positions + 3 * mesh->triangles[orb_next(h)];
    if (twin[h] < h) {
      middle[h] = middle[twin[h]];
      continue;
    }
    middle[h] = next++;
    size += (size_t)snprintf(text + size, room - size, "v %.17g %.17g %.17g\n", (a[0] + b[0]) / 2, (a[1] + b[1]) / 2,
                             (a[2] + b[2]) / 2);
  }
  for (int32_t h = 0; h < corners; h += 3) {
    const int32_t *v = mesh->triangles + h, *m = middle + h;
    const int32_t four[12] = {v[0], m[0], m[2], v[1], m[1], m[0], v[2], m[2], m[1], m[0], m[1], m[2]};
    for (int k = 0; k < 12; k += 3) {
      size += (size_t)snprintf(text + size, room - size, "f %d %d %d\n", four[k] + 1, four[k + 1] + 1, four[k + 2] + 1);
    }
  }
  free(twin);
  free(middle);
  return read_text(text, size);
}

static void test_animals(void **state) {
  (void)state;
  static const char *const names[] = {"dog.obj", "elephant.ply", "giraffe.off"};
  for (int i = 0; i < 3; i++) {
    char path[512];
    snprintf(path, sizeof path, ORB_SOURCES "/tests/samples/%s", names[i]);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    static unsigned char bytes[8 << 20];
    size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    orb_mesh mesh;
    assert_int_equal(orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
    close_all(&mesh, 4 + i, 3, 0.2, 0);
    orb_mesh fine = cut_into_four(&mesh);
    for (int count = getenv("ORB_HANDLES_ALL") ? 1 : 50; count <= 50; count++) {
      close_all(&fine, count, 3, 0.2, 0);
    }
    orb_mesh_free(ctx, &fine);
    orb_mesh_free(ctx, &mesh);
  }
}

static void check_refused(orb_mesh *mesh, const orb_repair_options *options, int genus) {
  orb_mesh raw;
  assert_int_equal(orb_mesh_copy(ctx, mesh, &raw), ORB_OK);
  assert_int_equal(orb_mesh_repair_with(ctx, mesh, options), ORB_E_NOT_GENUS_ZERO);
  const orb_error *error = orb_context_error(ctx);
  assert_int_equal(error->genus, genus);
  assert_int_equal(error->loop_count, genus);
  for (int i = 0; i < genus; i++) {
    check_loop(&raw, error->loop_vertices + error->loop_start[i], error->loop_start[i + 1] - error->loop_start[i]);
  }
  orb_mesh_free(ctx, &raw);
  orb_mesh_free(ctx, mesh);
}

/* Real scans, if their folder exists. ORB_HANDLES_ALL=1: every number of handles up to 50, as tests/long.sh does, and
 * the processor time of large meshes. */
static void test_scans(void **state) {
  (void)state;
  int all = getenv("ORB_HANDLES_ALL") != NULL;
  static const char *const names[] = {"armadillo_29k.obj", "armadillo_86k.obj", "nefertiti_280k.ply"};
  for (int i = 0; i < (all ? 3 : 1); i++) {
    orb_mesh scan;
    if (!shared_mesh(ctx, names[i], &scan)) {
      skip();
    }
    for (int count = i < 2 ? 1 : 20; count <= (i < 2 ? 50 : 20); count += all ? 1 : 49) {
      double seconds = close_all(&scan, count, 5 + (unsigned)count, 0.2, 0);
      if (all) {
        print_message("%s, %d triangles, %d handles: %.2f s\n", names[i], scan.triangle_count, count, seconds);
      }
    }
    orb_mesh_free(ctx, &scan);
  }
  for (int count = 1; all && count <= 50; count++) {
    orb_mesh ball = shape_ball(ctx, 6);
    close_all(&ball, count, (unsigned)count, 0, 1);
    shape_free(ctx, &ball);
  }
  if (all) {
    orb_mesh ball = shape_ball(ctx, 8);
    double seconds = close_all(&ball, 20, 1, 0, 1);
    print_message("a ball, %d triangles, 20 handles: %.2f s\n", ball.triangle_count, seconds);
    shape_free(ctx, &ball);
  }
}

/* The genus is that of index.csv, which another program computed. */
static void test_real_refused(void **state) {
  (void)state;
  static const struct {
    const char *name;
    int genus;
  } cases[] = {{"torus.obj", 1}, {"double_torus.obj", 2}, {"three_holes.off", 3}};
  for (size_t i = 0; i < 2 * sizeof cases / sizeof *cases; i++) {
    const orb_repair_options options = {.repair = i % 2 ? ORB_REPAIR_CLOSE_HANDLES : ORB_REPAIR_SAFE};
    size_t size;
    unsigned char *bytes = shared_bytes("bad", cases[i / 2].name, &size);
    if (!bytes) {
      skip();
    }
    orb_mesh mesh;
    assert_int_equal(orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
    free(bytes);
    check_refused(&mesh, &options, cases[i / 2].genus);
  }
}

static orb_mesh torus(int n, double thin) {
  char *text = malloc((size_t)(n * n) * 100), *p = text;
  for (int i = 0; i < n * n; i++) {
    double a = 2 * M_PI * (i / n) / n, b = 2 * M_PI * (i % n) / n;
    p += sprintf(p, "v %.9f %.9f %.9f\n", (3 + thin * cos(b)) * cos(a), (3 + thin * cos(b)) * sin(a), thin * sin(b));
  }
  for (int i = 0; i < n * n; i++) {
    int r = i / n, c = i % n, d = (r + 1) % n, e = (c + 1) % n;
    p += sprintf(p, "f %d %d %d %d\n", r * n + c + 1, d * n + c + 1, d * n + e + 1, r * n + e + 1);
  }
  return read_text(text, (size_t)(p - text));
}

static void test_refused(void **state) {
  (void)state;
  const orb_repair_options safe = {.repair = ORB_REPAIR_SAFE},
                           close = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = 0.01};
  for (int i = 0; i < 2; i++) {
    orb_mesh ring = torus(24, 1);
    check_refused(&ring, i ? &close : &safe, 1);
    size_t size;
    static const int holes[] = {1, 3, 5, 60, 1000};
    for (int k = 0; k < (i ? 4 : 5); k++) {
      char *text = handles_plate(holes[k], &size);
      orb_mesh plate = read_text(text, size);
      check_refused(&plate, i ? &close : &safe, holes[k]);
    }
  }
  assert_non_null(strstr(orb_context_error(ctx)->detail, "handle_size"));
}

/* The data to check the loops of one mesh: half-edges by the vertex they leave, and the numbers of the last loop and
 * walk that passed a vertex and a face. */
typedef struct many {
  const orb_mesh *raw;
  int32_t *twin, *first, *list, *next, *vertex_loop, *face_loop, *queue;
} many;

static many many_open(const orb_mesh *raw) {
  size_t v = (size_t)raw->vertex_count, f = (size_t)raw->triangle_count;
  many m = {raw,
            calloc(3 * f, sizeof(int32_t)),
            calloc(v + 2, sizeof(int32_t)),
            calloc(3 * f, sizeof(int32_t)),
            calloc(v, sizeof(int32_t)),
            calloc(v, sizeof(int32_t)),
            calloc(f, sizeof(int32_t)),
            calloc(f, sizeof(int32_t))};
  assert_int_equal(orb_mesh_twins(ctx, raw->triangles, raw->triangle_count, raw->vertex_count, m.twin), ORB_OK);
  for (int32_t h = 0; h < 3 * raw->triangle_count; h++) {
    m.first[raw->triangles[h] + 2]++;
  }
  for (int32_t i = 0; i < raw->vertex_count; i++) {
    m.first[i + 2] += m.first[i + 1];
  }
  for (int32_t h = 0; h < 3 * raw->triangle_count; h++) {
    m.list[m.first[raw->triangles[h] + 1]++] = h;
  }
  return m;
}

static void many_close(many *m) {
  int32_t *blocks[] = {m->twin, m->first, m->list, m->next, m->vertex_loop, m->face_loop, m->queue};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    free(blocks[i]);
  }
}

/* Like check_loop(), but stops if a walk over faces from the left of the loop's first edge, which does not cross the
 * loop, reaches the right side: with very many loops, each is checked near its handle. number: 1 for the first loop. */
static void check_near(many *m, const int32_t *loop, int count, int32_t number) {
  int32_t start = -1, head = 0, tail = 0;
  assert_true(count >= 3);
  for (int i = 0; i < count; i++) {
    assert_in_range(loop[i], 0, m->raw->vertex_count - 1);
    assert_int_not_equal(m->vertex_loop[loop[i]], number);
    m->vertex_loop[loop[i]] = number;
    m->next[loop[i]] = loop[(i + 1) % count];
  }
  for (int i = 0; i < count; i++) {
    int found = 0;
    for (int32_t k = m->first[loop[i]]; k < m->first[loop[i] + 1]; k++) {
      if (m->raw->triangles[orb_next(m->list[k])] == m->next[loop[i]]) {
        found++;
        start = m->list[k];
      }
    }
    assert_int_equal(found, 1);
  }
  m->queue[tail++] = start / 3;
  m->face_loop[start / 3] = number;
  while (head < tail && m->face_loop[m->twin[start] / 3] != number) {
    int32_t t = m->queue[head++];
    for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
      int32_t a = m->raw->triangles[h], b = m->raw->triangles[orb_next(h)], g = m->twin[h] / 3;
      int on_loop = m->vertex_loop[a] == number && m->vertex_loop[b] == number && (m->next[a] == b || m->next[b] == a);
      if (!on_loop && m->face_loop[g] != number) {
        m->face_loop[g] = number;
        m->queue[tail++] = g;
      }
    }
  }
  assert_int_equal(m->face_loop[m->twin[start] / 3], number);
}

/* Thousands of handles: each has a loop. */
static void test_many(void **state) {
  (void)state;
  for (int i = 0; i < 2; i++) {
    const orb_repair_options options = {.repair = i ? ORB_REPAIR_CLOSE_HANDLES : ORB_REPAIR_SAFE,
                                        .handle_size = 1e-9 * i};
    size_t size;
    int holes = i ? 1001 : 5000;
    char *text = handles_plate(holes, &size);
    orb_mesh plate = read_text(text, size), raw;
    assert_int_equal(orb_mesh_copy(ctx, &plate, &raw), ORB_OK);
    clock_t start = clock();
    assert_int_equal(orb_mesh_repair_with(ctx, &plate, &options), ORB_E_NOT_GENUS_ZERO);
    print_message("%d handles, %d triangles: %.2f s\n", holes, raw.triangle_count,
                  (double)(clock() - start) / CLOCKS_PER_SEC);
    const orb_error *error = orb_context_error(ctx);
    assert_int_equal(error->genus, holes);
    assert_int_equal(error->loop_count, holes);
    many m = many_open(&raw);
    for (int k = 0; k < holes; k++) {
      check_near(&m, error->loop_vertices + error->loop_start[k], error->loop_start[k + 1] - error->loop_start[k],
                 k + 1);
    }
    /* the holes are squares of edge 1 and no bar is thicker, so loops of length 4 exist: few loops are much longer */
    assert_true(error->loop_start[holes] <= 5 * holes);
    many_close(&m);
    orb_mesh_free(ctx, &raw);
    orb_mesh_free(ctx, &plate);
  }
}

/* The shortest loop of a torus goes around its tube, and the repair cuts it if it may. The caps of a tube of n sides
 * have the area of a polygon each. */
static void test_torus(void **state) {
  (void)state;
  enum { N = 24 };
  const double diagonal = sqrt(2 * 8 * 8 + 2 * 2), around = 2 * N * sin(M_PI / N);
  orb_mesh ring = torus(N, 1);
  orb_repair_options options = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = 0.999 * around / diagonal};
  check_refused(&ring, &options, 1);
  const orb_error *error = orb_context_error(ctx);
  assert_int_equal(error->loop_start[1], N);
  assert_true(fabs(error->loop_length_relative[0] - around / diagonal) < 1e-8);
  ring = torus(N, 1);
  options.handle_size = 1.001 * around / diagonal;
  assert_int_equal(orb_mesh_repair_with(ctx, &ring, &options), ORB_OK);
  assert_int_equal(ring.handle_count, 1);
  assert_int_equal(ring.handles[0].filled, 0);
  assert_true(fabs(ring.handles[0].area_relative - N * sin(2 * M_PI / N) / (diagonal * diagonal)) < 1e-8);
  assert_int_equal(ring.triangle_count, 2 * N * N + 2 * (N - 2));
  orb_mesh_free(ctx, &ring);
  ring = torus(N, 2.5); /* a small hole of radius 0.5: its tunnel is filled */
  options.handle_size = 0.3;
  assert_int_equal(orb_mesh_repair_with(ctx, &ring, &options), ORB_OK);
  assert_int_equal(ring.handle_count, 1);
  assert_int_equal(ring.handles[0].filled, 1);
  orb_mesh_free(ctx, &ring);
}

/* More handles than labels have bits are closed together, each along one of the shortest loops: the squares of the
 * holes, and the bars between them. */
static void test_many_closed(void **state) {
  (void)state;
  enum { HOLES = 600 };
  const orb_repair_options options = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = 1};
  size_t size;
  char *text = handles_plate(HOLES, &size);
  orb_mesh plate = read_text(text, size);
  assert_int_equal(orb_mesh_repair_with(ctx, &plate, &options), ORB_OK);
  assert_int_equal(plate.handle_count, HOLES);
  assert_int_equal(plate.triangle_count, 2 * plate.vertex_count - 4);
  int longer = 0;
  for (int32_t i = 0; i < plate.handle_count; i++) {
    assert_true(plate.handles[i].area_relative > 0);
    longer += plate.handles[i].count > 4;
  }
  assert_true(longer < HOLES / 20); /* where neighbours have taken all vertices around a hole */
  orb_mesh_free(ctx, &plate);
}

/* Small handles are closed and a large one stays; its loop is reported. */
static void test_mixed(void **state) {
  (void)state;
  orb_mesh ring = torus(80, 1);
  size_t size;
  int made;
  char *text = handles_stitch(&ring, 5, 11, &size, &made);
  assert_int_equal(made, 5);
  orb_mesh_free(ctx, &ring);
  ring = read_text(text, size);
  const orb_repair_options options = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = 0.2};
  check_refused(&ring, &options, 1);
}

/* The length of the shortest cycle that a search with so much work finds. */
static orb_status find_shortest(orb_mesh *mesh, double limit, int64_t allowed, double *length) {
  orb_surface s = {0};
  orb_cycles cycles = {0};
  assert_int_equal(orb_surface_open(ctx, mesh, &s), ORB_OK);
  const orb_status status = orb_cycles_find(&s, limit, ORB_CYCLES_LABELLED, &allowed, &cycles);
  *length = status == ORB_OK && cycles.count > 0 ? cycles.cycle[0].length : INFINITY;
  orb_cycles_free(ctx, &cycles);
  orb_surface_close(&s);
  return status;
}

/* The work of a search grows as the surface, not as its power of 1.5, and one that needs more is refused. */
static void test_work(void **state) {
  (void)state;
  enum { N = 200, TRIANGLES = 2 * N * N };
  const double around = 2 * N * sin(M_PI / N); /* the tube, everywhere */
  double length;
  orb_mesh ring = torus(N, 1);
  assert_int_equal(find_shortest(&ring, 0.95 * around, 64 * TRIANGLES, &length), ORB_OK);
  assert_true(length == INFINITY);
  assert_int_equal(find_shortest(&ring, 10 * around, 64 * TRIANGLES, &length), ORB_OK);
  assert_true(length > 0.999 * around && length < 1.125 * around);
  assert_int_equal(find_shortest(&ring, 10 * around, 3 * TRIANGLES, &length), ORB_E_TOO_LARGE);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "handle_size"));
  orb_mesh_free(ctx, &ring);
}

/* Whenever memory runs out, the call reports it and leaks nothing, which orb_context_destroy() checks. */
static void test_memory(void **state) {
  (void)state;
  size_t size;
  char *text = handles_plate(3, &size);
  for (double handle = 0.001; handle < 2; handle *= 1000) {
    int failures = 0;
    orb_status status = ORB_E_NO_MEMORY;
    for (size_t limit = 4096; status == ORB_E_NO_MEMORY; limit += 128) {
      const orb_context_options options = {.memory_limit = limit, .threads = 1};
      const orb_repair_options repair = {.repair = ORB_REPAIR_CLOSE_HANDLES, .handle_size = handle};
      orb_context *own;
      orb_mesh mesh;
      assert_int_equal(orb_context_create(&options, &own), ORB_OK);
      status = orb_mesh_read(own, (unsigned char *)text, size, ORB_FORMAT_OBJ, &mesh, NULL);
      if (status == ORB_OK) {
        status = orb_mesh_repair_with(own, &mesh, &repair);
        failures += status == ORB_E_NO_MEMORY;
        orb_mesh_free(own, &mesh);
      }
      orb_context_destroy(own);
    }
    assert_int_equal(status, handle < 1 ? ORB_E_NOT_GENUS_ZERO : ORB_OK);
    assert_true(failures > 10);
  }
  free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_spheres), cmocka_unit_test(test_animals),     cmocka_unit_test(test_refused),
      cmocka_unit_test(test_torus),   cmocka_unit_test(test_many),        cmocka_unit_test(test_many_closed),
      cmocka_unit_test(test_mixed),   cmocka_unit_test(test_work),        cmocka_unit_test(test_memory),
      cmocka_unit_test(test_scans),   cmocka_unit_test(test_real_refused)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
