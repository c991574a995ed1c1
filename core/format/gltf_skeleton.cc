#include "format/gltf_skeleton.hh"

#include "format/gltf_parse.hh"

extern "C" {
#include "format/gltf_document.h"
}

namespace gltf {

namespace {

const size_t CHECK_EVERY = 4096; /* nodes or joints between two checks for cancellation */

const double SAME = 1e-3; /* transforms of a rest that differ by less are one: exporters round them to float32 */

Matrix matrix_from(const double m[16]) {
  Matrix out;
  const Matrix one;
  std::memcpy(out.m, m, sizeof out.m);
  out.identity = std::memcmp(out.m, one.m, sizeof out.m) == 0;
  return out;
}

/* Of an affine transform. */
Matrix inverse(const Matrix &matrix) {
  Matrix out;
  out.identity = matrix.identity;
  double determinant = matrix.determinant();
  for (int i = 0; i < 3 && !matrix.identity; i++) {
    for (int j = 0; j < 3; j++) {
      int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
      double cofactor = matrix.at(a, c) * matrix.at(b, d) - matrix.at(a, d) * matrix.at(b, c);
      out.m[4 * i + j] = cofactor / determinant; /* row j, column i */
      if (!std::isfinite(out.m[4 * i + j])) {
        throw Fault{ORB_E_BAD_OPTION,
                    "A node flattens the mesh of a skin, which no skeleton can move. Leave \"skin\" of \"transfer\" "
                    "out."};
      }
    }
  }
  for (int r = 0; r < 3 && !matrix.identity; r++) {
    out.m[12 + r] = 0;
    for (int c = 0; c < 3; c++) {
      out.m[12 + r] -= out.at(r, c) * matrix.m[12 + c];
    }
  }
  return out;
}

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

using Matrices = std::vector<Matrix, Charged<Matrix>>;
using Indices = std::vector<int64_t, Charged<int64_t>>;

void check_sometimes(orb_context *ctx, size_t step) {
  if (step % CHECK_EVERY == 0) {
    must(orb_context_check(ctx));
  }
}

/* The joints of a skin and all nodes above them. */
struct Skeleton {
  orb_context *ctx;
  const cJSON *source;
  const cJSON *skin;
  List nodes;
  Indices joints, above; /* above: the parent of each node */
  Indices kept;          /* the nodes, by their numbers */
  Matrices worlds;       /* of each node that is kept; the others have the identity */

  Skeleton(orb_context *context, const cJSON *document, int32_t number)
      : ctx(context),
        source(document),
        skin(element(array_of(document, "skins"), number, "skin")),
        nodes(array_of(document, "nodes")),
        joints(Charged<int64_t>(context)),
        above(nodes.size(), NONE, Charged<int64_t>(context)),
        kept(Charged<int64_t>(context)),
        worlds(nodes.size(), Matrix(), Charged<Matrix>(context)) {
    for (size_t i = 0; i < nodes.size(); i++) {
      check_sometimes(ctx, i);
      for (const cJSON *child : array_of(nodes[i], "children")) {
        int64_t index = number_of(child);
        (void)element(nodes, index, "node");
        if (above[static_cast<size_t>(index)] != NONE) {
          refuse_loop(index);
        }
        above[static_cast<size_t>(index)] = static_cast<int64_t>(i);
      }
    }
    for (const cJSON *joint : array_of(skin, "joints")) {
      joints.push_back(number_of(joint));
      (void)element(nodes, joints.back(), "node");
    }
    place_nodes();
  }

  [[noreturn]] static void refuse_loop(int64_t node) {
    malformed("Node " + std::to_string(node) + " of the glTF file is a child of two nodes, or of itself.");
  }

  const Matrix &world(int64_t node) const { return worlds[static_cast<size_t>(node)]; }

