#include "merge/report.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "merge/name.h"
#include "merge/warn.h"
#include "numeric/vec3.h"

enum { ALL_PAIRS_UP_TO = 4 };      /* shapes; of more, only some pairs are reported, so that their number is linear */
static const double SLIVER = 0.02; /* quality() below which a triangle's stretch is mostly rounding */

/* A landmark without a supermesh vertex (rotate, or rbf inside triangles) is measured at the mean of its points on the
 * sphere, one from each shape. */

/* The point on the sphere of a point of a shape's surface, by the nearest place of the aligned mesh: the same surface
 * as the requested mesh, perhaps with more vertices. */
static void sphere_point(const orb_aligned_shape *shape, const orb_nearest *tree, const double at[3], double out[3]) {
  orb_place place;
  orb_nearest_query(tree, at, INFINITY, &place);
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; place.triangle >= 0 && k < 3; k++) {
    const double *p = shape->points + 3 * (int64_t)shape->mesh.triangles[3 * (int64_t)place.triangle + k];
    for (int c = 0; c < 3; c++) {
      out[c] += place.at[k] * p[c];
    }
  }
  orb_normalize(out);
}

/* Adds shape s's points on the sphere to `mean`. wanted: landmark_count × shape_count × 3 requested positions. */
static orb_status add_sphere_points(orb_context *ctx, const orb_merge_result *out, int32_t s, const double *wanted,
                                    double *mean) {
  const orb_aligned_shape *shape = &out->alignment.shapes[s];
  orb_nearest *tree = NULL;
  ORB_TRY(orb_nearest_create(ctx, shape->mesh.positions, shape->mesh.triangles, shape->mesh.triangle_count, &tree));
  for (int32_t i = 0; i < out->alignment.landmark_count; i++) {
    double point[3];
    sphere_point(shape, tree, wanted + 3 * ((int64_t)i * out->alignment.shape_count + s), point);
    for (int c = 0; c < 3; c++) {
      mean[3 * (int64_t)i + c] += point[c];
    }
  }
  orb_nearest_destroy(ctx, tree);
  return ORB_OK;
}

static orb_status residuals_of_shape(orb_context *ctx, orb_merge_result *out, int32_t s, const double *wanted,
                                     const double *mean) {
  const orb_aligned_shape *shape = &out->alignment.shapes[s];
  const orb_supermesh *supermesh = &out->supermesh;
  int32_t shapes = out->alignment.shape_count;
  orb_locator *locator = NULL;
  for (int32_t i = 0; i < out->alignment.landmark_count; i++) {
    orb_place place;
    double at[3];
    int32_t vertex = supermesh->landmark_vertices ? supermesh->landmark_vertices[i] : -1;
    if (vertex >= 0) {
      place = supermesh->places[(int64_t)s * supermesh->vertex_count + vertex];
    } else {
      if (!locator) {
        ORB_TRY(orb_locator_create(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                                   shape->mesh.triangle_count, NULL, &locator));
      }
      orb_locate(locator, mean + 3 * (int64_t)i, -1, &place);
    }
    orb_place_position(&shape->mesh, &place, at);
    out->landmark_residuals[(int64_t)i * shapes + s] =
        sqrt(orb_distance2(at, wanted + 3 * ((int64_t)i * shapes + s))) / out->shapes[s].diagonal;
  }
  orb_locator_destroy(ctx, locator);
  return ORB_OK;
}

static int all_are_vertices(const orb_supermesh *supermesh, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    if (!supermesh->landmark_vertices || supermesh->landmark_vertices[i] < 0) {
      return 0;
    }
  }
  return 1;
}

