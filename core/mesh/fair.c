#include "mesh/fair.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/factor.h"
#include "numeric/vec3.h"

/* No vertex of a fair surface lies this far from the centre of its rim, in radii of the rim. The cap of a sphere beyond
 * its equator does not; the plate over a rim whose faces point everywhere may. */
static const double FAR = 2;
/* A vertex has at least this area, as a share of the mean one: the inverse is its weight. */
static const double AREA = 1e-3;

/* One weight of the Laplacian: its value at `row` depends on the vertex `column`. */
typedef struct weight {
  int32_t row, column;
  double value;
} weight;

typedef struct plate {
  orb_context *ctx;
  orb_patch *patch;
  int64_t count;
  weight *list;     /* of vertices inside, sorted by row by group() */
  weight *sorted;   /* room for as many */
  int64_t *start;   /* per vertex of the patch: its first weight; one more at the end */
  double *constant; /* 3 per vertex of the patch: what the fixed vertices add to its Laplacian */
  double *area;     /* per vertex of the patch */
} plate;

/* Adds what one corner v of a triangle adds to the Laplacian there: up to 4 weights. b, c: its other vertices, −1
 * outside the patch. */
static void add_corner(plate *p, int32_t v, int32_t b, int32_t c, const double *at_b, const double *at_c) {
  const double *at_v = p->patch->positions + 3 * (size_t)v;
  const int32_t id[2] = {b, c};
  const double *at[2] = {at_b, at_c};
  double u[3], w[3], n[3];
  orb_sub(at_b, at_v, u);
  orb_sub(at_c, at_v, w);
  orb_cross(u, w, n);
  p->area[v] += orb_length(n) / 6;
  for (int k = 0; k < 2; k++) {
    const double value = 0.5 * orb_patch_cotangent(at_v, at[k], at[1 - k]);
    if (id[k] >= p->patch->rim) {
      p->list[p->count++] = (weight){v, id[k], value};
    }
    if (v >= p->patch->rim) {
      p->list[p->count++] = (weight){v, v, -value};
    }
    for (int i = 0; i < 3; i++) {
      p->constant[3 * v + i] += id[k] >= p->patch->rim ? 0 : value * at[k][i];
      p->constant[3 * v + i] -= v >= p->patch->rim ? 0 : value * at_v[i];
    }
  }
}

static void add_inside(plate *p) {
  const orb_patch *patch = p->patch;
  for (int32_t h = 0; h < 3 * patch->triangle_count; h++) {
    const int32_t b = patch->triangles[orb_next(h)], c = patch->triangles[orb_prev(h)];
    add_corner(p, patch->triangles[h], b, c, patch->positions + 3 * (size_t)b, patch->positions + 3 * (size_t)c);
  }
}

/* The faces of the surface around each vertex of the rim. */
static void add_outside(plate *p, const orb_surface *s, const int32_t *rim) {
  const orb_mesh *mesh = s->mesh;
  for (int32_t v = 0; v < p->patch->rim; v++) {
    for (int32_t h = rim[v]; h >= 0; h = s->twin[orb_prev(h)]) {
      const int32_t other[2] = {mesh->triangles[orb_next(h)], mesh->triangles[orb_prev(h)]};
      double at[2][3];
      for (int k = 0; k < 6; k++) {
        at[k / 3][k % 3] =
            (mesh->positions[3 * (size_t)other[k / 3] + (size_t)(k % 3)] - p->patch->centre[k % 3]) / p->patch->scale;
      }
      add_corner(p, v, -1, -1, at[0], at[1]);
    }
  }
}

/* Sorts the weights by row and adds up those of one place. */
static void group(plate *p) {
  const int32_t rows = p->patch->vertex_count;
  memset(p->start, 0, ((size_t)rows + 1) * sizeof *p->start);
  for (int64_t i = 0; i < p->count; i++) {
    p->start[p->list[i].row + 1]++;
  }
  for (int32_t v = 0; v < rows; v++) {
    p->start[v + 1] += p->start[v];
  }
  for (int64_t i = 0; i < p->count; i++) {
    p->sorted[p->start[p->list[i].row]++] = p->list[i];
  }
  int64_t kept = 0, from = 0;
  for (int32_t v = 0; v < rows; v++) {
    const int64_t end = p->start[v], first = kept;
    for (int64_t i = from; i < end; i++) {
      int64_t j = first;
      while (j < kept && p->list[j].column != p->sorted[i].column) {
        j++;
      }
      if (j < kept) {
        p->list[j].value += p->sorted[i].value;
      } else {
        p->list[kept++] = p->sorted[i];
      }
    }
    p->start[v] = first;
    from = end;
  }
  p->start[rows] = p->count = kept;
}