  /* Goes up from each joint to a node that is done, and from there back down. */
  void place_nodes() {
    enum : unsigned char { NEW, OPEN, DONE };
    std::vector<unsigned char, Charged<unsigned char>> state(nodes.size(), NEW, Charged<unsigned char>(ctx));
    Indices path{Charged<int64_t>(ctx)};
    size_t steps = 0;
    for (int64_t joint : joints) {
      int64_t n = joint;
      for (; n != NONE && state[static_cast<size_t>(n)] != DONE; n = above[static_cast<size_t>(n)]) {
        check_sometimes(ctx, steps++);
        if (state[static_cast<size_t>(n)] == OPEN) {
          refuse_loop(n);
        }
        state[static_cast<size_t>(n)] = OPEN;
        path.push_back(n);
      }
      Matrix to = n == NONE ? Matrix() : world(n);
      for (; !path.empty(); path.pop_back()) {
        size_t at = static_cast<size_t>(path.back());
        check_sometimes(ctx, steps++);
        to = worlds[at] = to * matrix_of(nodes[at]);
        state[at] = DONE;
      }
    }
    for (size_t i = 0; i < nodes.size(); i++) {
      if (state[i] == DONE) {
        kept.push_back(static_cast<int64_t>(i));
      }
    }
  }

  Matrices inverse_binds(const Buffers &buffers) const {
    Matrices out(joints.size(), Matrix(), Charged<Matrix>(ctx));
    int64_t index = whole(skin, "inverseBindMatrices", NONE);
    if (index == NONE) {
      return out;
    }
    size_t width = 0;
    Numbers values = buffers.accessor(index, &width);
    if (width != 16 || values.size() < 16 * joints.size()) {
      malformed("The inverse bind matrices of the glTF file do not fit the joints of the skin.");
    }
    for (size_t j = 0; j < joints.size(); j++) {
      out[j] = matrix_from(&values[16 * j]);
    }
    return out;
  }
};

/* A copy of a node without what is no part of a skeleton. */
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

/* Copies the nodes; returns the new number of each, NONE for those that stay behind. wrap: the transform above their
 * roots. */
Indices copy_nodes(const Skeleton &from, cJSON *doc, const Matrix &wrap) {
  Indices number(from.nodes.size(), NONE, Charged<int64_t>(from.ctx)), roots{Charged<int64_t>(from.ctx)};
  std::vector<cJSON *, Charged<cJSON *>> copies{Charged<cJSON *>(from.ctx)};
  cJSON *nodes = array_in(doc, "nodes");
  int64_t next = cJSON_GetArraySize(nodes);
  for (int64_t n : from.kept) {
    check_sometimes(from.ctx, copies.size());
    copies.push_back(copy_node(from.nodes[static_cast<size_t>(n)]));
    push(nodes, copies.back());
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

}  // namespace

int64_t copy_skin(orb_context *ctx, cJSON *doc, Editor *editor, const orb_added_skin &from, const Matrix &shown) {
  Document source(ctx, from.bytes, from.size, from.size >= 4 && std::memcmp(from.bytes, "glTF", 4) == 0);
  Buffers buffers(ctx);
  buffers.load(source.root(), source.chunk(), from.size);
  const Skeleton skeleton(ctx, source.root(), from.skin);
  const Matrix moved = matrix_from(from.moved), place = matrix_from(from.place);
  const Matrices binds = skeleton.inverse_binds(buffers);

  /* A vertex p of the source is shown at world · bind · p, and was read at place · p. Where its rest shows it without
   * `place`, the skeleton is moved by that as well. */
  bool is_bare = true;
  for (size_t j = 0; j < binds.size(); j++) {
    is_bare = is_bare && is_near(skeleton.world(skeleton.joints[j]) * binds[j], Matrix());
  }
  const Matrix wrap = is_bare && !is_near(place, Matrix()) ? moved * place : moved;
  const Matrix to_source = inverse(moved * place) * shown;
  Floats values{Charged<float>(ctx)};
  for (const Matrix &bind : binds) {
    const Matrix all = bind * to_source;
    for (double value : all.m) {
      values.push_back(static_cast<float>(value));
      if (!std::isfinite(values.back())) {
        malformed("An inverse bind matrix of the glTF file is too large.");
      }
    }
  }
  const Indices number = copy_nodes(skeleton, doc, wrap);
  cJSON *skin = made(cJSON_CreateObject());
  int64_t index = append(array_in(doc, "skins"), skin);
  cJSON *joints = array_in(skin, "joints");
  for (int64_t joint : skeleton.joints) {
    push(joints, cJSON_CreateNumber(static_cast<double>(number[static_cast<size_t>(joint)])));
  }
  int64_t accessor =
      editor->add_list(values.data(), values.size() * sizeof(float), ORB_GLTF_FLOAT, binds.size(), "MAT4", false);
  set(skin, "inverseBindMatrices", static_cast<double>(accessor));
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

}  // namespace gltf
