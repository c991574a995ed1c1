/* Materials of glTF files: what the reader takes, what it omits and reports, and what reaches the asset. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "orbmorph/format.h"
#include "support_context.h"
#include "support_supermesh.h"

/* A red pixel, by zlib, as base64. */
#define PNG \
  "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC"
/* Three places, and two sets of texture coordinates for them: 0 everywhere and 2 everywhere. */
#define DATA                                                                                      \
  "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA" \
  "AAAAQAAAAEAAAABAAAAAQAAAAEAAAABA"

/* A triangle whose material has these members. */
static void read_material(const char *members, orb_mesh *mesh) {
  static char text[1 << 16];
  int length = snprintf(
      text, sizeof text,
      "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1,"
      "\"TEXCOORD_1\":2},\"material\":0}]}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,"
      "\"type\":\"VEC3\"},{\"bufferView\":1,\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"},{\"bufferView\":2,"
      "\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},{"
      "\"buffer\":0,\"byteOffset\":36,\"byteLength\":24},{\"buffer\":0,\"byteOffset\":60,\"byteLength\":24}],"
      "\"buffers\":[{\"byteLength\":84,\"uri\":\"" DATA
      "\"}],\"textures\":[{\"source\":0},{\"source\":1},{\"source\":2"
      "},{\"extensions\":{\"EXT_texture_webp\":{\"source\":0}}}],\"images\":[{\"uri\":\"" PNG
      "\"},{\"uri\":\"wood.png\""
      "},{\"uri\":\"" PNG "\"}],\"materials\":[{\"name\":\"skin\",%s}]}",
      members);
  assert_in_range(length, 1, sizeof text - 1);
  if (orb_mesh_read(ctx, (unsigned char *)text, (size_t)length, ORB_FORMAT_AUTO, mesh, NULL) != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
}

static const orb_material_value *value_of(const orb_mesh *mesh, orb_material_member member) {
  const orb_material *m = &mesh->materials[0];
  for (int32_t v = m->first_value; v < m->first_value + m->value_count; v++) {
    if (mesh->material_values[v].member == member) {
      return &mesh->material_values[v];
    }
  }
  return NULL;
}

static double number_of(const orb_mesh *mesh, orb_material_member member, int index) {
  const orb_material_value *value = value_of(mesh, member);
  assert_non_null(value);
  return value->number[index];
}

static const char *why_dropped(const orb_mesh *mesh, const char *what) {
  for (int32_t i = 0; i < mesh->dropped_count; i++) {
    if (strcmp(mesh->dropped[i].what, what) == 0) {
      return mesh->dropped[i].why;
    }
  }
  return NULL;
}

static void test_members_are_read(void **state) {
  (void)state;
  orb_mesh mesh, copy;
  read_material(
      "\"alphaMode\":\"MASK\",\"alphaCutoff\":0.25,\"doubleSided\":true,\"emissiveFactor\":[0.5,2,0.125],"
      "\"normalTexture\":{\"index\":0,\"scale\":-1.5},\"occlusionTexture\":{\"index\":2,\"strength\":0.75},"
      "\"extensions\":{\"KHR_materials_ior\":{\"ior\":0},\"KHR_materials_clearcoat\":{\"clearcoatFactor\":0.5,"
      "\"clearcoatTexture\":{\"index\":0,\"extensions\":{\"KHR_texture_transform\":{\"offset\":[0.1,0.2],"
      "\"rotation\":0.5,\"scale\":[2,3]}}}}}",
      &mesh);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_ALPHA_MODE, 0), 1, 0);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_ALPHA_CUTOFF, 0), 0.25, 0);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_DOUBLE_SIDED, 0), 1, 0);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_EMISSIVE, 0), 0.5, 0);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_EMISSIVE, 1), 1, 0); /* within its limits */
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_NORMAL_TEXTURE, 0), -1.5, 0);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_OCCLUSION_TEXTURE, 0), 0.75, 0);
  assert_float_equal(number_of(&mesh, ORB_MATERIAL_IOR, 0), 0, 0);
  const orb_material_value *coat = value_of(&mesh, ORB_MATERIAL_CLEARCOAT_TEXTURE);
  assert_non_null(coat);
  assert_true(coat->texture.is_transformed);
  assert_float_equal(coat->texture.offset[1], 0.2, 0);
  assert_float_equal(coat->texture.rotation, 0.5, 0);
  assert_float_equal(coat->texture.scale[0], 2, 0);
  assert_false(value_of(&mesh, ORB_MATERIAL_NORMAL_TEXTURE)->texture.is_transformed);
  assert_int_equal(mesh.image_count, 2);
  for (int32_t v = 1; v < mesh.materials[0].value_count; v++) {
    assert_true(mesh.material_values[v - 1].member < mesh.material_values[v].member);
  }
  assert_int_equal(mesh.dropped_count, 1); /* TEXCOORD_1 */
  assert_int_equal(orb_mesh_copy(ctx, &mesh, &copy), ORB_OK);
  assert_int_equal(copy.material_value_count, mesh.material_value_count);
  assert_string_equal(copy.dropped[0].what, "TEXCOORD_1");
  orb_mesh_free(ctx, &mesh);
  assert_float_equal(number_of(&copy, ORB_MATERIAL_ALPHA_CUTOFF, 0), 0.25, 0);
  orb_mesh_free(ctx, &copy);
}

