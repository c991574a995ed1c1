/* The reader of 3MF: units, placement, several parts, colours; and archives that are damaged or made to cost much. */
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
#include "support_zip.h"

#define CORE "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
#define MORE                                                                   \
  "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" " \
  "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" "
/* The tetrahedron (0,0,0) (1,0,0) (0,1,0) (0,0,1), faces outwards. */
#define VERTICES                                                                                                  \
  "<vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/>" \
  "<vertex x=\"0\" y=\"0\" z=\"1.0e0\"/></vertices>"
#define TRIANGLES                                                                           \
  "<triangles><triangle v1=\"0\" v2=\"2\" v3=\"1\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/>" \
  "<triangle v1=\"0\" v2=\"3\" v3=\"2\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/></triangles>"
#define MESH "<mesh>" VERTICES TRIANGLES "</mesh>"
#define OBJECT(id, more) "<object id=\"" #id "\" " more ">" MESH "</object>"

static const char RELATIONS[] =
    "<?xml version=\"1.0\"?><Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
    "<Relationship Id=\"a\" Target=\"/Metadata/x.png\" Type=\"http://other\"/><Relationship Id=\"r\" "
    "Target=\"/3D/Thing.model\" "
    "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";

/* Reads a package of a model and perhaps a second part; the test gives the end of both. */
static orb_status read_package(const char *model, const char *second, int deflated, int is_wide, orb_mesh *out) {
  archive a = {.is_wide = is_wide};
  archive_add(&a, "_rels/.rels", RELATIONS, strlen(RELATIONS), deflated);
  archive_add(&a, "3D/thing.MODEL", model, strlen(model), deflated);
  if (second) {
    archive_add(&a, "3D/Objects/second.model", second, strlen(second), deflated);
  }
  archive_end(&a);
  orb_format format;
  orb_status status = orb_mesh_read(ctx, a.bytes, a.size, ORB_FORMAT_AUTO, out, &format);
  assert_int_equal(format, ORB_FORMAT_3MF);
  archive_free(&a);
  return status;
}

/* The mesh of a model with this text between its tags. */
static orb_mesh read_model(const char *inner, const char *second) {
  char *text = malloc(strlen(inner) + 1000);
  orb_mesh mesh;
  assert_non_null(text);
  sprintf(text, "<?xml version=\"1.0\" encoding=\"UTF-8\"?><model " CORE MORE "%s</model>", inner);
  orb_status status = read_package(text, second, 1, 0, &mesh);
  if (status != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
  free(text);
  return mesh;
}

static void check_extent(orb_mesh *mesh, int triangles, double volume, double low, double high) {
  orb_extent extent;
  assert_int_equal(mesh->triangle_count, triangles);
  orb_mesh_extent(mesh, &extent);
  if (fabs(extent.volume - volume) > 1e-12 * fabs(volume) || fabs(extent.min[0] - low) > 1e-12 * (1 + fabs(low)) ||
      fabs(extent.max[0] - high) > 1e-12 * (1 + fabs(high))) {
    fail_msg("volume %g, x from %g to %g; expected %g, %g, %g", extent.volume, extent.min[0], extent.max[0], volume,
             low, high);
  }
  orb_mesh_free(ctx, mesh);
}

static void test_units(void **state) {
  (void)state;
  static const struct {
    const char *unit;
    double millimetres;
  } units[] = {{"", 1},
               {"unit=\"micron\"", 1e-3},
               {"unit=\"millimeter\"", 1},
               {"unit=\"centimeter\"", 10},
               {"unit=\"inch\"", 25.4},
               {"unit=\"foot\"", 304.8},
               {"unit=\"meter\"", 1000}};
  for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
    char text[2000];
    double u = units[i].millimetres;
    /* the item moves it by 5 units */
    sprintf(text,
            "%s><resources>" OBJECT(7, "") "</resources><build><item objectid=\"7\" "
                                           "transform=\"1 0 0 0 1 0 0 0 1 5 0 0\"/></build>",
            units[i].unit);
    orb_mesh mesh = read_model(text, NULL);
    check_extent(&mesh, 4, u * u * u / 6, 5 * u, 6 * u);
  }
}

