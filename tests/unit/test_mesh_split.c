/* Splitting edges of more than two faces: bodies of unit cubes, with known volumes and numbers of pieces. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "orbmorph/format.h"
#include "support_context.h"
#include "support_shapes.h"

enum { N = 4, CORNERS = (N + 1) * (N + 1) * (N + 1) };

/* The cells of a grid, some of them filled. */
typedef struct grid {
  unsigned char filled[N][N][N]; /* x, y, z */
} grid;

static int is_filled(const grid *g, int x, int y, int z) {
  return x >= 0 && y >= 0 && z >= 0 && x < N && y < N && z < N && g->filled[x][y][z];
}

static int volume_of(const grid *g) {
  int sum = 0;
  for (int i = 0; i < N * N * N; i++) {
    sum += g->filled[i / N / N][i / N % N][i % N];
  }
  return sum;
}

/* Pieces of cells that are joined over whole faces. */
static int pieces_of(const grid *g) {
  grid rest = *g;
  int pieces = 0, stack[N * N * N], depth = 0;
  for (int i = 0; i < N * N * N; i++) {
    if (!rest.filled[i / N / N][i / N % N][i % N]) {
      continue;
    }
    pieces++;
    stack[depth++] = i;
    rest.filled[i / N / N][i / N % N][i % N] = 0;
    while (depth) {
      int c = stack[--depth];
      for (int side = 0; side < 6; side++) {
        int at[3] = {c / N / N, c / N % N, c % N};
        at[side / 2] += side % 2 ? 1 : -1;
        if (is_filled(&rest, at[0], at[1], at[2])) {
          rest.filled[at[0]][at[1]][at[2]] = 0;
          stack[depth++] = at[0] * N * N + at[1] * N + at[2];
        }
      }
    }
  }
  return pieces;
}

/* The faces between filled and empty cells, as an OBJ file. All corners of the grid are vertices. Returns the faces. */
static int write_faces(const grid *g, char *out) {
  int faces = 0;
  for (int i = 0; i < CORNERS; i++) {
    out += sprintf(out, "v %d %d %d\n", i / (N + 1) / (N + 1), i / (N + 1) % (N + 1), i % (N + 1));
  }
  for (int i = 0; i < N * N * N * 6; i++) {
    int cell[3] = {i / 6 / N / N, i / 6 / N % N, i / 6 % N}, axis = i % 6 / 2, up = i % 2, other[3];
    memcpy(other, cell, sizeof other);
    other[axis] += up ? 1 : -1;
    if (!is_filled(g, cell[0], cell[1], cell[2]) || is_filled(g, other[0], other[1], other[2])) {
      continue;
    }
    out += sprintf(out, "f");
    for (int k = 0; k < 4; k++) {
      int corner[3] = {cell[0], cell[1], cell[2]}, step = up ? k : 3 - k; /* seen from outside: counter-clockwise */
      corner[axis] += up;
      corner[(axis + 1) % 3] += step == 1 || step == 2;
      corner[(axis + 2) % 3] += step == 2 || step == 3;
      out += sprintf(out, " %d", 1 + (corner[0] * (N + 1) + corner[1]) * (N + 1) + corner[2]);
    }
    out += sprintf(out, "\n");
    faces++;
  }
  return faces;
}

static orb_status repair(const char *text, unsigned how, orb_mesh *mesh) {
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, strlen(text), ORB_FORMAT_OBJ, mesh, NULL), ORB_OK);
  return orb_mesh_repair(ctx, mesh, how);
}

static char text[1 << 16];