/* Members that state the default, or have no effect, do not count as values. */
static void test_defaults_are_no_values(void **state) {
  (void)state;
  orb_mesh mesh;
  read_material(
      "\"alphaMode\":\"OPAQUE\",\"alphaCutoff\":0.5,\"doubleSided\":false,\"emissiveFactor\":[0,0,0],"
      "\"extensions\":{\"KHR_materials_emissive_strength\":{\"emissiveStrength\":5}},"
      "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,\"extensions\":{\"KHR_texture_transform\":"
      "{\"scale\":[1,1]}}}}",
      &mesh);
  assert_int_equal(mesh.material_value_count, 0);
  assert_int_equal(mesh.materials[0].base_texture.image, 0);
  assert_false(mesh.materials[0].base_texture.is_transformed);
  orb_mesh_free(ctx, &mesh);
}

static void test_losses_are_named(void **state) {
  (void)state;
  static const struct {
    const char *members, *what, *why;
  } cases[] = {
      {"\"normalTexture\":{\"index\":1}", "normalTexture", "not in the file"},
      {"\"normalTexture\":{\"index\":3}", "normalTexture", "not a PNG or JPEG"},
      {"\"normalTexture\":{\"index\":9}", "normalTexture", "does not have"},
      {"\"normalTexture\":7", "normalTexture", "not valid"},
      {"\"normalTexture\":{\"index\":0,\"scale\":\"x\"}", "normalTexture", "not valid"},
      {"\"emissiveFactor\":[1,1]", "emissiveFactor", "not valid"},
      {"\"alphaMode\":\"GLASS\"", "alphaMode", "not valid"},
      {"\"emissiveTexture\":{\"index\":0,\"extensions\":{\"KHR_texture_transform\":{\"scale\":[1]}}}",
       "emissiveTexture", "KHR_texture_transform"},
      {"\"emissiveTexture\":{\"index\":0},\"normalTexture\":{\"index\":0,\"texCoord\":1}", "normalTexture", "one set"},
      {"\"extensions\":{\"VENDOR_glitter\":{}}", "VENDOR_glitter", "does not carry"},
      {"\"extensions\":{\"KHR_materials_ior\":3}", "KHR_materials_ior", "not valid"},
      {"\"extensions\":{\"KHR_materials_volume\":{\"thicknessFactor\":1}}", "KHR_materials_volume", "no effect"},
      {"\"extensions\":{\"KHR_materials_dispersion\":{\"dispersion\":1}}", "KHR_materials_dispersion", "no effect"},
      {"\"extensions\":{\"KHR_materials_unlit\":{},\"KHR_materials_ior\":{\"ior\":2}}", "KHR_materials_ior",
       "does not allow"},
      {"\"doubleSided\":true,\"extensions\":{\"KHR_materials_volume\":{\"thicknessFactor\":1},"
       "\"KHR_materials_transmission\":{\"transmissionFactor\":1}}",
       "doubleSided", "one side"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    orb_mesh mesh;
    read_material(cases[i].members, &mesh);
    const char *why = why_dropped(&mesh, cases[i].what);
    if (!why || !strstr(why, cases[i].why)) {
      fail_msg("%s: %s", cases[i].members, why ? why : "nothing was dropped");
    }
    assert_string_equal(mesh.dropped[0].where, "materials[0] \"skin\"");
    orb_mesh_free(ctx, &mesh);
  }
}

/* If all textures of a material use the second set, the mesh has that set's coordinates, 2 everywhere. */
static void test_set_of_material(void **state) {
  (void)state;
  orb_mesh mesh;
  read_material(
      "\"normalTexture\":{\"index\":0,\"texCoord\":1},\"emissiveTexture\":{\"index\":0,\"extensions\":{"
      "\"KHR_texture_transform\":{\"texCoord\":1}}}",
      &mesh);
  assert_non_null(value_of(&mesh, ORB_MATERIAL_NORMAL_TEXTURE));
  assert_non_null(value_of(&mesh, ORB_MATERIAL_EMISSIVE_TEXTURE));
  for (int i = 0; i < 6; i++) {
    assert_float_equal(mesh.texcoords[i], 2, 0);
  }
  assert_non_null(why_dropped(&mesh, "TEXCOORD_0"));
  assert_null(why_dropped(&mesh, "TEXCOORD_1"));
  orb_mesh_free(ctx, &mesh);
}

/* A long list ends with the number of omitted entries. */
static void test_list_is_bounded(void **state) {
  (void)state;
  for (int count = 97; count <= 300; count += 101) {
    static char members[1 << 15];
    size_t at = (size_t)sprintf(members, "\"extensions\":{");
    for (int i = 0; i < count; i++) {
      at += (size_t)sprintf(members + at, "%s\"VENDOR_%d\":{}", i ? "," : "", i);
    }
    strcpy(members + at, "}");
    orb_mesh mesh;
    read_material(members, &mesh);
    int all = count + 1; /* TEXCOORD_1 */
    assert_int_equal(mesh.dropped_count, all < ORB_DROPPED_MAX ? all : ORB_DROPPED_MAX);
    if (all >= ORB_DROPPED_MAX) {
      assert_int_equal(atoi(mesh.dropped[ORB_DROPPED_MAX - 1].what), all - (ORB_DROPPED_MAX - 1));
    }
    orb_mesh_free(ctx, &mesh);
  }
}

/* Readers of other formats name what is in other files. */
static void test_libraries_are_named(void **state) {
  (void)state;
  static const char obj[] = "mtllib wood and stone.mtl \nmtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n";
  static const char ply[] =
      "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
      "3 0 1 2\n";
  orb_mesh mesh;
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)obj, sizeof obj - 1, ORB_FORMAT_OBJ, &mesh, NULL), ORB_OK);
  assert_int_equal(mesh.dropped_count, 1);
  assert_string_equal(mesh.dropped[0].what, "mtllib");
  assert_string_equal(mesh.dropped[0].where, "wood and stone.mtl");
  orb_mesh_free(ctx, &mesh);
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)ply, sizeof ply - 1, ORB_FORMAT_PLY, &mesh, NULL), ORB_OK);
  assert_int_equal(mesh.dropped_count, 1);
  assert_string_equal(mesh.dropped[0].what, "TextureFile");
  orb_mesh_free(ctx, &mesh);
}