/* Solves for the least sum of squared Laplacians, each divided by its area. x: 3 per vertex inside. */
static orb_status solve(plate *p, double *x) {
  const int32_t rim = p->patch->rim, rows = p->patch->vertex_count, unknowns = rows - rim;
  int64_t count = 0, pairs = 0;
  for (int32_t v = 0; v < rows; v++) {
    pairs += (p->start[v + 1] - p->start[v]) * (p->start[v + 1] - p->start[v] - 1) / 2;
  }
  orb_coupling *couplings = ORB_NEW(p->ctx, orb_coupling, pairs);
  orb_factor *factor = NULL;
  double mean = 0, *diagonal = ORB_NEW0(p->ctx, double, unknowns);
  double *right = ORB_NEW0(p->ctx, double, 3 * (size_t)unknowns);
  orb_status status = couplings && diagonal && right ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; v < rows; v++) {
    mean += p->area[v] / rows;
  }
  for (int32_t v = 0; v < rows && status == ORB_OK; v++) {
    const double scale = 1 / fmax(p->area[v], AREA * mean);
    for (int64_t i = p->start[v]; i < p->start[v + 1]; i++) {
      const int32_t column = p->list[i].column - rim;
      diagonal[column] += scale * p->list[i].value * p->list[i].value;
      for (int k = 0; k < 3; k++) {
        right[3 * column + k] -= scale * p->list[i].value * p->constant[3 * v + k];
      }
      for (int64_t j = p->start[v]; j < i; j++) {
        couplings[count++] =
            (orb_coupling){column, p->list[j].column - rim, scale * p->list[i].value * p->list[j].value};
      }
    }
  }
  if (status == ORB_OK) {
    status = orb_factor_create(p->ctx, unknowns, couplings, count, &factor);
  }
  if (status == ORB_OK) {
    status = orb_factor_compute(factor, diagonal);
  }
  if (status == ORB_OK) {
    orb_factor_solve3(factor, right, x);
  }
  orb_factor_destroy(p->ctx, factor);
  orb_free(p->ctx, couplings);
  orb_free(p->ctx, diagonal);
  orb_free(p->ctx, right);
  return status;
}

static int is_near(const double *x, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    if (!(orb_dot(x + 3 * (size_t)i, x + 3 * (size_t)i) < FAR * FAR)) {
      return 0;
    }
  }
  return 1;
}

orb_status orb_patch_fair(const orb_surface *s, const int32_t *rim, orb_patch *patch) {
  const int32_t rows = patch->vertex_count, unknowns = rows - patch->rim;
  if (unknowns == 0) {
    return ORB_OK;
  }
  plate p = {.ctx = s->ctx, .patch = patch};
  double *x = ORB_NEW(s->ctx, double, 3 * (size_t)unknowns);
  orb_status status = ORB_E_NO_MEMORY;
  p.start = ORB_NEW(s->ctx, int64_t, (size_t)rows + 1);
  p.constant = ORB_NEW0(s->ctx, double, 3 * (size_t)rows);
  p.area = ORB_NEW0(s->ctx, double, rows);
  p.list = ORB_NEW(s->ctx, weight, 12 * (size_t)patch->triangle_count);
  p.sorted = ORB_NEW(s->ctx, weight, 12 * (size_t)patch->triangle_count);
  if (x && p.start && p.constant && p.area && p.list && p.sorted) {
    add_inside(&p);
    add_outside(&p, s, rim);
    group(&p);
    status = solve(&p, x);
  }
  if (status == ORB_OK && is_near(x, unknowns)) {
    memcpy(patch->positions + 3 * (size_t)patch->rim, x, 3 * (size_t)unknowns * sizeof *x);
  }
  status = status == ORB_E_INTERNAL ? ORB_OK : status; /* not positive definite in floating point */
  orb_free(s->ctx, x);
  orb_free(s->ctx, p.list);
  orb_free(s->ctx, p.sorted);
  orb_free(s->ctx, p.start);
  orb_free(s->ctx, p.constant);
  orb_free(s->ctx, p.area);
  return status;
}
