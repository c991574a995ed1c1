#include "format/gltf_rig.hh"

#include "format/gltf_fit.hh"
#include "format/gltf_motion.hh"
#include "format/gltf_parse.hh"

extern "C" {
#include "format/gltf_document.h"
}

namespace gltf {

namespace {

const double SAME = 1e-3; /* transforms of a rest that differ by less are one: exporters round them to float32 */

bool is_near(const Matrix &a, const Matrix &b) {
  double size = 1;
  for (int i = 0; i < 16; i++) {
    size = std::fmax(size, std::fabs(a.m[i]));
  }
  for (int i = 0; i < 16; i++) {
    if (!(std::fabs(a.m[i] - b.m[i]) <= SAME * size)) {
      return false;
    }
  }
  return true;
}

/* A copy of a node without what is not part of a skeleton. */
cJSON *copy_node(const cJSON *node) {
  static const char *const members[] = {"name", "translation", "rotation", "scale", "matrix", "extras"};
  cJSON *out = made(cJSON_CreateObject());
  for (const char *name : members) {
    if (member(node, name)) {
      cJSON_AddItemToObject(out, name, made(cJSON_Duplicate(member(node, name), 1)));
    }
  }
  return out;
}

/* The scene that is shown; NULL: the document has none, and shows all nodes. */
cJSON *scene_of(cJSON *doc) {
  const List scenes = array_of(doc, "scenes");
  return scenes.empty() ? nullptr : editable(element(scenes, whole(doc, "scene", 0), "scene"));
}

/* Moves the copy of a node, relative to its parent. */
void shift_node(cJSON *node, const double shift[3]) {
  double place[3] = {0, 0, 0}, matrix[16];
  if (shift[0] == 0 && shift[1] == 0 && shift[2] == 0) {
    return;
  }
  if (numbers(node, "matrix", matrix, 16)) {
    for (int k = 0; k < 3; k++) {
      matrix[12 + k] += shift[k];
    }
    set(node, "matrix", cJSON_CreateDoubleArray(matrix, 16));
    return;
  }
  numbers(node, "translation", place, 3);
  for (int k = 0; k < 3; k++) {
    place[k] += shift[k];
  }
  set(node, "translation", cJSON_CreateDoubleArray(place, 3));
}

/* Copies the nodes; returns the new number of each, NONE for those that stay behind. wrap: the transform above their
 * roots. shift: of each node, 3 numbers. */
Indices copy_nodes(const Skeleton &from, cJSON *doc, const Matrix &wrap, const Numbers &shift) {
  Indices number(from.nodes.size(), NONE, Charged<int64_t>(from.ctx)), roots{Charged<int64_t>(from.ctx)};
  Counted<cJSON *> copies{Charged<cJSON *>(from.ctx)};
  cJSON *nodes = array_in(doc, "nodes");
  int64_t next = cJSON_GetArraySize(nodes);
  for (int64_t n : from.kept) {
    check_sometimes(from.ctx, copies.size());
    copies.push_back(copy_node(from.nodes[static_cast<size_t>(n)]));
    push(nodes, copies.back());
    shift_node(copies.back(), &shift[3 * static_cast<size_t>(n)]);
    number[static_cast<size_t>(n)] = next++;
  }
  for (size_t k = 0; k < copies.size(); k++) {
    size_t n = static_cast<size_t>(from.kept[k]);
    cJSON *children = nullptr;
    check_sometimes(from.ctx, k);
    for (const cJSON *child : array_of(from.nodes[n], "children")) {
      int64_t copy = number[static_cast<size_t>(number_of(child))];
      if (copy != NONE) {
        children = children ? children : array_in(copies[k], "children");
        push(children, cJSON_CreateNumber(static_cast<double>(copy)));
      }
    }
    if (from.above[n] == NONE) {
      roots.push_back(number[n]);
    }
  }
  if (!wrap.identity) {
    cJSON *above = made(cJSON_CreateObject());
    push(nodes, above);
    set(above, "name", cJSON_CreateString("skeleton"));
    set(above, "matrix", cJSON_CreateDoubleArray(wrap.m, 16));
    cJSON *children = array_in(above, "children");
    for (int64_t root : roots) {
      push(children, cJSON_CreateNumber(static_cast<double>(root)));
    }
    roots.assign(1, next);
  }
  if (cJSON *scene = scene_of(doc)) {
    cJSON *shown = array_in(scene, "nodes");
    for (int64_t root : roots) {
      push(shown, cJSON_CreateNumber(static_cast<double>(root)));
    }
  }
  return number;
}

/* Whether at rest every joint shows the vertices at `place`. */
bool rests_at(const Skeleton &skeleton, const Matrices &binds, const Matrix &place) {
  for (size_t j = 0; j < binds.size(); j++) {
    check_sometimes(skeleton.ctx, j);
    if (!is_near(skeleton.world(skeleton.joints[j]) * binds[j], place)) {
      return false;
    }
  }
  return true;
}

void point_of(const Matrix &matrix, double out[3]) {
  std::memcpy(out, matrix.m + 12, 3 * sizeof *out);
}

/* Moves the rest of the joints to where they belong on the base; turns and sizes stay. wrap: above the roots. Returns
 * how the translation of each node changes, 3 numbers each. */
Numbers fit_rest(Skeleton *skeleton, const orb_skin_surface &surface, const Matrix &wrap) {
  Numbers shift(3 * skeleton->nodes.size(), 0.0, Charged<double>(skeleton->ctx));
  Numbers rest(3 * skeleton->joints.size(), 0.0, Charged<double>(skeleton->ctx));
  Numbers wanted(shift.size(), NAN, Charged<double>(skeleton->ctx)); /* by node, where it is a joint that has a part */
  const Matrix back = inverse(wrap);
  for (size_t j = 0; j < skeleton->joints.size(); j++) {
    point_of(wrap * skeleton->world(skeleton->joints[j]), &rest[3 * j]);
  }
  const Numbers places = fit_joints(*skeleton, surface, rest);
  for (size_t j = 0; j < skeleton->joints.size(); j++) {
    back.point(&places[3 * j], &wanted[3 * static_cast<size_t>(skeleton->joints[j])]);
  }
  for (int64_t node : skeleton->order) {
    size_t n = static_cast<size_t>(node);
    int64_t above = skeleton->above[n];
    const Matrix parent = above == NONE ? Matrix() : skeleton->world(above);
    double local[3], at[3];
    point_of(matrix_of(skeleton->nodes[n]), local);
    parent.point(local, at);
    if (std::isfinite(wanted[3 * n] + wanted[3 * n + 1] + wanted[3 * n + 2])) {
      double fresh[3];
      inverse(parent).point(&wanted[3 * n], fresh);
      for (size_t k = 0; k < 3; k++) {
        shift[3 * n + k] = fresh[k] - local[k];
        at[k] = wanted[3 * n + k];
      }
    }
    Matrix &world = skeleton->worlds[n];
    world.identity = false;
    std::memcpy(world.m + 12, at, sizeof at);
  }
  return shift;
}

int64_t add_binds(orb_context *ctx, const Matrices &binds, Editor *editor) {
  Floats values{Charged<float>(ctx)};
  for (const Matrix &bind : binds) {
    for (double value : bind.m) {
      values.push_back(static_cast<float>(value));
      if (!std::isfinite(values.back())) {
        malformed("An inverse bind matrix of the glTF file is too large.");
      }
    }
  }
  return editor->add_list(values.data(), values.size() * sizeof(float), ORB_GLTF_FLOAT, binds.size(), "MAT4", false);
}

}  // namespace

namespace {

int64_t copy_skin_of(orb_context *ctx, const Document &source, cJSON *doc, Editor *editor, const orb_added_skin &from,
                     const Matrix &shown) {
  Buffers buffers(ctx);
  buffers.load(source.root(), source.chunk(), from.size);
  Skeleton skeleton(ctx, source.root(), from.skin);
  const Matrix moved(from.moved), place(from.place);
  Matrices binds = skeleton.inverse_binds(buffers);

  /* A vertex p of the source is shown at world · bind · p, and was read at place · p. Where its rest shows it without
   * `place`, the skeleton is moved by that as well. */
  const bool is_bare = rests_at(skeleton, binds, Matrix()), is_placed = rests_at(skeleton, binds, place);
  const Matrix wrap = is_bare && !is_near(place, Matrix()) ? moved * place : moved;
  const bool is_fitted = from.surface.count > 0 && (is_bare || is_placed);
  Numbers shift(3 * skeleton.nodes.size(), 0.0, Charged<double>(ctx));
  if (is_fitted) {
    shift = fit_rest(&skeleton, from.surface, wrap);
  }
  const Matrix to_source = inverse(moved * place) * shown;
  for (size_t j = 0; j < binds.size(); j++) {
    check_sometimes(ctx, j);
    binds[j] = is_fitted ? inverse(wrap * skeleton.world(skeleton.joints[j])) * shown : binds[j] * to_source;
  }
  const Indices number = copy_nodes(skeleton, doc, wrap, shift);
  copy_animations(skeleton, source.root(), buffers, number, shift, doc, editor);
  cJSON *skin = made(cJSON_CreateObject());
  int64_t index = append(array_in(doc, "skins"), skin);
  cJSON *joints = array_in(skin, "joints");
  for (int64_t joint : skeleton.joints) {
    push(joints, cJSON_CreateNumber(static_cast<double>(number[static_cast<size_t>(joint)])));
  }
  set(skin, "inverseBindMatrices", static_cast<double>(add_binds(ctx, binds, editor)));
  std::string name = text_of(skeleton.skin, "name");
  if (!name.empty()) {
    set(skin, "name", cJSON_CreateString(name.c_str()));
  }
  size_t root = static_cast<size_t>(index_of(skeleton.skin, "skeleton"));
  if (root < number.size() && number[root] != NONE) {
    set(skin, "skeleton", static_cast<double>(number[root]));
  }
  return index;
}

}  // namespace

int64_t copy_skin(orb_context *ctx, cJSON *doc, Editor *editor, const orb_added_skin &from, const Matrix &shown) {
  const Document source(ctx, from.bytes, from.size, from.size >= 4 && std::memcmp(from.bytes, "glTF", 4) == 0);
  const List skins = array_of(source.root(), "skins");
  int64_t index = NONE;
  blaming({culprit("skins", skins, static_cast<size_t>(from.skin))},
          [&] { index = copy_skin_of(ctx, source, doc, editor, from, shown); });
  return index;
}

}  // namespace gltf