static void ellipsoid(int32_t shape, const double p[3], double out[3]) {
  for (int c = 0; c < 3; c++) {
    out[c] = c == shape ? 2.5 * p[c] : p[c];
  }
}

/* Texture coordinates: x and z on the side y < 0, mirrored on the other side. There is no seam: both sides agree at y =
 * 0. */
static void wrap_mesh(orb_mesh *mesh, const double *points) {
  mesh->texcoords = ORB_NEW0(ctx, float, 6 * mesh->triangle_count);
  for (int64_t h = 0; h < 3 * (int64_t)mesh->triangle_count; h++) {
    const double *p = points + 3 * mesh->triangles[h];
    mesh->texcoords[2 * h] = (float)p[0];
    mesh->texcoords[2 * h + 1] = (float)p[2];
  }
}

/* Gives the first shape of `made` a material of its own with these values. */
static void dress(synthetic *made, const orb_material_value *values, int32_t count) {
  orb_mesh *mesh = &made->shapes[0].mesh, png;
  read_material("\"normalTexture\":{\"index\":0}", &png);
  wrap_mesh(mesh, made->supermesh.points);
  mesh->images = png.images;
  mesh->image_count = png.image_count;
  png.images = NULL;
  png.image_count = 0;
  orb_mesh_free(ctx, &png);
  mesh->material = ORB_NEW0(ctx, int32_t, mesh->triangle_count);
  mesh->materials = ORB_NEW0(ctx, orb_material, 1);
  mesh->material_count = 1;
  mesh->materials[0] =
      (orb_material){.base_color = {1, 1, 1, 1}, .roughness = 1, .base_texture = {.image = -1}, .value_count = count};
  mesh->material_values = ORB_NEW0(ctx, orb_material_value, count);
  mesh->material_value_count = count;
  memcpy(mesh->material_values, values, (size_t)count * sizeof *values);
}