orb_status orb_report_landmarks(orb_context *ctx, const orb_align_shape *shapes, const orb_landmark *landmarks,
                                orb_merge_result *out) {
  int32_t count = out->alignment.landmark_count, shape_count = out->alignment.shape_count;
  double *wanted = ORB_NEW(ctx, double, 3 * (int64_t)count * shape_count);
  double *mean = ORB_NEW0(ctx, double, 3 * (int64_t)count);
  out->landmark_residuals = ORB_NEW(ctx, double, ((int64_t)count * shape_count));
  orb_status status = wanted && mean && out->landmark_residuals ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK || count == 0) {
    goto done;
  }
  for (int32_t i = 0; i < count; i++) {
    for (int32_t s = 0; s < shape_count; s++) {
      orb_place_position(shapes[s].mesh, &landmarks[i].at[s], wanted + 3 * ((int64_t)i * shape_count + s));
    }
  }
  for (int32_t s = 0; s < shape_count && !all_are_vertices(&out->supermesh, count); s++) {
    ORB_GO(status, add_sphere_points(ctx, out, s, wanted, mean), done);
  }
  for (int32_t i = 0; i < count; i++) {
    orb_normalize(mean + 3 * (int64_t)i);
  }
  for (int32_t s = 0; s < shape_count; s++) {
    ORB_GO(status, residuals_of_shape(ctx, out, s, wanted, mean), done);
  }
done:
  orb_free(ctx, wanted);
  orb_free(ctx, mean);
  return status;
}

/* The position on shape s of a place of the supermesh. */
static void supermesh_position(const orb_merge_result *out, int32_t s, const orb_place *on, double position[3]) {
  const orb_supermesh *supermesh = &out->supermesh;
  position[0] = position[1] = position[2] = 0;
  for (int k = 0; k < 3; k++) {
    int32_t v = supermesh->triangles[3 * (int64_t)on->triangle + k];
    double corner[3];
    orb_place_position(&out->alignment.shapes[s].mesh, &supermesh->places[(int64_t)s * supermesh->vertex_count + v],
                       corner);
    for (int c = 0; c < 3; c++) {
      position[c] += on->at[k] * corner[c];
    }
  }
}

static orb_status name_found(orb_context *ctx, const orb_align_shape *shapes, orb_merge_result *out) {
  const orb_alignment *alignment = &out->alignment;
  orb_status status = ORB_E_NO_MEMORY;
  double *at = ORB_NEW(ctx, double, 3 * (size_t)alignment->found_count);
  out->found_names = ORB_NEW0(ctx, const char *, alignment->found_count);
  if (at && out->found_names) {
    for (int32_t i = 0; i < alignment->found_count; i++) {
      orb_place_position(shapes[0].mesh, &alignment->found[(int64_t)i * alignment->shape_count], at + 3 * (size_t)i);
    }
    status = orb_name_points(ctx, shapes[0].mesh, at, alignment->found_count, out->found_names);
  }
  orb_free(ctx, at);
  return status;
}

orb_status orb_report_found(orb_context *ctx, const orb_align_shape *shapes, orb_merge_result *out) {
  const orb_alignment *alignment = &out->alignment;
  const orb_supermesh *supermesh = &out->supermesh;
  int32_t shape_count = alignment->shape_count;
  orb_locator *locator = NULL;
  if (alignment->found_count == 0) {
    return ORB_OK;
  }
  out->found_residuals = ORB_NEW(ctx, double, ((int64_t)alignment->found_count * shape_count));
  if (!out->found_residuals) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_locator_create(ctx, supermesh->points, supermesh->vertex_count, supermesh->triangles,
                             supermesh->triangle_count, NULL, &locator));
  for (int32_t i = 0; i < alignment->found_count; i++) {
    orb_place on;
    orb_locate(locator, alignment->found_points + 3 * (int64_t)i, -1, &on);
    for (int32_t s = 0; s < shape_count; s++) {
      int64_t cell = (int64_t)i * shape_count + s;
      double wanted[3], there[3];
      orb_place_position(shapes[s].mesh, &alignment->found[cell], wanted);
      supermesh_position(out, s, &on, there);
      out->found_residuals[cell] = sqrt(orb_distance2(wanted, there)) / out->shapes[s].diagonal;
    }
  }
  orb_locator_destroy(ctx, locator);
  return name_found(ctx, shapes, out);
}

/* Maps are composed from the first shape to each other one, and a morph goes from each shape to the next. */
static int is_reported(int32_t shape_count, int32_t a, int32_t b) {
  return shape_count <= ALL_PAIRS_UP_TO || a == 0 || b == a + 1;
}

