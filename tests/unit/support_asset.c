#include "support_asset.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

int asset_setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
int asset_teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

const char *const asset_names[SYNTHETIC_SHAPES_MAX] = {"one", "two", "two", "four", "five", "six", "seven", "eight"};

glb asset_write(orb_context *ctx, const synthetic *made, const orb_asset_options *options, orb_asset_facts *facts,
                orb_buffer *out) {
  memset(out, 0, sizeof *out);
  orb_status status = orb_asset_write(ctx, &made->supermesh, made->shapes, asset_names, options, facts, out);
  if (status != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
  return glb_open(out);
}

const cJSON *asset_mesh(const glb *file) {
  const cJSON *meshes = cJSON_GetObjectItem(file->json, "meshes");
  assert_int_equal(cJSON_GetArraySize(meshes), 1);
  assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(file->json, "nodes")), 1);
  return cJSON_GetArrayItem(meshes, 0);
}

const cJSON *asset_primitive(const glb *file, int index) {
  return cJSON_GetArrayItem(cJSON_GetObjectItem(asset_mesh(file), "primitives"), index);
}