static glb write_asset(const synthetic *made, const orb_asset_options *options, orb_buffer *bytes) {
  static const char *const names[] = {"one", "two"};
  memset(bytes, 0, sizeof *bytes);
  if (orb_asset_write(ctx, &made->supermesh, made->shapes, names, options, NULL, bytes) != ORB_OK) {
    fail_msg("%s", orb_context_error(ctx)->detail);
  }
  return glb_open(bytes);
}

/* Away from y = 0, where vertices are split, tangents on both shapes follow x, the direction in which u grows, as far
 * as the surface does; the bitangent, which points to smaller v, follows −z. The texture transform rotates the
 * coordinates by a half turn, and both directions are reversed. */
static void test_tangents(void **state) {
  (void)state;
  for (int turned = 0; turned < 2; turned++) {
    synthetic made = synthetic_make(ctx, 4, 2, ellipsoid);
    orb_material_value normal = {.member = ORB_MATERIAL_NORMAL_TEXTURE, .number = {1}};
    normal.texture = (orb_texture){.is_transformed = turned, .rotation = M_PI, .scale = {1, 1}};
    dress(&made, &normal, 1);
    orb_asset_options options;
    orb_asset_defaults(&options);
    orb_buffer bytes;
    glb file = write_asset(&made, &options, &bytes);
    const cJSON *mesh = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "meshes"), 0);
    const cJSON *primitive = cJSON_GetArrayItem(cJSON_GetObjectItem(mesh, "primitives"), 0);
    const cJSON *base = cJSON_GetObjectItem(primitive, "attributes");
    const cJSON *target = cJSON_GetArrayItem(cJSON_GetObjectItem(primitive, "targets"), 0);
    int place = glb_attribute(base, "POSITION"), moved = glb_attribute(target, "TANGENT"), checked = 0, split = 0;
    int tangent = glb_attribute(base, "TANGENT"), straight = glb_attribute(base, "NORMAL");
    assert_true(tangent >= 0 && moved >= 0);
    for (int v = 0; v < glb_count(&file, place); v++) {
      double n[3], t[3], both[2][3], y = glb_value(&file, place, v, 1), sign = glb_value(&file, tangent, v, 3);
      double length = 0, along = 0;
      assert_true(sign == 1 || sign == -1);
      for (int c = 0; c < 3; c++) {
        n[c] = glb_value(&file, straight, v, c);
        t[c] = both[0][c] = glb_value(&file, tangent, v, c);
        both[1][c] = t[c] + glb_value(&file, moved, v, c);
        length += t[c] * t[c];
        along += t[c] * n[c];
      }
      assert_float_equal(length, 1, 1e-5);
      assert_float_equal(along, 0, 1e-5);
      if (fabs(y) < 1e-6) {
        split++;
        continue;
      }
      /* n × t · sign */
      double up = (n[0] * t[1] - n[1] * t[0]) * sign;
      if (fabs(y) > 0.3) {
        for (int s = 0; s < 2; s++) {
          assert_true((turned ? -1 : 1) * both[s][0] > 0.05);
        }
        assert_true((turned ? 1 : -1) * up > 0.2);
        assert_int_equal(sign, y < 0 ? -1 : 1);
        checked++;
      }
    }
    assert_true(checked > 100);
    assert_true(split > 60); /* of 32 vertices, two each */
    glb_close(&file);
    orb_buffer_free(ctx, &bytes);
    synthetic_free(ctx, &made);
  }
}