static int32_t list_pairs(int32_t shape_count, orb_pair_report *pairs) {
  int32_t count = 0;
  for (int32_t a = 0; a < shape_count; a++) {
    for (int32_t b = a + 1; b < shape_count; b++) {
      if (!is_reported(shape_count, a, b)) {
        continue;
      }
      if (pairs) {
        pairs[count].a = a;
        pairs[count].b = b;
      }
      count++;
    }
  }
  return count;
}

/* 4√3 area / Σ edge²: 0 for a degenerate triangle, 1 for an equilateral one. */
static double quality(const double *positions, const int32_t *corner) {
  const double *p = positions + 3 * (int64_t)corner[0], *q = positions + 3 * (int64_t)corner[1];
  const double *r = positions + 3 * (int64_t)corner[2];
  double u[3], w[3], normal[3];
  orb_sub(q, p, u);
  orb_sub(r, p, w);
  orb_cross(u, w, normal);
  double edges = orb_dot(u, u) + orb_dot(w, w) + orb_distance2(q, r);
  return edges > 0 ? 3.4641016151377544 * orb_length(normal) / edges : 0;
}

/* Lists the triangles that are not slivers on `least` of the two shapes: a sliver's stretch is mostly rounding, and one
 * sliver can outweigh all other triangles in a mean. If less than a tenth is left, lists all. */
static int32_t keep_shapely(const orb_supermesh *supermesh, const double *a, const double *b, int least, int32_t *out) {
  int32_t count = 0;
  for (int64_t t = 0; t < supermesh->triangle_count; t++) {
    const int32_t *corner = supermesh->triangles + 3 * t;
    if ((quality(a, corner) >= SLIVER) + (quality(b, corner) >= SLIVER) >= least) {
      memcpy(out + 3 * (int64_t)count++, corner, 3 * sizeof *corner);
    }
  }
  if (count < supermesh->triangle_count / 10) {
    count = supermesh->triangle_count;
    memcpy(out, supermesh->triangles, 3 * (size_t)count * sizeof *out);
  }
  return count;
}

/* Appends the warnings of a pair. */
static orb_status warn_of_pair(orb_context *ctx, orb_merge_result *out, const orb_warn_pair *map, int32_t a,
                               int32_t b) {
  for (int kind = ORB_WARNING_STRETCHED; kind <= ORB_WARNING_THIN; kind++) {
    orb_warning *warning = &out->warnings[out->warning_count];
    *warning = (orb_warning){.kind = (orb_warning_kind)kind, .a = a, .b = b};
    ORB_TRY(kind == ORB_WARNING_THIN ? orb_warn_thin(ctx, map, warning) : orb_warn_stretched(ctx, map, warning));
    out->warning_count += warning->part_count > 0;
  }
  return ORB_OK;
}

/* Twice the area of a triangle. */
static double area_of(const double *positions, const int32_t *corner) {
  double u[3], w[3], n[3];
  orb_sub(positions + 3 * (int64_t)corner[1], positions + 3 * (int64_t)corner[0], u);
  orb_sub(positions + 3 * (int64_t)corner[2], positions + 3 * (int64_t)corner[0], w);
  orb_cross(u, w, n);
  return orb_length(n);
}

/* Counts the triangles that are inverted on either shape of the pair, and lists the largest that have a number. */
static void list_inverted(const orb_supermesh *supermesh, double *const *positions, unsigned char *const *inverted,
                          const int32_t *number, orb_pair_report *pair) {
  double size[ORB_INVERTED_LISTED];
  for (int32_t t = 0; t < supermesh->triangle_count; t++) {
    if (!inverted[pair->a][t] && !inverted[pair->b][t]) {
      continue;
    }
    pair->inverted_count++;
    if (!number || number[t] < 0) {
      continue;
    }
    const int32_t *corner = supermesh->triangles + 3 * (int64_t)t;
    const double own = fmax(area_of(positions[pair->a], corner), area_of(positions[pair->b], corner));
    int32_t at = pair->inverted_listed;
    if (at == ORB_INVERTED_LISTED && !(own > size[at - 1])) {
      continue;
    }
    at = at == ORB_INVERTED_LISTED ? at - 1 : pair->inverted_listed++;
    for (; at > 0 && own > size[at - 1]; at--) {
      size[at] = size[at - 1];
      pair->inverted_triangles[at] = pair->inverted_triangles[at - 1];
    }
    size[at] = own;
    pair->inverted_triangles[at] = number[t];
  }
  pair->inverted_fraction = (double)pair->inverted_count / supermesh->triangle_count;
}

