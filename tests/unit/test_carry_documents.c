/* Documents that are awkward to carry over: nodes that form no tree, skeletons as deep or as wide as allowed, many
 * targets with one name. If the work grew with the square of their size, they would exceed the time limit. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <cjson/cJSON.h>

#include "carry/carry.h"
#include "format/gltf_add.h"
#include "format/gltf_given.h"
#include "orbmorph/format.h"
#include "support_supermesh.h"
#include "transfer/names.h"

enum { JOINTS = 30000, TARGETS = 200000, NAMES = 16000 };

static int setup(void **state) {
  return orb_context_create(NULL, (orb_context **)state) == ORB_OK ? 0 : -1;
}
static int teardown(void **state) {
  orb_context_destroy(*state);
  return 0;
}

static void add_text(orb_context *ctx, orb_buffer *out, const char *format, ...) {
  char text[1024];
  va_list list;
  va_start(list, format);
  int size = vsnprintf(text, sizeof text, format, list);
  va_end(list);
  assert_true(size >= 0 && size < (int)sizeof text);
  assert_int_equal(orb_buffer_append(ctx, out, text, (size_t)size), ORB_OK);
}

static void add_word(orb_context *ctx, orb_buffer *out, size_t value) {
  unsigned char bytes[4];
  for (int k = 0; k < 4; k++) {
    bytes[k] = (unsigned char)(value >> 8 * k);
  }
  assert_int_equal(orb_buffer_append(ctx, out, bytes, 4), ORB_OK);
}

/* A GLB of a text, which it frees, and a chunk of bytes. */
static orb_buffer make_glb(orb_context *ctx, orb_buffer *text, const void *bytes, size_t size) {
  orb_buffer out = {0};
  while (text->size % 4) {
    add_text(ctx, text, " ");
  }
  assert_int_equal(orb_buffer_append(ctx, &out, "glTF", 4), ORB_OK);
  add_word(ctx, &out, 2);
  add_word(ctx, &out, 28 + text->size + size);
  add_word(ctx, &out, text->size);
  assert_int_equal(orb_buffer_append(ctx, &out, "JSON", 4), ORB_OK);
  assert_int_equal(orb_buffer_append(ctx, &out, text->data, text->size), ORB_OK);
  add_word(ctx, &out, size);
  assert_int_equal(orb_buffer_append(ctx, &out, "BIN", 4), ORB_OK);
  assert_int_equal(orb_buffer_append(ctx, &out, bytes, size), ORB_OK);
  orb_buffer_free(ctx, text);
  return out;
}

/* One triangle, with more members of its primitive and mesh. */
static orb_buffer triangle_glb(orb_context *ctx, orb_buffer *more) {
  static const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  orb_buffer text = {0};
  add_text(ctx, &text,
           "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
           "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,0],"
           "\"max\":[1,1,0]}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],\"buffers\":[{\"byteLength\":36}],"
           "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}");
  assert_int_equal(orb_buffer_append(ctx, &text, more->data, more->size), ORB_OK);
  add_text(ctx, &text, "}]}");
  orb_buffer_free(ctx, more);
  return make_glb(ctx, &text, positions, sizeof positions);
}

