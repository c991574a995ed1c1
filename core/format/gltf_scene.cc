#include "format/gltf_scene.hh"

namespace gltf {

Matrix operator*(const Matrix &a, const Matrix &b) {
  if (a.identity) {
    return b;
  }
  if (b.identity) {
    return a;
  }
  Matrix out;
  out.identity = false;
  for (int column = 0; column < 4; column++) {
    for (int row = 0; row < 4; row++) {
      double sum = 0;
      for (int k = 0; k < 4; k++) {
        sum += a.at(row, k) * b.at(k, column);
      }
      out.m[4 * column + row] = sum;
    }
  }
  return out;
}

Matrix matrix_of(const cJSON *node) {
  Matrix out;
  if (!numbers(node, "matrix", out.m, 16)) {
    double t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    numbers(node, "translation", t, 3);
    numbers(node, "rotation", q, 4);
    numbers(node, "scale", s, 3);
    double x = q[0], y = q[1], z = q[2], w = q[3];
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w),     2 * (x * z - y * w),
                         2 * (x * y - z * w),     1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
                         2 * (x * z + y * w),     2 * (y * z - x * w),     1 - 2 * (x * x + y * y)};
    for (int column = 0; column < 3; column++) {
      for (int row = 0; row < 3; row++) {
        out.m[4 * column + row] = r[3 * column + row] * s[column];
      }
      out.m[12 + column] = t[column];
    }
  }
  const Matrix one;
  out.identity = std::memcmp(out.m, one.m, sizeof out.m) == 0;
  return out;
}

int64_t number_of(const cJSON *value) {
  if (!cJSON_IsNumber(value) || !(value->valuedouble >= 0 && value->valuedouble <= INT32_MAX)) {
    malformed("A glTF list of nodes contains something that is not an index.");
  }
  return static_cast<int64_t>(value->valuedouble);
}

namespace {

/* A node to visit, and the place of the matrix above it in a list: each node with children has one there. */
struct Waiting {
  int64_t node;
  size_t above;
};

/* The roots of the scene, or of all nodes where the document has no scenes. */
Counted<int64_t> roots_of(orb_context *ctx, const cJSON *doc, const List &nodes, const List &scenes) {
  Counted<int64_t> out{Charged<int64_t>(ctx)};
  if (!scenes.empty()) {
    const cJSON *scene = element(scenes, whole(doc, "scene", 0), "scene");
    for (const cJSON *root : array_of(scene, "nodes")) {
      out.push_back(number_of(root));
    }
    return out;
  }
  std::vector<bool> is_child(nodes.size(), false);
  for (const cJSON *node : nodes) {
    for (const cJSON *child : array_of(node, "children")) {
      const int64_t index = number_of(child);
      if (index < static_cast<int64_t>(nodes.size())) {
        is_child[static_cast<size_t>(index)] = true;
      }
    }
  }
  for (size_t i = 0; i < nodes.size(); i++) {
    if (!is_child[i]) {
      out.push_back(static_cast<int64_t>(i));
    }
  }
  return out;
}

}  // namespace

Counted<Shown> shown_meshes(orb_context *ctx, const cJSON *doc, size_t mesh_count) {
  const List nodes = array_of(doc, "nodes"), scenes = array_of(doc, "scenes");
  Counted<Shown> out{Charged<Shown>(ctx)};
  if (nodes.empty() && scenes.empty()) {
    for (size_t i = 0; i < mesh_count; i++) {
      out.push_back(Shown{static_cast<int64_t>(i), Matrix(), nullptr});
    }
    return out;
  }
  const Counted<int64_t> roots = roots_of(ctx, doc, nodes, scenes);
  Counted<Waiting> stack{Charged<Waiting>(ctx)};
  Counted<Matrix> above(1, Matrix(), Charged<Matrix>(ctx));
  std::vector<bool> seen(nodes.size(), false);
  for (size_t i = roots.size(); i-- > 0;) {
    stack.push_back({roots[i], 0});
  }
  while (!stack.empty()) {
    const Waiting at = stack.back();
    stack.pop_back();
    const cJSON *node = element(nodes, at.node, "node");
    if (seen[static_cast<size_t>(at.node)]) {
      malformed("Node " + std::to_string(at.node) + " of the glTF file is a child of two nodes, or of itself.");
    }
    seen[static_cast<size_t>(at.node)] = true;
    const Matrix matrix = above[at.above] * matrix_of(node);
    const int64_t mesh = whole(node, "mesh", NONE);
    if (mesh != NONE) {
      out.push_back(Shown{mesh, matrix, node});
    }
    const List children = array_of(node, "children");
    if (!children.empty()) {
      above.push_back(matrix);
    }
    for (size_t i = children.size(); i-- > 0;) {
      stack.push_back({number_of(children[i]), above.size() - 1});
    }
  }
  return out;
}

}  // namespace gltf