static orb_status measure_pair(orb_context *ctx, orb_merge_result *out, double *const *positions, const double *moves,
                               orb_pair_report *pair) {
  const orb_supermesh *supermesh = &out->supermesh;
  int32_t *shapely = ORB_NEW(ctx, int32_t, 3 * (int64_t)supermesh->triangle_count);
  if (!shapely) {
    return ORB_E_NO_MEMORY;
  }
  int32_t count = keep_shapely(supermesh, positions[pair->a], positions[pair->b], 2, shapely);
  orb_status status =
      orb_distortion_measure(ctx, positions[pair->a], positions[pair->b], shapely, count, &pair->distortion);
  if (status == ORB_OK) {
    /* A sliver on one shape alone is where the map crushed a triangle. */
    count = keep_shapely(supermesh, positions[pair->a], positions[pair->b], 1, shapely);
    const orb_warn_pair map = {.triangles = shapely,
                               .triangle_count = count,
                               .vertex_count = supermesh->vertex_count,
                               .position = {positions[pair->a], positions[pair->b]},
                               .move = {moves + 16 * pair->a, moves + 16 * pair->b}};
    status = warn_of_pair(ctx, out, &map, pair->a, pair->b);
  }
  orb_free(ctx, shapely);
  return status;
}

orb_status orb_report_pairs(orb_context *ctx, const int32_t *number, orb_merge_result *out) {
  const orb_supermesh *supermesh = &out->supermesh;
  int32_t shape_count = supermesh->shape_count;
  double **positions = ORB_NEW0(ctx, double *, shape_count);
  unsigned char **inverted = ORB_NEW0(ctx, unsigned char *, shape_count);
  out->pair_count = list_pairs(shape_count, NULL);
  out->pairs = ORB_NEW0(ctx, orb_pair_report, out->pair_count);
  out->warnings = ORB_NEW0(ctx, orb_warning, 2 * (int64_t)out->pair_count);
  double *moves = ORB_NEW(ctx, double, 16 * (int64_t)shape_count);
  orb_status status = positions && inverted && out->pairs && out->warnings && moves ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    status = orb_asset_transforms(ctx, supermesh, out->alignment.shapes, ORB_FIT_SIMILARITY, moves, NULL);
  }
  for (int32_t s = 0; status == ORB_OK && s < shape_count; s++) {
    positions[s] = ORB_NEW(ctx, double, 3 * (int64_t)supermesh->vertex_count);
    inverted[s] = ORB_NEW(ctx, unsigned char, supermesh->triangle_count);
    if (!positions[s] || !inverted[s]) {
      status = ORB_E_NO_MEMORY;
      break;
    }
    status =
        orb_transfer_positions(ctx, &out->alignment.shapes[s], supermesh->places + (int64_t)s * supermesh->vertex_count,
                               supermesh->vertex_count, positions[s]);
    if (status == ORB_OK) {
      status = orb_mark_inverted(ctx, supermesh, &out->alignment.shapes[s], s, positions[s], inverted[s]);
    }
  }
  if (status == ORB_OK) {
    list_pairs(shape_count, out->pairs);
  }
  for (int32_t i = 0; status == ORB_OK && i < out->pair_count; i++) {
    list_inverted(supermesh, positions, inverted, number, &out->pairs[i]);
    status = measure_pair(ctx, out, positions, moves, &out->pairs[i]);
  }
  for (int32_t s = 0; s < shape_count; s++) {
    if (positions) {
      orb_free(ctx, positions[s]);
    }
    if (inverted) {
      orb_free(ctx, inverted[s]);
    }
  }
  orb_free(ctx, positions);
  orb_free(ctx, inverted);
  orb_free(ctx, moves);
  return status;
}