/* Adds the skin of a document to a triangle, fitted to a surface unless that is NULL. */
static orb_status add_skin(orb_context *ctx, const orb_buffer *source, int32_t joints, const double place[16],
                           const orb_skin_surface *fitted, orb_buffer *out) {
  static const int32_t surface[3] = {0, 1, 2};
  static const uint16_t first[12];
  static const float weights[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  orb_buffer more = {0};
  add_text(ctx, &more, "}]");
  orb_buffer base = triangle_glb(ctx, &more);
  orb_additions additions = {
      .vertex_count = 3,
      .on_surface = surface,
      .skin = {
          .bytes = source->data, .size = source->size, .joint_count = joints, .joints = first, .weights = weights}};
  memcpy(additions.skin.place, place, sizeof additions.skin.place);
  for (int k = 0; k < 4; k++) {
    additions.skin.moved[5 * k] = 1;
  }
  if (fitted) {
    additions.skin.surface = *fitted;
  }
  orb_status status = orb_gltf_add(ctx, base.data, base.size, &additions, out);
  orb_buffer_free(ctx, &base);
  return status;
}

static const double none[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static void nodes_that_are_no_tree(void **state) {
  orb_context *ctx = *state;
  static const char *const bad[] = {
      "\"nodes\":[{\"children\":[2]},{\"children\":[2]},{}],\"skins\":[{\"joints\":[2]}]",
      "\"nodes\":[{\"children\":[1,1]},{}],\"skins\":[{\"joints\":[1]}]",
      "\"nodes\":[{\"children\":[0]}],\"skins\":[{\"joints\":[0]}]",
      "\"nodes\":[{\"children\":[1]},{\"children\":[2]},{\"children\":[0]}],\"skins\":[{\"joints\":[0,1]}]",
      "\"nodes\":[{\"translation\":[1,0,0]},{\"children\":[2]},{\"children\":[1,3]},{}],\"skins\":[{\"joints\":[0,3]}]",
  };
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
    orb_buffer source = {0}, out = {0};
    add_text(ctx, &source, "{\"asset\":{\"version\":\"2.0\"},%s}", bad[i]);
    assert_int_equal(add_skin(ctx, &source, 2, none, NULL, &out), ORB_E_MALFORMED_MESH);
    assert_non_null(strstr(orb_context_error(ctx)->detail, "child of"));
    orb_buffer_free(ctx, &source);
    orb_buffer_free(ctx, &out);
  }
}

/* The skeleton: a chain upwards, or all joints under the first. Its rest pose is that of the inverse bind matrices. */
static orb_buffer skeleton_glb(orb_context *ctx, int is_chain) {
  orb_buffer text = {0};
  float(*binds)[16] = calloc(JOINTS, sizeof *binds);
  assert_non_null(binds);
  add_text(ctx, &text, "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[");
  for (int j = 0; j < JOINTS; j++) {
    add_text(ctx, &text, "%s{\"translation\":[0,%d,0]", j ? "," : "", j > 0);
    for (int c = j + 1; is_chain ? c == j + 1 && c < JOINTS : j == 0 && c < JOINTS; c++) {
      add_text(ctx, &text, "%s%d", c == j + 1 ? ",\"children\":[" : ",", c);
    }
    add_text(ctx, &text, "%s", (is_chain ? j < JOINTS - 1 : j == 0) ? "]}" : "}");
    for (int k = 0; k < 4; k++) {
      binds[j][5 * k] = 1;
    }
    binds[j][13] = -(float)(is_chain ? j : j > 0);
  }
  add_text(ctx, &text, "],\"skins\":[{\"inverseBindMatrices\":0,\"joints\":[");
  for (int j = 0; j < JOINTS; j++) {
    add_text(ctx, &text, "%s%d", j ? "," : "", j);
  }
  add_text(ctx, &text,
           "]}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":%d,\"type\":\"MAT4\"}],"
           "\"bufferViews\":[{\"buffer\":0,\"byteLength\":%d}],\"buffers\":[{\"byteLength\":%d}]}",
           JOINTS, 64 * JOINTS, 64 * JOINTS);
  orb_buffer out = make_glb(ctx, &text, binds, sizeof *binds * JOINTS);
  free(binds);
  return out;
}

/* The source's meshes were read at `place`, but its rest pose is elsewhere: a node above the skeleton moves it there.
 * That node exists only if the rest of every joint is the inverse of its inverse bind matrix. */
static void check_large_skeleton(orb_context *ctx, int is_chain) {
  orb_buffer source = skeleton_glb(ctx, is_chain), out = {0};
  const double place[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1};
  assert_int_equal(add_skin(ctx, &source, JOINTS, place, NULL, &out), ORB_OK);
  uint32_t size;
  memcpy(&size, out.data + 12, sizeof size); /* tests run where words are little-endian, as in a GLB */
  cJSON *doc = cJSON_ParseWithLength((const char *)out.data + 20, size);
  const cJSON *nodes = cJSON_GetObjectItem(doc, "nodes");
  const cJSON *joint = cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(doc, "skins"), 0), "joints")->child;
  assert_int_equal(cJSON_GetArraySize(nodes), 1 + JOINTS + 1);
  const cJSON *node = nodes->child->next;
  for (int j = 0; j < JOINTS; j++, node = node->next, joint = joint->next) {
    const cJSON *children = cJSON_GetObjectItem(node, "children");
    assert_int_equal(joint->valueint, 1 + j);
    if (is_chain && j < JOINTS - 1) {
      assert_int_equal(children->child->valueint, 2 + j);
    }
    if (!is_chain && j == 0) {
      assert_int_equal(cJSON_GetArraySize(children), JOINTS - 1);
    }
  }
  assert_string_equal(cJSON_GetObjectItem(node, "name")->valuestring, "skeleton");
  assert_int_equal(cJSON_GetObjectItem(node, "children")->child->valueint, 1);
  cJSON_Delete(doc);
  orb_buffer_free(ctx, &source);
  orb_buffer_free(ctx, &out);
}

