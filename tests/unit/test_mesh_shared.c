/* Compares every real mesh with index.csv, whose figures other programs computed: accepted, or refused for the stated
 * reason; vertices and faces after repair, boundary, genus. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "orbmorph/format.h"
#include "support_shapes.h"
#include "support_shared.h"

enum { COLUMNS = 48 };

static char *cell[COLUMNS];

/* Splits one line of CSV in place; quotes keep commas. */
static int split(char *line) {
  int count = 0;
  char *p = line;
  while (count < COLUMNS) {
    int quoted = *p == '"';
    p += quoted;
    cell[count++] = p;
    while (*p && *p != '\n' && (quoted ? *p != '"' : *p != ',')) {
      p++;
    }
    char end = *p;
    if (quoted && end == '"') {
      *p++ = 0;
      end = *p;
    }
    *p = 0;
    if (end != ',') {
      break;
    }
    p++;
  }
  return count;
}

static char header[4096];
static int column(const char *name) {
  static char names[4096];
  static char *at[COLUMNS];
  static int count;
  if (!count) {
    memcpy(names, header, sizeof names);
    count = split(names);
    memcpy(at, cell, sizeof at);
  }
  for (int i = 0; i < count; i++) {
    if (strcmp(at[i], name) == 0) {
      return i;
    }
  }
  fail_msg("index.csv has no column %s", name);
  return 0;
}

/* What a reason in the index requires. */
static int fits(const char *reason, const orb_error *e) {
  switch (e->status) {
    case ORB_E_MALFORMED_MESH:
      return (e->line > 0 || e->offset >= 0) &&
             (strstr(reason, "empty") || strstr(reason, "malformed") || strstr(reason, "truncated") ||
              strstr(reason, "out of range") || strstr(reason, "no faces") || strstr(reason, "cut after") ||
              strstr(reason, "shorter than"));
    case ORB_E_NOT_CLOSED:
      return strstr(reason, "boundary") && e->boundary_loops > 0 && e->edge_count > 0;
    case ORB_E_NOT_MANIFOLD:
      return (strstr(reason, "non-manifold edge") && e->edge_count > 0) ||
             (strstr(reason, "sharing a face") && e->edge_count > 0) ||
             (strstr(reason, "non-manifold vertex") && e->vertex_count > 0);
    case ORB_E_NOT_ORIENTABLE:
      return strstr(reason, "non-orientable") != NULL;
    case ORB_E_NOT_CONNECTED:
      return strstr(reason, "two closed components") && e->component_count == 2;
    case ORB_E_NOT_GENUS_ZERO: {
      char text[32];
      snprintf(text, sizeof text, "genus %d", (int)e->genus);
      return strcmp(reason, text) == 0;
    }
    case ORB_E_NOT_FINITE:
      return strstr(reason, "NaN") && e->vertex_count > 0;
    default:
      return 0;
  }
}

static orb_status read_repaired(orb_context *ctx, const unsigned char *bytes, size_t size, unsigned repair,
                                orb_mesh *mesh, orb_format *format) {
  orb_status status = orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, mesh, format);
  if (status == ORB_OK) {
    status = orb_mesh_repair(ctx, mesh, repair);
    if (status != ORB_OK) {
      orb_mesh_free(ctx, mesh);
    }
  }
  return status;
}

static void check_mended(orb_context *ctx, const orb_mesh *mesh) {
  orb_topology topology;
  orb_extent extent;
  assert_int_equal(orb_mesh_topology(ctx, mesh, &topology), ORB_OK);
  assert_int_equal(topology.components, 1);
  assert_int_equal(topology.boundary_edges, 0);
  assert_int_equal(topology.nonmanifold_edges, 0);
  assert_int_equal(topology.nonmanifold_vertices, 0);
  assert_true(topology.consistent);
  assert_true(topology.genus == 0);
  assert_int_equal(mesh->triangle_count, 2 * mesh->vertex_count - 4);
  orb_mesh_extent(mesh, &extent);
  assert_true(extent.volume >= 0);
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    assert_in_range(mesh->source[v], 0, mesh->file_vertex_count - 1);
  }
  for (int32_t f = 0; f < mesh->file_vertex_count; f++) {
    int32_t v = mesh->vertex_of_source[f];
    assert_true(v >= -1 && v < mesh->vertex_count);
  }
  int32_t *twin = malloc(3 * (size_t)mesh->triangle_count * sizeof *twin);
  assert_int_equal(orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin), ORB_OK);
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    assert_int_equal(twin[twin[h]], h);
    assert_int_equal(mesh->triangles[h], mesh->triangles[orb_next(twin[h])]);
  }
  free(twin);
}