/* Cells that touch along an edge and are joined elsewhere: at one end of the edge, or at neither. */
static void test_pinched_columns(void **state) {
  (void)state;
  orb_mesh mesh;
  orb_extent extent;
  grid g = {{{{0}}}};
  g.filled[0][0][0] = g.filled[1][1][0] = 1;
  write_faces(&g, text);
  assert_int_equal(repair(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
  assert_non_null(strstr(orb_context_error(ctx)->detail, "repair=split_nonmanifold"));
  orb_mesh_free(ctx, &mesh);
  assert_int_equal(repair(text, ORB_REPAIR_SPLIT, &mesh), ORB_E_NOT_CONNECTED); /* two cubes */
  assert_int_equal(orb_context_error(ctx)->component_total, 2);
  orb_mesh_free(ctx, &mesh);
  assert_int_equal(repair(text, ORB_REPAIR_SPLIT | ORB_REPAIR_LARGEST_COMPONENT, &mesh), ORB_OK);
  assert_int_equal(mesh.triangle_count, 12);
  orb_mesh_free(ctx, &mesh);

  g.filled[0][0][1] = g.filled[1][0][1] = g.filled[1][1][1] = 1; /* joins them above */
  int faces = write_faces(&g, text);
  assert_int_equal(repair(text, ORB_REPAIR_SPLIT, &mesh), ORB_OK);
  orb_mesh_extent(&mesh, &extent);
  assert_true(fabs(extent.volume - 5) < 1e-12);
  assert_int_equal(mesh.triangle_count, 2 * faces);
  assert_int_equal(shape_repaired(&mesh, "split_nonmanifold"), 1);
  assert_int_equal(mesh.source[mesh.vertex_of_source[0]], 0);
  orb_mesh_free(ctx, &mesh);

  /* a handle that is closed along the edge: the columns join there, since both ends are one fan */
  memset(&g, 0, sizeof g);
  for (int z = 0; z < 3; z++) {
    g.filled[0][0][z] = g.filled[1][1][z] = 1;
    g.filled[1][0][z] = z != 1;
  }
  write_faces(&g, text);
  assert_int_equal(repair(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
  orb_mesh_free(ctx, &mesh);
  assert_int_equal(repair(text, ORB_REPAIR_SPLIT, &mesh), ORB_OK);
  orb_mesh_extent(&mesh, &extent);
  assert_true(fabs(extent.volume - 8) < 1e-12);
  orb_mesh_free(ctx, &mesh);
}

/* For any cells, no edge keeps more than two faces, nothing is added, and the volume is that of the cells. */
static void test_random_cells(void **state) {
  (void)state;
  int spheres = 0, split = 0;
  uint32_t seed = 1;
  for (int round = 0; round < 600; round++) {
    grid g = {{{{0}}}};
    for (int i = 0; i < N * N * N; i++) {
      seed = seed * 1664525 + 1013904223;
      g.filled[i / N / N][i / N % N][i % N] = (seed >> 24) % 8 < 2u + (unsigned)round % 5;
    }
    int faces = write_faces(&g, text);
    orb_mesh mesh;
    orb_extent extent;
    if (faces == 0) {
      continue;
    }
    orb_status status = repair(text, ORB_REPAIR_SPLIT, &mesh);
    assert_true(status == ORB_OK || status == ORB_E_NOT_CONNECTED || status == ORB_E_NOT_GENUS_ZERO);
    if (status == ORB_E_NOT_CONNECTED) {
      assert_true(orb_context_error(ctx)->component_total <= 2 * volume_of(&g)); /* also the walls of cavities */
      assert_true(orb_context_error(ctx)->component_total >= pieces_of(&g) / 2);
    }
    if (status == ORB_OK) {
      orb_topology topology;
      spheres++;
      split += shape_repaired(&mesh, "split_nonmanifold") > 0;
      orb_mesh_extent(&mesh, &extent);
      assert_true(fabs(extent.volume - volume_of(&g)) < 1e-9);
      assert_int_equal(mesh.triangle_count, 2 * faces);
      assert_int_equal(orb_mesh_topology(ctx, &mesh, &topology), ORB_OK);
      assert_true(topology.genus == 0 && topology.components == 1 && topology.nonmanifold_edges == 0 &&
                  topology.nonmanifold_vertices == 0 && topology.boundary_edges == 0);
    }
    orb_mesh_free(ctx, &mesh);
  }
  assert_true(spheres > 50);
  assert_true(split > 10);
}

/* A box with a wall inside, and a fin outside: the flat outer surface stays whole. */
static void test_walls(void **state) {
  (void)state;
  orb_mesh mesh;
  orb_extent extent;
  grid g = {{{{0}}}};
  g.filled[0][0][0] = g.filled[0][0][1] = 1;
  for (int reversed = 0; reversed < 2; reversed++) {
    int faces = write_faces(&g, text), v[4];
    const int corner[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    for (int k = 0; k < 4; k++) {
      v[reversed ? 3 - k : k] = 1 + (corner[k][0] * (N + 1) + corner[k][1]) * (N + 1) + 1;
    }
    sprintf(text + strlen(text), "f %d %d %d %d\n", v[0], v[1], v[2], v[3]);
    assert_int_equal(repair(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
    assert_int_equal(orb_context_error(ctx)->edge_total, 4);
    orb_mesh_free(ctx, &mesh);
    assert_int_equal(repair(text, ORB_REPAIR_SPLIT | ORB_REPAIR_LARGEST_COMPONENT, &mesh), ORB_OK);
    assert_int_equal(mesh.triangle_count, 2 * faces);
    orb_mesh_extent(&mesh, &extent);
    assert_true(fabs(extent.volume - 2) < 1e-12);
    assert_int_equal(shape_repaired(&mesh, "split_nonmanifold"), 4);
    orb_mesh_free(ctx, &mesh);
  }
  int faces = write_faces(&g, text); /* a fin of one triangle on an edge at the middle of a side */
  sprintf(text + strlen(text), "v -3 0.5 1\nf %d %d %d\n", 1 + 1, 1 + (N + 1) + 1, CORNERS + 1);
  assert_int_equal(repair(text, ORB_REPAIR_SPLIT | ORB_REPAIR_LARGEST_COMPONENT, &mesh), ORB_OK);
  assert_int_equal(mesh.triangle_count, 2 * faces);
  orb_mesh_free(ctx, &mesh);
}

/* Two cells that share a vertex only; two tetrahedra with a wall between them. */
static void test_vertex_and_chambers(void **state) {
  (void)state;
  orb_mesh mesh;
  grid g = {{{{0}}}};
  g.filled[0][0][0] = g.filled[1][1][1] = 1;
  write_faces(&g, text);
  assert_int_equal(repair(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
  orb_mesh_free(ctx, &mesh);
  assert_int_equal(repair(text, ORB_REPAIR_SPLIT, &mesh), ORB_E_NOT_CONNECTED);
  orb_mesh_free(ctx, &mesh);

  /* two chambers with a wall between them */
  const char *chambers =
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 0 -1\n"
      "f 1 2 4\nf 2 3 4\nf 3 1 4\nf 2 1 5\nf 3 2 5\nf 1 3 5\nf 1 3 2\n";
  assert_int_equal(repair(chambers, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
  orb_mesh_free(ctx, &mesh);
  assert_int_equal(repair(chambers, ORB_REPAIR_SPLIT | ORB_REPAIR_LARGEST_COMPONENT, &mesh), ORB_OK);
  assert_int_equal(mesh.triangle_count, 6); /* the wall is removed */
  orb_mesh_free(ctx, &mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_pinched_columns), cmocka_unit_test(test_random_cells),
                                     cmocka_unit_test(test_walls), cmocka_unit_test(test_vertex_and_chambers)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