static void deep_and_wide_skeletons(void **state) {
  check_large_skeleton(*state, 1);
  check_large_skeleton(*state, 0);
}

/* Four joints, rotated and scaled, whose transforms to the scene can be written by hand: 0: (1 − 2y, 2 + 2x, 3 + 2z);
 * 1: (1 + 2z, 3 + 2x, 3 + 2y); 2: 1 at x = 1; 3: 1 at y = 1. Times, translations and rotations of two keys, and a cubic
 * spline. */
static const float rig_values[4 * 16 + 2 + 6 + 8 + 18] = {
    0, -0.5f, 0,    0, 0.5f, 0, 0,    0, 0, 0,    0.5f, 0,  -1,    0.5f,  -1.5f, 1,    /* bind of 0 */
    0, 0,     0.5f, 0, 0.5f, 0, 0,    0, 0, 0.5f, 0,    0,  -1.5f, -1.5f, -0.5f, 1,    /* 1 */
    0, 0,     0.5f, 0, 0.5f, 0, 0,    0, 0, 0.5f, 0,    0,  -2.5f, -1.5f, -0.5f, 1,    /* 2 */
    0, 0,     0.5f, 0, 0.5f, 0, 0,    0, 0, 0.5f, 0,    0,  -1.5f, -2.5f, -0.5f, 1,    /* 3 */
    0, 1,     1,    0, 0,    2, 0.5f, 0, 0, 0,    0,    1,  0,     0.6f,  0,     0.8f, /* times and so on */
    1, 2,     3,    4, 5,    6, 7,    8, 9, 10,   11,   12, 13,    14,    15,    16,   17, 18};

static orb_buffer rig_glb(orb_context *ctx, const char *last_joint) {
  orb_buffer text = {0};
  add_text(ctx, &text,
           "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"translation\":[1,2,3],\"rotation\":[0,0,"
           "0.70710678118654757,0.70710678118654757],\"scale\":[2,2,2],\"children\":[1]},{\"matrix\":[1,0,0,0,0,0,1,0,"
           "0,-1,0,0,0.5,0,0,1],\"children\":[2,3]},{\"translation\":[1,0,0]},{%s},{\"name\":\"other\"}],"
           "\"skins\":[{\"inverseBindMatrices\":0,\"joints\":[0,1,2,3]}],",
           last_joint);
  add_text(ctx, &text,
           "\"animations\":[{\"name\":\"walk\",\"samplers\":[{\"input\":1,\"output\":2},{\"input\":1,\"output\":3},"
           "{\"input\":1,\"output\":4,\"interpolation\":\"CUBICSPLINE\"}],\"channels\":["
           "{\"sampler\":0,\"target\":{\"node\":2,\"path\":\"translation\"}},"
           "{\"sampler\":0,\"target\":{\"node\":4,\"path\":\"translation\"}},"
           "{\"sampler\":1,\"target\":{\"node\":0,\"path\":\"rotation\"}},"
           "{\"sampler\":2,\"target\":{\"node\":2,\"path\":\"scale\"}}]},"
           "{\"samplers\":[{\"input\":1,\"output\":4,\"interpolation\":\"CUBICSPLINE\"}],"
           "\"channels\":[{\"sampler\":0,\"target\":{\"node\":2,\"path\":\"translation\"}}]}],");
  static const struct {
    int offset, length, count;
    const char *type;
  } lists[] = {
      {0, 256, 4, "MAT4"}, {256, 8, 2, "SCALAR"}, {264, 24, 2, "VEC3"}, {288, 32, 2, "VEC4"}, {320, 72, 6, "VEC3"}};
  add_text(ctx, &text, "\"buffers\":[{\"byteLength\":%zu}],\"bufferViews\":[", sizeof rig_values);
  for (int i = 0; i < 5; i++) {
    add_text(ctx, &text, "%s{\"buffer\":0,\"byteOffset\":%d,\"byteLength\":%d}", i ? "," : "", lists[i].offset,
             lists[i].length);
  }
  for (int i = 0; i < 5; i++) {
    add_text(ctx, &text, "%s{\"bufferView\":%d,\"componentType\":5126,\"count\":%d,\"type\":\"%s\"}",
             i ? "," : "],\"accessors\":[", i, lists[i].count, lists[i].type);
  }
  add_text(ctx, &text, "]}");
  return make_glb(ctx, &text, rig_values, sizeof rig_values);
}