/* Points are rows: x' = m00·x + m10·y + m20·z + m30. A component is placed in its object, and the object by the item.
 */
static void test_placement(void **state) {
  (void)state;
  orb_mesh mesh = read_model(
      "><resources>" OBJECT(1, "") "<object id=\"2\"><components><component objectid=\"1\" "
                                   "transform=\"2 0 0 0 2 0 0 0 2 1 0 0\"/></components></object></resources><build>"
                                   "<item objectid=\"2\" transform=\"0 1 0 -1 0 0 0 0 1 0 0 0\"/></build>",
      NULL);
  /* twice as large and moved to x = 1 … 3, then rotated by 90° about z: x' = −y, y' = x */
  assert_true(mesh.positions[0] == 0 && mesh.positions[1] == 1);
  assert_true(mesh.positions[3] == 0 && mesh.positions[4] == 3);
  check_extent(&mesh, 4, 8.0 / 6, -2, 0);
  /* a mirror reverses the triangles, so that they still face outwards */
  mesh = read_model("><resources>" OBJECT(1, "") "</resources><build><item objectid=\"1\" "
                                                 "transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></build>",
                    NULL);
  check_extent(&mesh, 4, 1.0 / 6, -1, 0);
  /* two items, two pieces with names */
  mesh = read_model("><resources>" OBJECT(1, "name=\"left\"") OBJECT(
                        2, "name=\"right\"") "</resources><build><item objectid=\"1\"/><item objectid=\"2\" "
                                             "transform=\"1 0 0 0 1 0 0 0 1 9 0 0\"/></build>",
                    NULL);
  assert_int_equal(mesh.object_count, 2);
  assert_string_equal(mesh.objects[0].name, "left");
  assert_string_equal(mesh.objects[1].name, "right");
  assert_int_equal(mesh.objects[1].first_triangle, 4);
  check_extent(&mesh, 8, 2.0 / 6, 0, 10);
  /* no build: each object that is not a component, once */
  mesh = read_model("><resources>" OBJECT(1, "") "<object id=\"2\"><components><component objectid=\"1\"/>"
                                                 "</components></object></resources><build/>",
                    NULL);
  check_extent(&mesh, 4, 1.0 / 6, 0, 1);
}

/* The production extension: components in files of their own, with a unit and ids of their own. */
static void test_parts(void **state) {
  (void)state;
  orb_mesh mesh = read_model(
      "><resources><object id=\"1\" name=\"whole\"><components><component objectid=\"1\" "
      "p:path=\"/3D/Objects/Second.model\"/></components></object></resources><build><item objectid=\"1\"/></build>",
      "<model unit=\"centimeter\" " CORE "><resources>" OBJECT(1, "") "</resources><build/></model>");
  assert_int_equal(mesh.object_count, 1);
  assert_string_equal(mesh.objects[0].name, "whole");
  check_extent(&mesh, 4, 1000.0 / 6, 0, 10);
}

