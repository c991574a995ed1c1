#include "format/gltf_skeleton.hh"

namespace gltf {

namespace {

[[noreturn]] void refuse_loop(const List &nodes, int64_t node) {
  malformed("Node " + std::to_string(node) + " of the glTF file is a child of two nodes, or of itself.",
            {culprit("nodes", nodes, static_cast<size_t>(node))});
}

}  // namespace

Skeleton::Skeleton(orb_context *context, const cJSON *document, int32_t number)
    : ctx(context),
      skin(element(array_of(document, "skins"), number, "skin")),
      nodes(array_of(document, "nodes")),
      joints(Charged<int64_t>(context)),
      above(nodes.size(), NONE, Charged<int64_t>(context)),
      kept(Charged<int64_t>(context)),
      order(Charged<int64_t>(context)),
      worlds(nodes.size(), Matrix(), Charged<Matrix>(context)) {
  for (const cJSON *joint : array_of(skin, "joints")) {
    joints.push_back(number_of(joint));
    (void)element(nodes, joints.back(), "node");
  }
  link_nodes();
  place_nodes();
}

void Skeleton::link_nodes() {
  for (size_t i = 0; i < nodes.size(); i++) {
    check_sometimes(ctx, i);
    for (const cJSON *child : array_of(nodes[i], "children")) {
      int64_t index = number_of(child);
      (void)element(nodes, index, "node");
      if (above[static_cast<size_t>(index)] != NONE) {
        refuse_loop(nodes, index);
      }
      above[static_cast<size_t>(index)] = static_cast<int64_t>(i);
    }
  }
}

/* Goes up from each joint to a node that is done, and from there back down. */
void Skeleton::place_nodes() {
  enum : unsigned char { NEW, OPEN, DONE };
  Counted<unsigned char> state(nodes.size(), NEW, Charged<unsigned char>(ctx));
  Indices path{Charged<int64_t>(ctx)};
  size_t steps = 0;
  for (int64_t joint : joints) {
    int64_t n = joint;
    for (; n != NONE && state[static_cast<size_t>(n)] != DONE; n = above[static_cast<size_t>(n)]) {
      check_sometimes(ctx, steps++);
      if (state[static_cast<size_t>(n)] == OPEN) {
        refuse_loop(nodes, n);
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
      order.push_back(path.back());
    }
  }
  for (size_t i = 0; i < nodes.size(); i++) {
    if (state[i] == DONE) {
      kept.push_back(static_cast<int64_t>(i));
    }
  }
}

Matrices Skeleton::inverse_binds(const Buffers &buffers) const {
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
    out[j] = Matrix(&values[16 * j]);
  }
  return out;
}

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

}  // namespace gltf