static void affine(const double p[3], double out[3]) {
  out[0] = 1.2 * p[0] + 0.3 * p[1] + 7;
  out[1] = -0.1 * p[0] + 0.9 * p[1] + 0.2 * p[2];
  out[2] = 0.1 * p[1] + 1.4 * p[2] - 2;
}

enum { POINTS = 90 };
typedef struct rig_surface {
  double before[3 * POINTS], after[3 * POINTS], area[POINTS];
  uint16_t joints[POINTS][4];
  float weights[POINTS][4];
} rig_surface;

/* Points that joints 0 and 1, joints 1 and 2, or joint 0 alone move; joint 3 moves none. `after` is an affine image. */
static void make_surface(rig_surface *s) {
  uint32_t seed = 1;
  memset(s, 0, sizeof *s);
  for (int v = 0; v < POINTS; v++) {
    for (int k = 0; k < 3; k++) {
      seed = seed * 1664525 + 1013904223;
      s->before[3 * v + k] = 4.0 * (seed >> 8) / (1 << 24);
    }
    affine(s->before + 3 * v, s->after + 3 * v);
    s->area[v] = 1 + v % 3;
    s->joints[v][0] = (uint16_t)(v % 3 == 1);
    s->joints[v][1] = (uint16_t)(v % 3 == 2 ? 0 : v % 3 + 1);
    s->weights[v][1] = v % 3 == 2 ? 0 : 0.25f;
    s->weights[v][0] = 1 - s->weights[v][1];
  }
}

static void assert_near(double a, double b) {
  if (!(fabs(a - b) < 1e-5)) {
    print_error("%g is not %g\n", a, b);
  }
  assert_true(fabs(a - b) < 1e-5);
}

/* The vector between two points of the scene in the axes of node 0 or 1: undoes the rotations of the joint and of the
 * nodes above it. */
static void below(int node, const double from[3], const double to[3], double out[3]) {
  double way[3];
  for (int k = 0; k < 3; k++) {
    way[k] = (to[k] - from[k]) / 2;
  }
  out[0] = way[1];
  out[1] = node == 0 ? -way[0] : way[2];
  out[2] = node == 0 ? way[2] : way[0];
}

static const double *number_list(const cJSON *object, const char *name, double out[16]) {
  int count = 0;
  for (const cJSON *item = cJSON_GetObjectItem(object, name)->child; item && count < 16; item = item->next) {
    out[count++] = item->valuedouble;
  }
  return out;
}

static void check_keys(const glb *file, const double shift[3]) {
  const cJSON *animations = cJSON_GetObjectItem(file->json, "animations");
  assert_int_equal(cJSON_GetArraySize(animations), 2);
  const cJSON *walk = animations->child, *channels = cJSON_GetObjectItem(walk, "channels");
  static const char *const paths[] = {"translation", "rotation", "scale", "translation"};
  static const int nodes[] = {3, 1, 3, 3}, first[] = {66, 72, 80, 80}, counts[] = {6, 8, 18, 18};
  assert_string_equal(cJSON_GetObjectItem(walk, "name")->valuestring, "walk");
  assert_int_equal(cJSON_GetArraySize(channels), 3);
  for (int c = 0; c < 4; c++) {
    const cJSON *from = c < 3 ? walk : animations->child->next;
    const cJSON *channel = cJSON_GetArrayItem(cJSON_GetObjectItem(from, "channels"), c < 3 ? c : 0);
    const cJSON *target = cJSON_GetObjectItem(channel, "target");
    const cJSON *sampler =
        cJSON_GetArrayItem(cJSON_GetObjectItem(from, "samplers"), cJSON_GetObjectItem(channel, "sampler")->valueint);
    assert_int_equal(cJSON_GetObjectItem(target, "node")->valueint, nodes[c]);
    assert_string_equal(cJSON_GetObjectItem(target, "path")->valuestring, paths[c]);
    assert_string_equal(cJSON_GetObjectItem(sampler, "interpolation")->valuestring, c < 2 ? "LINEAR" : "CUBICSPLINE");
    assert_near(glb_value(file, cJSON_GetObjectItem(sampler, "input")->valueint, 1, 0), 1);
    int output = cJSON_GetObjectItem(sampler, "output")->valueint, width = c == 1 ? 4 : 3;
    for (int i = 0; i < counts[c]; i++) {
      int is_place =
          c == 0 || (c == 3 && i / 3 % 3 == 1); /* a spline has three values per key; this is the middle one */
      assert_near(glb_value(file, output, i / width, i % width),
                  (double)rig_values[first[c] + i] + (is_place ? shift[i % 3] : 0));
    }
  }
}

