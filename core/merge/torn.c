/* The repairs split_vertices, split_nonmanifold and close_handles give a vertex of the file several copies at one
 * place. On a later shape each copy has a place of its own, and the asset, which keeps the file's vertices, has only
 * the first. A triangle of the asset is one of the supermesh whose corners have moved, so no point of it is farther
 * away than before by more than the longest of these ways. Covers are not in the asset: a point of a cover is as far
 * from the asset, at most, as the box around that cover is wide, since the asset has its rim. */
#include "merge/torn.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "orbmorph/transfer.h"

/* The first copy of vertex v, which the asset has; v itself if it is not split. */
static int32_t first_copy(const orb_mesh *repaired, int32_t v) {
  const int32_t of = repaired->source[v], first = of >= 0 ? repaired->vertex_of_source[of] : -1;
  return first >= 0 && first != v &&
                 orb_distance2(repaired->positions + 3 * (size_t)first, repaired->positions + 3 * (size_t)v) == 0
             ? first
             : v;
}

void orb_torn_close(const orb_mesh *repaired, const orb_supermesh *supermesh, double *positions, double *moved) {
  const int32_t count =
      supermesh->vertex_count < repaired->vertex_count ? supermesh->vertex_count : repaired->vertex_count;
  *moved = 0;
  for (int32_t v = 0; v < count; v++) {
    const int32_t first = first_copy(repaired, v);
    if (first != v && first < count) {
      *moved = fmax(*moved, sqrt(orb_distance2(positions + 3 * (size_t)first, positions + 3 * (size_t)v)));
      memcpy(positions + 3 * (size_t)v, positions + 3 * (size_t)first, sizeof(double[3]));
    }
  }
}

/* Has a repair split a vertex, or covered what it opened? */
static int has_torn(const orb_mesh *repaired) {
  int has = 0;
  for (int32_t v = 0; v < repaired->vertex_count && !has; v++) {
    has = first_copy(repaired, v) != v;
  }
  for (int32_t t = 0; t < repaired->triangle_count && !has; t++) {
    has = repaired->source_triangle[t] == ORB_MADE_COVER;
  }
  return has;
}

/* Joins the vertices of each cover. covered: of each vertex, whether it is of one. */
static void join_covers(const orb_mesh *repaired, const orb_supermesh *supermesh, int32_t *forest,
                        unsigned char *covered) {
  orb_forest_plant(forest, supermesh->vertex_count);
  for (int32_t t = 0; t < repaired->triangle_count && t < supermesh->triangle_count; t++) {
    const int32_t *v = supermesh->triangles + 3 * (size_t)t;
    if (repaired->source_triangle[t] == ORB_MADE_COVER) {
      for (int k = 0; k < 3; k++) {
        covered[v[k]] = 1;
        orb_forest_join(forest, v[0], v[k]);
      }
    }
  }
}

/* The widest box around a cover. box: room for 6 per vertex. */
static double widest(const double *positions, int32_t count, int32_t *forest, const unsigned char *covered,
                     double *box) {
  double most2 = 0;
  for (int32_t v = 0; v < count; v++) {
    for (int k = 0; k < 3; k++) {
      box[6 * (size_t)v + (size_t)k] = INFINITY;
      box[6 * (size_t)v + 3 + (size_t)k] = -INFINITY;
    }
  }
  for (int32_t v = 0; v < count; v++) {
    if (covered[v]) {
      double *one = box + 6 * (size_t)orb_forest_root(forest, v), wide2 = 0;
      for (int k = 0; k < 3; k++) {
        one[k] = fmin(one[k], positions[3 * (size_t)v + (size_t)k]);
        one[k + 3] = fmax(one[k + 3], positions[3 * (size_t)v + (size_t)k]);
        wide2 += (one[k + 3] - one[k]) * (one[k + 3] - one[k]);
      }
      most2 = fmax(most2, wide2);
    }
  }
  return sqrt(most2);
}

orb_status orb_report_torn(orb_context *ctx, const orb_mesh *repaired, orb_merge_result *out) {
  if (!has_torn(repaired)) {
    return ORB_OK;
  }
  const orb_supermesh *supermesh = &out->supermesh;
  const size_t n = (size_t)supermesh->vertex_count;
  double *positions = ORB_NEW(ctx, double, 3 * n), *box = ORB_NEW(ctx, double, 6 * n);
  int32_t *forest = ORB_NEW(ctx, int32_t, n);
  unsigned char *covered = ORB_NEW0(ctx, unsigned char, n);
  orb_status status = positions && box && forest && covered ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    join_covers(repaired, supermesh, forest, covered);
  }
  for (int32_t s = 1; s < supermesh->shape_count && status == ORB_OK; s++) {
    double moved;
    ORB_GO(status,
           orb_transfer_positions(ctx, &out->alignment.shapes[s], supermesh->places + (size_t)s * n,
                                  supermesh->vertex_count, positions),
           done);
    const double cover = widest(positions, supermesh->vertex_count, forest, covered, box);
    orb_torn_close(repaired, supermesh, positions, &moved);
    out->shapes[s].hausdorff += moved + cover; /* NaN stays: nothing is proved */
  }
done:
  orb_free(ctx, positions);
  orb_free(ctx, box);
  orb_free(ctx, forest);
  orb_free(ctx, covered);
  return status;
}