/* Without normals there are no tangents, and what needs them is omitted and reported. */
static void test_no_normals(void **state) {
  (void)state;
  synthetic made = synthetic_make(ctx, 2, 2, ellipsoid);
  orb_material_value values[] = {{.member = ORB_MATERIAL_EMISSIVE_TEXTURE, .texture.image = 0},
                                 {.member = ORB_MATERIAL_NORMAL_TEXTURE, .number = {1}},
                                 {.member = ORB_MATERIAL_SHEEN_COLOR, .number = {0.5, NAN, 7}}};
  dress(&made, values, 3);
  orb_asset_options options;
  orb_asset_defaults(&options);
  orb_buffer bytes;
  orb_dropped *dropped;
  int32_t count;
  for (int normals = 0; normals < 2; normals++) {
    options.normals = normals;
    glb file = write_asset(&made, &options, &bytes);
    const cJSON *material = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "materials"), 0);
    const cJSON *used = cJSON_GetObjectItem(file.json, "extensionsUsed");
    assert_int_equal(cJSON_GetObjectItem(material, "normalTexture") != NULL, normals);
    assert_non_null(cJSON_GetObjectItem(material, "emissiveTexture"));
    assert_int_equal(cJSON_GetArraySize(used), 1);
    const cJSON *sheen = cJSON_GetObjectItem(cJSON_GetObjectItem(material, "extensions"), "KHR_materials_sheen");
    const cJSON *color = cJSON_GetObjectItem(sheen, "sheenColorFactor");
    const double expected[3] = {0.5, 0, 1};
    for (int c = 0; c < 3; c++) {
      assert_float_equal(cJSON_GetArrayItem(color, c)->valuedouble, expected[c], 0);
    }
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(file.json, "images")), 1);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(file.json, "textures")), 1);
    assert_int_equal(orb_asset_dropped(ctx, made.shapes, 2, &options, &dropped, &count), ORB_OK);
    assert_int_equal(count, !normals);
    if (count) {
      assert_string_equal(dropped[0].what, "normalTexture");
    }
    orb_free(ctx, dropped);
    glb_close(&file);
    orb_buffer_free(ctx, &bytes);
  }
  synthetic_free(ctx, &made);
}

/* For every memory budget, the asset and its list are either written or refused, and nothing leaks. */
static void test_budgets(void **state) {
  (void)state;
  synthetic made = synthetic_make(ctx, 1, 2, ellipsoid);
  orb_material_value normal = {.member = ORB_MATERIAL_NORMAL_TEXTURE, .number = {1}};
  static const char *const names[] = {"one", "two"};
  orb_asset_options options;
  orb_asset_defaults(&options);
  dress(&made, &normal, 1);
  int refused = 0;
  for (size_t budget = 4096, done = 0; !done; budget += 256) {
    orb_context_options limits = {.threads = 1, .memory_limit = budget};
    orb_context *small;
    orb_buffer bytes = {0};
    orb_dropped *dropped = NULL;
    int32_t count = 0;
    assert_int_equal(orb_context_create(&limits, &small), ORB_OK);
    orb_status status = orb_asset_write(small, &made.supermesh, made.shapes, names, &options, NULL, &bytes);
    if (status == ORB_OK) {
      options.normals = 0;
      status = orb_asset_dropped(small, made.shapes, 2, &options, &dropped, &count);
      options.normals = 1;
    }
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    refused += status != ORB_OK;
    done = status == ORB_OK;
    orb_free(small, dropped);
    orb_buffer_free(small, &bytes);
    orb_context_destroy(small); /* asserts that nothing is left */
  }
  assert_true(refused > 40);
  synthetic_free(ctx, &made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_members_are_read), cmocka_unit_test(test_defaults_are_no_values),
      cmocka_unit_test(test_losses_are_named), cmocka_unit_test(test_set_of_material),
      cmocka_unit_test(test_list_is_bounded),  cmocka_unit_test(test_libraries_are_named),
      cmocka_unit_test(test_tangents),         cmocka_unit_test(test_no_normals),
      cmocka_unit_test(test_budgets)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
