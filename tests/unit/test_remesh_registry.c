/* Compares the list of remesh methods with every other list that must name them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>
#include <cmocka.h>

#include "orbmorph/remesh.h"
#include "remesh/registry.h"
#include "support_remesh.h"

static char *read_source(const char *path) {
  char name[1024];
  snprintf(name, sizeof name, ORB_SOURCES "/%s", path);
  FILE *file = fopen(name, "rb");
  assert_non_null(file);
  assert_int_equal(fseek(file, 0, SEEK_END), 0);
  long size = ftell(file);
  assert_true(size > 0);
  rewind(file);
  char *text = malloc((size_t)size + 1);
  assert_non_null(text);
  assert_int_equal(fread(text, 1, (size_t)size, file), size);
  text[size] = 0;
  fclose(file);
  return text;
}

static void names_and_methods_correspond(void **state) {
  (void)state;
  for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
    orb_remesh_method method = ORB_REMESH_METHOD_COUNT;
    const char *name = orb_remesh_method_name((orb_remesh_method)i);
    assert_non_null(name);
    assert_true(orb_remesh_method_of_name(name, &method));
    assert_int_equal(method, i);
  }
  assert_string_equal(orb_remesh_method_name(ORB_REMESH_CONVEX_HULL), "convex-hull");
  assert_null(orb_remesh_method_name(ORB_REMESH_METHOD_COUNT));
  assert_null(orb_remesh_method_name((orb_remesh_method)-1));
  orb_remesh_method method = ORB_REMESH_OVERLAY;
  assert_false(orb_remesh_method_of_name("convex hull", &method));
  assert_int_equal(method, ORB_REMESH_OVERLAY);
}

static void every_listed_method_is_built(void **state) {
  (void)state;
  for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
    assert_true(orb_remesh_available((orb_remesh_method)i));
  }
  assert_false(orb_remesh_available(ORB_REMESH_METHOD_COUNT));
  assert_null(orb_remesh_function(ORB_REMESH_METHOD_COUNT));
  assert_int_equal(orb_remesh_heeds(ORB_REMESH_METHOD_COUNT), 0);
}

/* Remeshes two rough balls. Returns the number of triangles, −1 if the options are refused. */
static int64_t triangles_with(orb_remesh_method method, double tolerance, int64_t max_triangles) {
  orb_context *ctx = remesh_context(1);
  orb_aligned_shape shapes[2];
  orb_remesh_options options;
  orb_supermesh mesh;
  sphere_shape(ctx, SPHERE_ICO, 3, 0.2, 1, &shapes[0]);
  sphere_shape(ctx, SPHERE_OCTA, 3, 0.2, 2, &shapes[1]);
  orb_remesh_defaults(&options);
  options.method = method;
  options.tolerance = tolerance;
  options.max_triangles = max_triangles;
  orb_status status = orb_remesh(ctx, shapes, 2, 0, &options, &mesh);
  int64_t triangles = status == ORB_OK ? mesh.triangle_count : -1;
  assert_true(status == ORB_OK || status == ORB_E_BAD_OPTION);
  orb_supermesh_free(ctx, &mesh);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
  return triangles;
}

/* An option that a method heeds changes its result, or is refused; one that it does not heed changes nothing. */
static void methods_heed_what_the_registry_says(void **state) {
  (void)state;
  for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
    orb_remesh_method method = (orb_remesh_method)i;
    int64_t triangles = triangles_with(method, 0.001, 0);
    assert_true(triangles > 20);
    assert_int_equal(triangles_with(method, 0.1, 0) != triangles,
                     (orb_remesh_heeds(method) & ORB_REMESH_HEEDS_TOLERANCE) != 0);
    assert_int_equal(triangles_with(method, 0.001, 20) != triangles,
                     (orb_remesh_heeds(method) & ORB_REMESH_HEEDS_MAX_TRIANGLES) != 0);
  }
}

static int is_the_list(const cJSON *array) {
  int same = cJSON_GetArraySize(array) == ORB_REMESH_METHOD_COUNT;
  for (int i = 0; same && i < ORB_REMESH_METHOD_COUNT; i++) {
    same = strcmp(cJSON_GetArrayItem(array, i)->valuestring, orb_remesh_method_name((orb_remesh_method)i)) == 0;
  }
  return same;
}

/* Compares every enumeration that starts like the list with the list. Returns their number; *others: those that differ,
 * each is printed. */
static int check_enumerations(const cJSON *node, int *others) {
  int found = 0;
  if (node->string && strcmp(node->string, "enum") == 0 && cJSON_IsArray(node)) {
    const cJSON *first = cJSON_GetArrayItem(node, 0);
    if (cJSON_IsString(first) && strcmp(first->valuestring, orb_remesh_method_name(0)) == 0) {
      found++;
      if (!is_the_list(node)) {
        print_error("api/openapi.json: an enumeration of %d methods is not the list of %d\n", cJSON_GetArraySize(node),
                    (int)ORB_REMESH_METHOD_COUNT);
        ++*others;
      }
    }
  }
  for (const cJSON *child = node->child; child; child = child->next) {
    found += check_enumerations(child, others);
  }
  return found;
}

static void the_api_document_names_the_same_methods(void **state) {
  (void)state;
  char *text = read_source("api/openapi.json");
  cJSON *document = cJSON_Parse(text);
  int others = 0;
  assert_non_null(document);
  assert_true(check_enumerations(document, &others) > 0);
  assert_int_equal(others, 0);
  cJSON_Delete(document);
  free(text);
}

/* Files that list the methods by hand. */
static void the_clients_name_every_method(void **state) {
  (void)state;
  static const struct {
    const char *path, *quote;
  } files[] = {{"client/js/src/api.d.ts", "'"},
               {"client/web/src/url.ts", "'"},
               {"client/web/src/ui/shapes.tsx", "\""},
               {"deploy/man/orbmorph.1", " "}};
  int missing = 0;
  for (size_t f = 0; f < sizeof files / sizeof *files; f++) {
    char *text = read_source(files[f].path);
    for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
      char quoted[64];
      snprintf(quoted, sizeof quoted, "%s%s%s", files[f].quote, orb_remesh_method_name((orb_remesh_method)i),
               files[f].quote);
      if (!strstr(text, quoted)) {
        print_error("%s does not name the remesh method %s\n", files[f].path, quoted);
        missing++;
      }
    }
    free(text);
  }
  assert_int_equal(missing, 0);
}

/* The command line knows only HTTP: its words stand in its own table, in the order of the list. */
static void the_command_line_takes_the_same_words(void **state) {
  (void)state;
  char words[256] = "\"";
  for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
    size_t used = strlen(words);
    snprintf(words + used, sizeof words - used, "%s%s%s", i ? " " : "", orb_remesh_method_name((orb_remesh_method)i),
             i + 1 < ORB_REMESH_METHOD_COUNT ? "" : "\"");
  }
  char *text = read_source("client/cli/options.c");
  if (!strstr(text, words)) {
    fail_msg("client/cli/options.c does not have %s", words);
  }
  free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(names_and_methods_correspond),        cmocka_unit_test(every_listed_method_is_built),
      cmocka_unit_test(methods_heed_what_the_registry_says), cmocka_unit_test(the_api_document_names_the_same_methods),
      cmocka_unit_test(the_clients_name_every_method),       cmocka_unit_test(the_command_line_takes_the_same_words),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