/* If the base is an affine image of the shape, the joints are at the affine images of theirs; a joint that moves
 * nothing keeps its place relative to its parent. Rotations and scales stay, and at rest the base is unchanged. */
static void joints_follow_the_base(void **state) {
  orb_context *ctx = *state;
  static const double rest[4][3] = {{1, 2, 3}, {1, 3, 3}, {1, 5, 3}, {1, 3, 5}};
  rig_surface made;
  make_surface(&made);
  const orb_skin_surface surface = {
      POINTS, made.before, made.after, made.area, (const uint16_t(*)[4])made.joints, (const float(*)[4])made.weights};
  double places[4][3], local[4][3], list[16], shift[3];
  for (int j = 0; j < 3; j++) {
    affine(rest[j], places[j]);
  }
  for (int k = 0; k < 3; k++) {
    places[3][k] = places[1][k] + (k == 2 ? 2 : 0);
    local[0][k] = places[0][k];
  }
  below(0, places[0], places[1], local[1]);
  below(1, places[1], places[2], local[2]);
  below(1, places[1], places[3], local[3]);
  assert_true(local[3][0] == 0 && local[3][1] == 1 && local[3][2] == 0);

  orb_buffer source = rig_glb(ctx, "\"translation\":[0,1,0]"), out = {0};
  assert_int_equal(add_skin(ctx, &source, 4, none, &surface, &out), ORB_OK);
  glb file = glb_open(&out);
  const cJSON *nodes = cJSON_GetObjectItem(file.json, "nodes");
  assert_int_equal(cJSON_GetArraySize(nodes), 5);
  const cJSON *skin = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "skins"), 0);
  int binds = cJSON_GetObjectItem(skin, "inverseBindMatrices")->valueint;
  for (int j = 0; j < 4; j++) {
    const cJSON *node = cJSON_GetArrayItem(nodes, 1 + j);
    const double *place = number_list(node, j == 1 ? "matrix" : "translation", list) + (j == 1 ? 12 : 0);
    for (int k = 0; k < 3; k++) {
      double origin[3] = {0}, undone[3];
      assert_near(place[k], local[j][k]);
      below(j == 0 ? 0 : 1, places[j], origin, undone);
      assert_near(glb_value(&file, binds, 4 * j + 3, k), undone[k]);
      assert_near(glb_value(&file, binds, 4 * j + k, 0), (double)rig_values[16 * j + 4 * k]);
    }
  }
  assert_near(number_list(cJSON_GetArrayItem(nodes, 1), "rotation", list)[2], sqrt(0.5));
  assert_near(number_list(cJSON_GetArrayItem(nodes, 1), "scale", list)[1], 2);
  for (int k = 0; k < 3; k++) {
    shift[k] = local[2][k] - (k == 0);
  }
  check_keys(&file, shift);
  glb_close(&file);
  orb_buffer_free(ctx, &out);
  orb_buffer_free(ctx, &source);

  /* The rest pose of this document shows the shape in another pose, so it does not say where the joints belong. */
  source = rig_glb(ctx, "\"translation\":[0,1,1]");
  assert_int_equal(add_skin(ctx, &source, 4, none, &surface, &out), ORB_OK);
  file = glb_open(&out);
  assert_true(number_list(cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "nodes"), 3), "translation", list)[0] == 1);
  skin = cJSON_GetArrayItem(cJSON_GetObjectItem(file.json, "skins"), 0);
  binds = cJSON_GetObjectItem(skin, "inverseBindMatrices")->valueint;
  assert_near(glb_value(&file, binds, 4 * 2 + 3, 0), (double)rig_values[16 * 2 + 12]);
  check_keys(&file, (const double[3]){0, 0, 0});
  glb_close(&file);
  orb_buffer_free(ctx, &out);
  orb_buffer_free(ctx, &source);
}

