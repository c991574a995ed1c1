/* The nodes of a glTF document: which meshes its scene shows, and where. */
#ifndef ORB_FORMAT_GLTF_SCENE_HH
#define ORB_FORMAT_GLTF_SCENE_HH

#include <utility>

#include "format/gltf_values.hh"

namespace gltf {

struct Matrix {
  double m[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; /* column-major */
  bool identity = true;

  Matrix() = default;
  explicit Matrix(const double values[16]) {
    const Matrix one;
    std::memcpy(m, values, sizeof m);
    identity = std::memcmp(m, one.m, sizeof m) == 0;
  }

  double at(int row, int column) const { return m[4 * column + row]; }

  double determinant() const {
    return at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
           at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
           at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  }

  void point(const double p[3], double out[3]) const {
    for (int i = 0; i < 3; i++) {
      out[i] = identity ? p[i] : at(i, 0) * p[0] + at(i, 1) * p[1] + at(i, 2) * p[2] + at(i, 3);
    }
  }

  /* By the cofactors: the inverse transpose up to scale, defined for singular matrices too. */
  void normal(const double n[3], double out[3]) const {
    double sign = determinant() < 0 ? -1 : 1;
    for (int i = 0; i < 3; i++) {
      int a = (i + 1) % 3, b = (i + 2) % 3;
      double sum = 0;
      for (int j = 0; j < 3; j++) {
        int c = (j + 1) % 3, d = (j + 2) % 3;
        sum += (at(a, c) * at(b, d) - at(a, d) * at(b, c)) * n[j];
      }
      out[i] = identity ? n[i] : sign * sum;
    }
  }
};

Matrix operator*(const Matrix &a, const Matrix &b);

/* The transform of a node to its parent. */
Matrix matrix_of(const cJSON *node);

/* The number of a node in a list of them. */
int64_t number_of(const cJSON *value);

/* A mesh as a node of the scene shows it. */
struct Shown {
  int64_t mesh;
  Matrix matrix;
  const cJSON *node; /* NULL: no node shows it */
};

/* Each node of the scene that shows a mesh, in depth-first order from the roots. Without nodes and scenes: each of the
 * mesh_count meshes once. */
Counted<Shown> shown_meshes(orb_context *ctx, const cJSON *doc, size_t mesh_count);

}  // namespace gltf

#endif