static void check_row(orb_context *ctx) {
  const char *name = cell[column("name")], *bytes_column = cell[column("bytes")];
  const char *folder = cell[1];
  const char *fix = cell[column("fix")], *reason = cell[column("reason")], *form = cell[column("format")];
  size_t size;
  unsigned char *bytes = shared_bytes(folder, name, &size);
  assert_non_null(bytes);
  assert_int_equal(size, strtoul(bytes_column, NULL, 10));
  orb_mesh mesh;
  orb_format format;
  orb_status status = read_repaired(ctx, bytes, size, ORB_REPAIR_SAFE, &mesh, &format);
  if (strcmp(folder, "bad") == 0) {
    if (status == ORB_OK || !fits(reason, orb_context_error(ctx))) {
      fail_msg("%s: %s does not fit \"%s\"", name, orb_status_name(status), reason);
    }
  } else {
    int largest = strcmp(fix, "largest") == 0;
    if (largest) {
      assert_int_equal(status, ORB_E_NOT_CONNECTED);
      status = read_repaired(ctx, bytes, size, ORB_REPAIR_LARGEST_COMPONENT, &mesh, &format);
    }
    if (status != ORB_OK) {
      fail_msg("%s: %s: %s", name, orb_status_name(status), orb_context_error(ctx)->detail);
    }
    assert_string_equal(orb_format_name(format), form);
    int split_fix = strcmp(fix, "split") == 0;
    assert_int_equal(mesh.vertex_count, atoi(cell[column("usable_v")]) + split_fix);
    assert_int_equal(mesh.triangle_count, atoi(cell[column("usable_f")]));
    check_mended(ctx, &mesh);
    assert_true((shape_repaired(&mesh, "weld") > 0) == (strncmp(fix, "weld", 4) == 0 || format == ORB_FORMAT_STL));
    assert_true((shape_repaired(&mesh, "reorient") > 0) == (strcmp(fix, "reorient") == 0));
    assert_int_equal(shape_repaired(&mesh, "split-vertices"), split_fix);
    assert_true((shape_repaired(&mesh, "largest_component") > 0) == largest);
    assert_int_equal(shape_repaired(&mesh, "degenerate-faces"), strstr(fix, "drop200") ? 200 : 0);
    orb_mesh_free(ctx, &mesh);
    if (strcmp(folder, "weldable") == 0) {
      assert_int_not_equal(read_repaired(ctx, bytes, size, ORB_REPAIR_NONE, &mesh, &format), ORB_OK);
    } else if (format != ORB_FORMAT_STL) {
      assert_int_equal(read_repaired(ctx, bytes, size, ORB_REPAIR_NONE, &mesh, &format), ORB_OK);
      orb_mesh_free(ctx, &mesh);
    }
  }
  free(bytes);
}

static void test_index(void **state) {
  (void)state;
  FILE *file = fopen(ORB_SHARED_MESHES "/index.csv", "r");
  assert_non_null(file);
  assert_non_null(fgets(header, sizeof header, file));
  (void)column("name");
  orb_context *ctx;
  assert_int_equal(orb_context_create(NULL, &ctx), ORB_OK);
  char line[4096];
  int rows = 0;
  while (fgets(line, sizeof line, file)) {
    split(line);
    check_row(ctx);
    rows++;
  }
  fclose(file);
  orb_context_destroy(ctx);
  assert_true(rows > 40);
}

int main(void) {
  FILE *file = fopen(ORB_SHARED_MESHES "/index.csv", "r");
  if (!file) {
    printf("skipped: no meshes at %s\n", ORB_SHARED_MESHES);
    return 77;
  }
  fclose(file);
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_index)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