static void many_targets_of_one_name(void **state) {
  orb_context *ctx = *state;
  orb_buffer more = {0};
  add_text(ctx, &more, ",\"targets\":[");
  for (int k = 0; k < TARGETS; k++) {
    add_text(ctx, &more, "%s{}", k ? "," : "");
  }
  add_text(ctx, &more, "]}],\"extras\":{\"targetNames\":[");
  for (int k = 0; k < TARGETS; k++) {
    add_text(ctx, &more, "%s\"same\"", k ? "," : "");
  }
  add_text(ctx, &more, "]}");
  orb_buffer document = triangle_glb(ctx, &more);
  orb_given_targets given;
  const orb_given_file file = {document.data, document.size, 3, (const unsigned char[]){1, 1, 1}};
  assert_int_equal(orb_given_targets_read(ctx, &file, &given), ORB_OK);
  assert_int_equal(given.count, 1);
  assert_string_equal(given.names[0], "same");
  orb_given_targets_free(ctx, &given);
  orb_buffer_free(ctx, &document);
}

/* A character of two bytes 100 times, then an invalid byte, which becomes a character of three bytes. */
static void names_are_cut_between_characters(void **state) {
  orb_context *ctx = *state;
  orb_buffer more = {0};
  add_text(ctx, &more, ",\"targets\":[{},{}]}],\"extras\":{\"targetNames\":[\"");
  for (int k = 0; k < 100; k++) {
    add_text(ctx, &more, "\xc3\xa9");
  }
  add_text(ctx, &more, "\",\"a\xff\x62\"]}");
  orb_buffer document = triangle_glb(ctx, &more);
  orb_given_targets given;
  const orb_given_file file = {document.data, document.size, 3, (const unsigned char[]){1, 1, 1}};
  assert_int_equal(orb_given_targets_read(ctx, &file, &given), ORB_OK);
  assert_int_equal(given.count, 2);
  assert_int_equal(strlen(given.names[0]), 126);
  for (int k = 0; k < 63; k++) {
    assert_memory_equal(given.names[0] + 2 * k, "\xc3\xa9", 2);
  }
  assert_string_equal(given.names[1], "a\xef\xbf\xbd\x62");
  orb_given_targets_free(ctx, &given);

  const int32_t surface[3] = {0, 1, 2};
  orb_given_name last[1] = {""};
  assert_int_equal(orb_given_last_targets(ctx, document.data, document.size, surface, 3, 1, last), ORB_OK);
  assert_string_equal(last[0], "a\xef\xbf\xbd\x62");
  orb_buffer_free(ctx, &document);
}

static orb_draft draft_of(orb_asset_options *options, const char *const *names, int32_t count) {
  orb_asset_target *targets = calloc((size_t)count, sizeof *targets);
  assert_non_null(targets);
  for (int32_t k = 0; k < count; k++) {
    snprintf(targets[k].name, sizeof targets[k].name, "%s", names[k]);
  }
  orb_asset_defaults(options);
  options->targets = targets;
  options->target_count = count;
  return (orb_draft){.options = options, .shape_count = 2, .frame_count = 2 + count};
}

static int compare(const void *a, const void *b) {
  return strcmp(*(const char *const *)a, *(const char *const *)b);
}