static void test_archives(void **state) {
  (void)state;
  static const char model[] =
      "<model " CORE "><resources>" OBJECT(1, "") "</resources><build><item objectid=\"1\"/></build></model>";
  for (int i = 0; i < 4; i++) {
    orb_mesh mesh;
    assert_int_equal(read_package(model, NULL, i & 1, i >> 1, &mesh), ORB_OK);
    check_extent(&mesh, 4, 1.0 / 6, 0, 1);
  }
  /* UTF-16, which XML allows */
  static const char wide[] = "\xff\xfe";
  char text[4 * sizeof model] = "";
  size_t size = 2;
  memcpy(text, wide, 2);
  for (size_t i = 0; i + 1 < sizeof model; i++) {
    text[size++] = model[i];
    text[size++] = 0;
  }
  archive a = {0};
  archive_add(&a, "3D/3dmodel.model", text, size, 1); /* no relations: the usual path */
  archive_end(&a);
  orb_mesh mesh;
  assert_int_equal(orb_mesh_read(ctx, a.bytes, a.size, ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
  check_extent(&mesh, 4, 1.0 / 6, 0, 1);
  archive_free(&a);
}

static double linear(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

static void test_colours(void **state) {
  (void)state;
  orb_mesh mesh = read_model(
      "><resources><basematerials id=\"1\"><base name=\"PLA\" displaycolor=\"#FF8000\"/>"
      "<base name=\"ABS\" displaycolor=\"#0000FF80\"/></basematerials>"
      "<m:colorgroup id=\"2\"><m:color color=\"#00FF00\"/></m:colorgroup><m:texture2dgroup id=\"3\" texid=\"9\"/>"
      "<object id=\"5\" pid=\"1\" pindex=\"1\"><mesh>" VERTICES
      "<triangles><triangle v1=\"0\" v2=\"2\" v3=\"1\" pid=\"1\" p1=\"0\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/>"
      "<triangle v1=\"0\" v2=\"3\" v3=\"2\" pid=\"2\" p1=\"0\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/></triangles>"
      "</mesh></object></resources><build><item objectid=\"5\"/></build>",
      NULL);
  static const struct {
    const char *name;
    double srgb[4];
  } want[4] = {{"PLA", {1, 128.0 / 255, 0, 1}},
               {"ABS", {0, 0, 1, 128.0 / 255}},
               {"#00FF00FF", {0, 1, 0, 1}},
               {"ABS", {0, 0, 1, 128.0 / 255}}};
  assert_int_equal(mesh.material_count, 3);
  for (int t = 0; t < 4; t++) {
    const orb_material *material = &mesh.materials[mesh.material[t]];
    assert_string_equal(material->name, want[t].name);
    for (int k = 0; k < 4; k++) {
      double expected = k == 3 ? want[t].srgb[k] : linear(want[t].srgb[k]);
      assert_true(fabs((double)material->base_color[k] - expected) < 1e-6);
    }
  }
  assert_int_equal(mesh.dropped_count, 1);
  assert_string_equal(mesh.dropped[0].what, "texture2dgroup");
  orb_mesh_free(ctx, &mesh);
}

/* Refused files, and a word of the message that says why. */
static void test_errors(void **state) {
  (void)state;
  static const struct {
    const char *model, *word;
    orb_status status;
  } rows[] = {
      {"<!DOCTYPE model [<!ENTITY a \"aaaaaaaa\"><!ENTITY b \"&a;&a;&a;\">]><model " CORE ">&b;</model>",
       "document type", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources>", "well-formed", ORB_E_MALFORMED_MESH},
      {"<model unit=\"mile\" " CORE "/>", "unit \"mile\"", ORB_E_MALFORMED_MESH},
      {"<html/>", "not a 3MF model", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources>" OBJECT(1, "") OBJECT(1, "") "</resources></model>", "two resources",
       ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources><object/></resources></model>", "lacks its attribute \"id\"", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><build><item objectid=\"3\"/></build></model>", "the id 3", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources/><build/></model>", "no faces", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources><object id=\"1\"><mesh><vertices><vertex x=\"1\" y=\"2\"/>", "coordinate \"z\"",
       ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources><object id=\"1\"><mesh><vertices><vertex x=\"1,5\" y=\"2\" z=\"3\"/>", "1,5",
       ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources><object id=\"1\"><mesh>" VERTICES
       "<triangles><triangle v1=\"0\" v2=\"1\" v3=\"4\"/>",
       "beyond the last", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources><object id=\"1\"><mesh>" VERTICES
       "<triangles><triangle v1=\"0\" v2=\"1\" v3=\"-1\"/>",
       "wrong number", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><resources><object id=\"1\"><components><component objectid=\"1\"/></components></object>"
       "</resources><build><item objectid=\"1\"/></build></model>",
       "contain themselves", ORB_E_MALFORMED_MESH},
      {"<model " CORE MORE "><resources><object id=\"1\"><components><component objectid=\"1\" p:path=\"/no.model\"/>",
       "no.model", ORB_E_MALFORMED_MESH},
      {"<model " CORE "><build><item objectid=\"1\" transform=\"1 0 0\"/></build></model>", "twelve numbers",
       ORB_E_MALFORMED_MESH},
  };
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    orb_mesh mesh;
    orb_status status = read_package(rows[i].model, NULL, 1, 0, &mesh);
    if (status != rows[i].status || !strstr(orb_context_error(ctx)->detail, rows[i].word)) {
      fail_msg("row %zu: status %d, %s", i, (int)status, orb_context_error(ctx)->detail);
    }
  }
}

/* Adds repeated text. */
static char *repeated(const char *before, const char *middle, int count, const char *after) {
  size_t length = strlen(middle), size = strlen(before);
  char *text = malloc(size + length * (size_t)count + strlen(after) + 1);
  assert_non_null(text);
  memcpy(text, before, size);
  for (int i = 0; i < count; i++, size += length) {
    memcpy(text + size, middle, length);
  }
  strcpy(text + size, after);
  return text;
}

/* Files that unpack, nest or multiply to much more than their size. */
static void test_bombs(void **state) {
  (void)state;
  static const char tail[] = "</resources><build><item objectid=\"1\"/></build></model>";
  char nested[8000] = "<model " CORE "><resources>" OBJECT(1, "");
  for (int i = 2; i < 30; i++) { /* each shows the previous one twice */
    sprintf(
        nested + strlen(nested),
        "<object id=\"%d\"><components><component objectid=\"%d\"/><component objectid=\"%d\"/></components></object>",
        i, i - 1, i - 1);
  }
  strcat(nested, "</resources><build><item objectid=\"29\"/></build></model>");
  char empty[8000] = "<model " CORE "><resources><object id=\"1\"/>"; /* and without any mesh */
  strcat(empty, strstr(nested, "<object id=\"2\""));
  char *rows[] = {
      repeated("<model " CORE "><resources>" OBJECT(1, ""), "          ", 3000000, tail),
      repeated("<model " CORE "><resources><object id=\"1\"><mesh>" VERTICES "<triangles>",
               "<triangle v1=\"0\" v2=\"1\" v3=\"2\"/>", 100000, "</triangles></mesh></object></resources></model>"),
      repeated("<model " CORE "><resources>" OBJECT(1, ""), "<deep>", 2000, ""),
      repeated("<model " CORE "><resources>" OBJECT(1, "") "<x a=\"", "aaaaaaaaaa", 100000, "\"/></resources></model>"),
      repeated("<model " CORE "><resources>" OBJECT(1, "") "</resources><build>", "<item objectid=\"1\"/>", 5000,
               "</build></model>"),
      nested,
      empty,
  };
  static const char *const words[] = {"unpacks to more", "justifies", "nests deeper", "has more than",
                                      "justifies",       "justifies", "justifies"};
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    orb_mesh mesh;
    orb_status status = read_package(rows[i], NULL, 1, 0, &mesh);
    if (status == ORB_OK || !strstr(orb_context_error(ctx)->detail, words[i])) {
      fail_msg("row %zu: status %d, %s", i, (int)status, orb_context_error(ctx)->detail);
    }
    if (rows[i] != nested && rows[i] != empty) {
      free(rows[i]);
    }
  }
}

/* A comment, an instruction and a tag of exactly 64 KiB are accepted. With one byte more they are refused, wherever
 * they are. */
static void test_tokens(void **state) {
  (void)state;
  enum { MOST = 1 << 16 };
  static const struct {
    const char *before, *after;
  } tokens[] = {{"<!--", "-->"}, {"<?i ", "?>"}, {"<x a=\"", "\"/>"}, {"<x a=\"", "\"></x>"}};
  for (size_t kind = 0; kind < sizeof tokens / sizeof *tokens; kind++) {
    for (int i = 0; i < 6; i++) {
      const int more = i & 1, spaces = i / 2 * 30000;
      const char *end = strchr(tokens[kind].after, '>') + 1;
      const size_t frame = strlen(tokens[kind].before) + (size_t)(end - tokens[kind].after);
      char *text = malloc(4 * MOST), *at = text;
      orb_mesh mesh;
      assert_non_null(text);
      at += sprintf(at, "<model " CORE "><resources>" OBJECT(1, "") "%*s%s", spaces, "", tokens[kind].before);
      memset(at, 'a', MOST + (size_t)more - frame);
      at += MOST + (size_t)more - frame;
      sprintf(at, "%s</resources><build><item objectid=\"1\"/></build></model>", tokens[kind].after);
      orb_status status = read_package(text, NULL, 1, 0, &mesh);
      free(text);
      if (more) {
        assert_int_not_equal(status, ORB_OK);
        assert_non_null(strstr(orb_context_error(ctx)->detail, "more than 65536 bytes"));
      } else {
        assert_int_equal(status, ORB_OK);
        orb_mesh_free(ctx, &mesh);
      }
    }
  }
}

/* Every prefix of a file, and the file with any byte changed, gives a mesh or an error. */
static void test_damage(void **state) {
  (void)state;
  static const char model[] =
      "<model " CORE "><resources>" OBJECT(1, "") "</resources><build><item objectid=\"1\"/></build></model>";
  for (int kind = 0; kind < 4; kind++) {
    archive a = {.is_wide = kind >> 1};
    archive_add(&a, "_rels/.rels", RELATIONS, strlen(RELATIONS), kind & 1);
    archive_add(&a, "3D/Thing.model", model, strlen(model), kind & 1);
    archive_end(&a);
    for (size_t i = 0; i < a.size; i++) {
      orb_mesh mesh;
      unsigned char *copy = malloc(i + 1); /* so that a sanitizer sees the end */
      assert_non_null(copy);
      memcpy(copy, a.bytes, i);
      assert_int_not_equal(orb_mesh_read(ctx, copy, i, ORB_FORMAT_3MF, &mesh, NULL), ORB_OK);
      free(copy);
      a.bytes[i] ^= (unsigned char)(1 + 37 * i);
      if (orb_mesh_read(ctx, a.bytes, a.size, ORB_FORMAT_3MF, &mesh, NULL) == ORB_OK) {
        assert_int_equal(mesh.triangle_count, 4);
        orb_mesh_free(ctx, &mesh);
      }
      a.bytes[i] ^= (unsigned char)(1 + 37 * i);
    }
    archive_free(&a);
  }
}

/* Whenever memory runs out, reading fails and frees everything. */
static void test_budget(void **state) {
  (void)state;
  static const char model[] =
      "<model " CORE "><resources>" OBJECT(1, "") "</resources><build><item objectid=\"1\"/></build></model>";
  archive a = {0};
  archive_add(&a, "_rels/.rels", RELATIONS, strlen(RELATIONS), 1);
  archive_add(&a, "3D/Thing.model", model, strlen(model), 1);
  archive_end(&a);
  int refused = 0;
  for (size_t limit = 16 << 10;; limit += 4 << 10) {
    orb_context *own;
    orb_mesh mesh;
    assert_int_equal(orb_context_create(&(orb_context_options){.memory_limit = limit, .threads = 1}, &own), ORB_OK);
    orb_status status = orb_mesh_read(own, a.bytes, a.size, ORB_FORMAT_AUTO, &mesh, NULL);
    if (status == ORB_OK) {
      orb_mesh_free(own, &mesh);
    } else {
      assert_int_equal(status, ORB_E_NO_MEMORY);
      refused++;
    }
    orb_context_destroy(own); /* asserts that all is freed */
    if (status == ORB_OK) {
      break;
    }
  }
  assert_true(refused > 10);
  archive_free(&a);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_units),    cmocka_unit_test(test_placement), cmocka_unit_test(test_parts),
      cmocka_unit_test(test_archives), cmocka_unit_test(test_colours),   cmocka_unit_test(test_errors),
      cmocka_unit_test(test_bombs),    cmocka_unit_test(test_tokens),    cmocka_unit_test(test_damage),
      cmocka_unit_test(test_budget),
  };
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
