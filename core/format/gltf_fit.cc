#include "format/gltf_fit.hh"

namespace gltf {

namespace {

/* A part that joints share must have this much of what the joint moves, or the joint follows all that it moves. */
const double SHARED = 1e-3;
/* Relative to the spread of a part: directions in which it has less are left as they are, as rounding fills them. */
const double FLAT = 1e-9;
/* How many times farther from the middle of its part a joint may get than the part has grown: in a direction in which
 * the part is thin, the map is not to be trusted. */
const double REACH = 3;

/* The part of the surface that a joint follows. */
struct Part {
  double moved = 0, shared = 0; /* area times weight, and times the weight of the joint above, too */
  double mass = 0, before[3] = {}, after[3] = {};
  double spread[9] = {}, image[9] = {}; /* of `before`, and of `after` against it; row-major */
  double size[2] = {};                  /* squared distances from the middle, before and after */
};

using Parts = Counted<Part>;

struct Fitter {
  const Skeleton &skeleton;
  const orb_skin_surface &surface;
  Parts parts;
  Indices up; /* of each joint: the nearest joint above that moves vertices, or NONE */

  Fitter(const Skeleton &bones, const orb_skin_surface &given)
      : skeleton(bones),
        surface(given),
        parts(bones.joints.size(), Part(), Charged<Part>(bones.ctx)),
        up(bones.joints.size(), NONE, Charged<int64_t>(bones.ctx)) {
    each([&](Part &part, size_t, double mass, double) { part.moved += mass; });
    find_up();
    each([&](Part &part, size_t, double mass, double share) { part.shared += mass * share; });
    weighted([&](Part &part, size_t v, double mass) {
      part.mass += mass;
      for (size_t k = 0; k < 3; k++) {
        part.before[k] += mass * surface.before[3 * v + k];
        part.after[k] += mass * surface.after[3 * v + k];
      }
    });
    for (Part &part : parts) {
      for (int k = 0; k < 3 && part.mass > 0; k++) {
        part.before[k] /= part.mass;
        part.after[k] /= part.mass;
      }
    }
    weighted([&](Part &part, size_t v, double mass) { spread_by(part, v, mass); });
  }

  /* Calls work(part, vertex, area × weight, weight of the joint above) for all that moves a vertex. */
  template <typename Work>
  void each(const Work &work) {
    for (size_t v = 0; v < static_cast<size_t>(surface.count); v++) {
      check_sometimes(skeleton.ctx, v);
      for (int k = 0; k < 4; k++) {
        size_t joint = surface.joints[v][k];
        double weight = static_cast<double>(surface.weights[v][k]), above = 0;
        if (!(weight > 0) || joint >= parts.size()) {
          continue;
        }
        for (int l = 0; l < 4 && up[joint] != NONE; l++) {
          above += surface.joints[v][l] == up[joint] ? static_cast<double>(surface.weights[v][l]) : 0;
        }
        work(parts[joint], v, surface.area[v] * weight, above);
      }
    }
  }

  /* The same with the weight that the vertex has in the part. */
  template <typename Work>
  void weighted(const Work &work) {
    each([&](Part &part, size_t v, double mass, double above) {
      double counts = part.shared > SHARED * part.moved ? mass * above : mass;
      if (counts > 0) {
        work(part, v, counts);
      }
    });
  }

  void find_up() {
    Indices joint_of(skeleton.nodes.size(), NONE, Charged<int64_t>(skeleton.ctx));
    for (size_t j = 0; j < parts.size(); j++) {
      if (parts[j].moved > 0) {
        joint_of[static_cast<size_t>(skeleton.joints[j])] = static_cast<int64_t>(j);
      }
    }
    Indices nearest(skeleton.nodes.size(), NONE, Charged<int64_t>(skeleton.ctx)); /* at or above a node */
    for (int64_t node : skeleton.order) {
      size_t n = static_cast<size_t>(node);
      int64_t parent = skeleton.above[n], above = parent == NONE ? NONE : nearest[static_cast<size_t>(parent)];
      nearest[n] = joint_of[n] == NONE ? above : joint_of[n];
      if (joint_of[n] != NONE) {
        up[static_cast<size_t>(joint_of[n])] = above;
      }
    }
  }

  void spread_by(Part &part, size_t v, double mass) const {
    double x[3], y[3];
    for (size_t k = 0; k < 3; k++) {
      x[k] = surface.before[3 * v + k] - part.before[k];
      y[k] = surface.after[3 * v + k] - part.after[k];
      part.size[0] += mass * x[k] * x[k];
      part.size[1] += mass * y[k] * y[k];
    }
    for (int r = 0; r < 3; r++) {
      for (int c = 0; c < 3; c++) {
        part.spread[3 * r + c] += mass * x[r] * x[c];
        part.image[3 * r + c] += mass * y[r] * x[c];
      }
    }
  }

  /* The way from the middle of the part after, for one before. */
  static void map(const Part &part, const double way[3], double out[3]) {
    double most = part.size[0], solved[3], length[2] = {};
    const double *m = part.spread;
    Matrix regular;
    regular.identity = false;
    for (int r = 0; r < 3; r++) {
      for (int c = 0; c < 3; c++) {
        regular.m[4 * c + r] = (most > 0 ? m[3 * r + c] / most : 0) + (r == c ? FLAT : 0);
      }
    }
    const Matrix inverted = inverse(regular);
    for (int r = 0; r < 3; r++) {
      solved[r] = inverted.at(r, 0) * way[0] + inverted.at(r, 1) * way[1] + inverted.at(r, 2) * way[2];
    }
    for (int r = 0; r < 3; r++) {
      const double *row = part.image + 3 * r;
      out[r] = most > 0 ? (row[0] * solved[0] + row[1] * solved[1] + row[2] * solved[2]) / most : 0;
      length[0] += way[r] * way[r];
      length[1] += out[r] * out[r];
    }
    double grown = most > 0 ? part.size[1] / most : 0;
    if (!(length[1] <= REACH * REACH * grown * length[0])) { /* as the part has grown */
      for (int r = 0; r < 3; r++) {
        out[r] = std::sqrt(grown) * way[r];
      }
    }
  }
};

}  // namespace

Numbers fit_joints(const Skeleton &skeleton, const orb_skin_surface &surface, const Numbers &rest) {
  const Fitter fitter(skeleton, surface);
  Numbers out(rest.size(), NAN, Charged<double>(skeleton.ctx));
  for (size_t j = 0; j < fitter.parts.size(); j++) {
    const Part &part = fitter.parts[j];
    double way[3], mapped[3];
    if (!(part.mass > 0)) {
      continue;
    }
    for (size_t k = 0; k < 3; k++) {
      way[k] = rest[3 * j + k] - part.before[k];
    }
    Fitter::map(part, way, mapped);
    for (size_t k = 0; k < 3; k++) {
      out[3 * j + k] = part.after[k] + mapped[k];
    }
  }
  return out;
}

}  // namespace gltf