static void names_of_targets_are_unique(void **state) {
  orb_context *ctx = *state;
  orb_asset_options options;
  static const char *const shapes[] = {"a", "a"};
  static const char *const few[] = {"a (2)", "a", "a (3)", "b"};
  orb_target_name *texts = calloc(NAMES + 2, sizeof *texts);
  const char **out = calloc(NAMES + 2, sizeof *out), **many = calloc(NAMES, sizeof *many);
  assert_true(texts && out && many);
  orb_draft draft = draft_of(&options, few, 4);
  assert_int_equal(orb_draft_names(ctx, &draft, shapes, texts, out), ORB_OK);
  static const char *const wanted[] = {"a", "a", "a (2)", "a (3)", "a (3) (2)", "b"};
  for (int k = 0; k < 6; k++) {
    assert_string_equal(out[k], wanted[k]);
  }
  free((void *)options.targets);

  char longest[ORB_NAME_MAX];
  memset(longest, 'x', sizeof longest - 1);
  longest[sizeof longest - 1] = 0;
  for (int k = 0; k < NAMES; k++) {
    many[k] = longest;
  }
  draft = draft_of(&options, many, NAMES);
  assert_int_equal(orb_draft_names(ctx, &draft, shapes, texts, out), ORB_OK);
  assert_string_equal(out[2], longest);
  for (int k = 3; k < NAMES + 2; k++) {
    assert_memory_equal(out[k], longest, sizeof longest - 1);
    assert_int_equal(atoi(out[k] + sizeof longest + 1), k - 1); /* after a space and "(" */
  }
  qsort(out + 1, NAMES + 1, sizeof *out, compare);
  for (int k = 2; k < NAMES + 2; k++) {
    assert_string_not_equal(out[k - 1], out[k]);
  }
  free((void *)options.targets);
  free(texts);
  free((void *)out);
  free((void *)many);
}

static void identity(int32_t shape, const double p[3], double out[3]) {
  (void)shape;
  memcpy(out, p, 3 * sizeof *out);
}

/* Callers of the library get the same answers as those of the daemon. */
static void textures_that_cannot_be_baked(void **state) {
  orb_context *ctx = *state;
  synthetic made = synthetic_make(ctx, 1, 2, identity);
  orb_material material = {.base_texture.image = 0};
  orb_image image = {0};
  for (int s = 0; s < 2; s++) {
    orb_mesh *mesh = &made.shapes[s].mesh;
    mesh->texcoords = orb_alloc(ctx, (size_t)mesh->triangle_count * 6, sizeof *mesh->texcoords);
    memset(mesh->texcoords, 0, (size_t)mesh->triangle_count * 6 * sizeof *mesh->texcoords);
    mesh->materials = &material;
    mesh->images = &image;
    mesh->material_count = mesh->image_count = 1;
  }
  static const struct {
    int32_t from, resolution;
    orb_status status;
  } cases[] = {{1, 0, ORB_OK},
               {1, ORB_BAKE_LEAST, ORB_OK},
               {1, ORB_BAKE_MOST, ORB_OK},
               {0, 0, ORB_E_BAD_OPTION},
               {1, ORB_BAKE_LEAST - 1, ORB_E_BAD_OPTION},
               {1, ORB_BAKE_MOST + 1, ORB_E_BAD_OPTION},
               {1, -1, ORB_E_BAD_OPTION}};
  const orb_align_shape given[2] = {{.mesh = &made.shapes[0].mesh}, {.mesh = &made.shapes[1].mesh}};
  const orb_shape_file files[2] = {{0}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    const orb_carry carry = {cases[i].from, ORB_CARRY_TEXTURE, cases[i].resolution};
    const orb_carry_job job = {.supermesh = &made.supermesh,
                               .shapes = made.shapes,
                               .given = given,
                               .files = files,
                               .carries = &carry,
                               .carry_count = 1};
    orb_carrier carrier;
    assert_int_equal(orb_carrier_open(ctx, &job, &carrier), cases[i].status);
    orb_carrier_free(ctx, &carrier);
  }
  for (int s = 0; s < 2; s++) {
    made.shapes[s].mesh.materials = NULL;
    made.shapes[s].mesh.images = NULL;
    made.shapes[s].mesh.material_count = made.shapes[s].mesh.image_count = 0;
  }
  synthetic_free(ctx, &made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(nodes_that_are_no_tree, setup, teardown),
      cmocka_unit_test_setup_teardown(deep_and_wide_skeletons, setup, teardown),
      cmocka_unit_test_setup_teardown(joints_follow_the_base, setup, teardown),
      cmocka_unit_test_setup_teardown(many_targets_of_one_name, setup, teardown),
      cmocka_unit_test_setup_teardown(names_are_cut_between_characters, setup, teardown),
      cmocka_unit_test_setup_teardown(names_of_targets_are_unique, setup, teardown),
      cmocka_unit_test_setup_teardown(textures_that_cannot_be_baked, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
