/* The height of a vertex is its distance, along the normal, from the smoothed surface. Smoothing is one implicit step
 * of the heat equation (Desbrun et al. 1999), so its reach does not depend on the triangles. Poses and girths change
 * heights little, but for the joints: a kneecap, a chin or a muscle stands out in every pose. */
#include "elastic/relief.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"

enum {
  BLOCK = 256,     /* vertices of one task */
  STEPS_MOST = 200 /* of conjugate gradients: 7,000 vertices take 5 to 20, and 186,000 take 46 to 157. After these steps
                      only what is far wider than the surroundings is left, and heights hardly change */
};
/* The residual at which they end, relative to the first one. With 0.001, people come no nearer to the truth. */
static const double SETTLED = 1e-2;
/* The constants below were chosen with 8 landmarks, on the 20 pairs of people of the half `choose` of
 * tests/bench/correspond.py, unless they say otherwise. */

/* The smallest surroundings, in radii of a ball of the shape's area; the next ones are twice as large. With 0.03 people
 * come as near to the truth, and with 0.1 they stay a third farther away in another pose. */
static const double SMALLEST = 0.05;
/* The least smallest surroundings, in mean edges: smaller ones hold no vertex but the own one. Not varied. */
static const double EDGES = 1.1;
/* Damping of a step, per squared radius and for each unit of noise: where the relief slopes less than its root, a step
 * says little. Noise makes two people hold each other by their relief less than a person in two poses does: with the
 * same damping for all, 20 is best for one person, and 80 for two. With 240, people come as near to the truth, and with
 * 400 they stay a hundredth farther away without landmarks. */
static const double DAMPING = 300;
/* The least noise, which keeps flat surroundings regular: the same person in two poses has more. */
static const double NOISE_LEAST = 0.05;
/* A difference of two heights counts up to this, in standard deviations: larger ones are other bumps. */
static const double DIFFERENCE_MOST = 1;
/* The longest step, in radii. */
static const double STEP_MOST = 0.1;
/* Share of a step that is taken: a step is repeated in each round. 0.2 leads half as far, and 0.8 no farther. */
static const double TAKEN = 0.4;
/* The least standard deviation of heights, relative to the size of their surroundings. Below it they are noise of the
 * triangles, and count as 0: people and animals have 0.07 to 0.13, a ball of 2,562 vertices has 0.0014. */
static const double FLAT = 2e-3;

void orb_relief_free(orb_context *ctx, orb_relief *relief) {
  orb_free(ctx, relief->height);
  orb_free(ctx, relief->slope);
  memset(relief, 0, sizeof *relief);
}

static double mean_edge(const orb_body *b) {
  double sum = 0;
  const int32_t count = b->start[b->count];
  for (int32_t v = 0; v < b->count; v++) {
    for (int32_t i = b->start[v]; i < b->start[v + 1]; i++) {
      sum += sqrt(orb_distance2(b->mesh->positions + 3 * (size_t)v, b->mesh->positions + 3 * (size_t)b->next[i]));
    }
  }
  return count > 0 ? sum / count : 0;
}

double orb_relief_grain(const orb_body *a, const orb_body *b) {
  return fmax(mean_edge(a), mean_edge(b));
}

/* A step of the heat equation: mass/time · (out − in) = what the edges of out add up to. Solved by conjugate gradients
 * with the diagonal as preconditioner, for three coordinates side by side. */
typedef struct heat {
  const orb_body *body;
  const double *in; /* 3 per vertex, as all that follow but the diagonal */
  double *out;      /* begins as in */
  double *residual, *direction, *product;
  double *diagonal; /* one per vertex */
  double time;
  double along[3], again[3]; /* lengths of the step along the direction, and of the last direction in the new one */
  double (*sum)[3];          /* of each block of BLOCK vertices */
} heat;

static int32_t block_count(const orb_body *body) {
  return (body->count + BLOCK - 1) / BLOCK;
}

static int32_t block_end(const heat *h, int64_t block) {
  return block + 1 < block_count(h->body) ? (int32_t)(block + 1) * BLOCK : h->body->count;
}

/* diagonal · x − the neighbours of x, at vertex v. */
static void apply(const heat *h, const double *x, int32_t v, double out[3]) {
  const orb_body *b = h->body;
  for (size_t k = 0; k < 3; k++) {
    out[k] = h->diagonal[v] * x[3 * (size_t)v + k];
  }
  for (int32_t i = b->start[v]; i < b->start[v + 1]; i++) {
    for (size_t k = 0; k < 3; k++) {
      out[k] -= b->weight[i] * x[3 * (size_t)b->next[i] + k];
    }
  }
}

/* The first residual and direction; sum: of the products of both. */
static void begin_blocks(void *arg, int64_t begin, int64_t end, int thread) {
  heat *h = arg;
  const orb_body *b = h->body;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    memset(h->sum[i], 0, sizeof h->sum[i]);
    for (int32_t v = (int32_t)i * BLOCK; v < block_end(h, i); v++) {
      h->diagonal[v] = b->mass[v] / h->time + ORB_TINY;
      for (int32_t e = b->start[v]; e < b->start[v + 1]; e++) {
        h->diagonal[v] += b->weight[e];
      }
      double product[3];
      apply(h, h->in, v, product);
      for (size_t k = 0; k < 3; k++) {
        const size_t at = 3 * (size_t)v + k;
        h->out[at] = h->in[at];
        h->residual[at] = b->mass[v] / h->time * h->in[at] - product[k];
        h->direction[at] = h->residual[at] / h->diagonal[v];
        h->sum[i][k] += h->residual[at] * h->direction[at];
      }
    }
  }
}

/* sum: of direction · A · direction. */
static void multiply_blocks(void *arg, int64_t begin, int64_t end, int thread) {
  heat *h = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    memset(h->sum[i], 0, sizeof h->sum[i]);
    for (int32_t v = (int32_t)i * BLOCK; v < block_end(h, i); v++) {
      apply(h, h->direction, v, h->product + 3 * (size_t)v);
      for (size_t k = 0; k < 3; k++) {
        h->sum[i][k] += h->direction[3 * (size_t)v + k] * h->product[3 * (size_t)v + k];
      }
    }
  }
}

/* A step along the direction; sum: of residual · residual / diagonal. */
static void step_blocks(void *arg, int64_t begin, int64_t end, int thread) {
  heat *h = arg;
  (void)thread;
  for (int64_t i = begin; i < end; i++) {
    memset(h->sum[i], 0, sizeof h->sum[i]);
    for (int32_t v = (int32_t)i * BLOCK; v < block_end(h, i); v++) {
      for (size_t k = 0; k < 3; k++) {
        const size_t at = 3 * (size_t)v + k;
        h->out[at] += h->along[k] * h->direction[at];
        h->residual[at] -= h->along[k] * h->product[at];
        h->sum[i][k] += h->residual[at] * h->residual[at] / h->diagonal[v];
      }
    }
  }
}

/* The next direction. */
static void redirect_blocks(void *arg, int64_t begin, int64_t end, int thread) {
  heat *h = arg;
  (void)thread;
  for (int32_t v = (int32_t)begin * BLOCK; v < block_end(h, end - 1); v++) {
    for (size_t k = 0; k < 3; k++) {
      const size_t at = 3 * (size_t)v + k;
      h->direction[at] = h->residual[at] / h->diagonal[v] + h->again[k] * h->direction[at];
    }
  }
}

/* Runs body over all blocks, and adds up their sums in order, so that no number of threads changes the result. */
static void sum_blocks(orb_context *ctx, heat *h, orb_loop_fn body, double total[3]) {
  orb_parallel_for(ctx, block_count(h->body), 1, body, h);
  memset(total, 0, sizeof(double[3]));
  for (int32_t i = 0; i < block_count(h->body); i++) {
    for (int k = 0; k < 3; k++) {
      total[k] += h->sum[i][k];
    }
  }
}

static orb_status smooth(orb_context *ctx, heat *h) {
  double first[3], last[3], now[3], curvature[3];
  sum_blocks(ctx, h, begin_blocks, first);
  memcpy(last, first, sizeof last);
  for (int step = 0; step < STEPS_MOST; step++) {
    int settled = 1;
    for (int k = 0; k < 3; k++) {
      settled = settled && !(last[k] > SETTLED * SETTLED * first[k]);
    }
    if (settled) {
      break;
    }
    ORB_TRY(orb_context_check(ctx));
    sum_blocks(ctx, h, multiply_blocks, curvature);
    for (int k = 0; k < 3; k++) {
      h->along[k] = curvature[k] > 0 ? last[k] / curvature[k] : 0;
    }
    sum_blocks(ctx, h, step_blocks, now);
    for (int k = 0; k < 3; k++) {
      h->again[k] = last[k] > 0 ? now[k] / last[k] : 0;
    }
    memcpy(last, now, sizeof last);
    orb_parallel_for(ctx, block_count(h->body), 1, redirect_blocks, h);
  }
  return ORB_OK;
}

/* Gives the heights of one size mean 0 and variance 1 over the surface. */
static void standardize(const orb_body *b, double *height, double size) {
  double mass = ORB_TINY, sum = 0, squares = 0;
  for (int32_t v = 0; v < b->count; v++) {
    const double h = height[ORB_RELIEF_SIZES * (size_t)v];
    mass += b->mass[v];
    sum += b->mass[v] * h;
    squares += b->mass[v] * h * h;
  }
  const double mean = sum / mass, deviation = sqrt(fmax(0, squares / mass - mean * mean)),
               scale = deviation > FLAT * size ? 1 / deviation : 0;
  for (int32_t v = 0; v < b->count; v++) {
    double *h = height + ORB_RELIEF_SIZES * (size_t)v;
    *h = scale * (*h - mean);
  }
}

static void heat_free(orb_context *ctx, heat *h) {
  orb_free(ctx, h->residual);
  orb_free(ctx, h->direction);
  orb_free(ctx, h->product);
  orb_free(ctx, h->diagonal);
  orb_free(ctx, h->sum);
}

static orb_status heat_create(orb_context *ctx, const orb_body *body, heat *h) {
  const size_t n = (size_t)body->count;
  h->body = body;
  h->residual = ORB_NEW(ctx, double, 3 * n);
  h->direction = ORB_NEW(ctx, double, 3 * n);
  h->product = ORB_NEW(ctx, double, 3 * n);
  h->diagonal = ORB_NEW(ctx, double, n);
  h->sum = orb_alloc(ctx, (size_t)block_count(body), sizeof *h->sum);
  return h->residual && h->direction && h->product && h->diagonal && h->sum ? ORB_OK : ORB_E_NO_MEMORY;
}

/* Fills the heights against surroundings of one size. place, normal: room for 3 per vertex. */
static orb_status fill_heights(orb_context *ctx, heat *h, double size, double *place, double *normal, double *height) {
  const orb_body *b = h->body;
  h->time = size * size / 4;
  h->in = b->mesh->positions;
  h->out = place;
  ORB_TRY(smooth(ctx, h));
  h->in = b->normal;
  h->out = normal;
  ORB_TRY(smooth(ctx, h));
  for (int32_t v = 0; v < b->count; v++) {
    double out[3], *n = normal + 3 * (size_t)v;
    (void)orb_normalize(n);
    orb_sub(b->mesh->positions + 3 * (size_t)v, place + 3 * (size_t)v, out);
    height[ORB_RELIEF_SIZES * (size_t)v] = orb_dot(out, n);
  }
  standardize(b, height, size);
  return ORB_OK;
}

/* The slope at a vertex is the mean of the gradients on its triangles, by their areas. area: zeroed room, one per
 * vertex. */
static void fill_slopes(const orb_body *b, const double *height, double *area, double *slope) {
  const double *x = b->mesh->positions;
  memset(slope, 0, 3 * ORB_RELIEF_SIZES * (size_t)b->count * sizeof *slope);
  for (int32_t t = 0; t < b->mesh->triangle_count; t++) {
    const int32_t *v = b->mesh->triangles + 3 * (size_t)t;
    double n[3], gradient[ORB_RELIEF_SIZES][3] = {{0}};
    orb_triangle_normal_at(x, v, n);
    const double twice = orb_length(n);
    if (!(twice > 0)) {
      continue;
    }
    for (int i = 0; i < 3; i++) {
      double edge[3], across[3];
      orb_sub(x + 3 * (size_t)v[(i + 2) % 3], x + 3 * (size_t)v[(i + 1) % 3], edge);
      orb_cross(n, edge, across);
      for (size_t s = 0; s < ORB_RELIEF_SIZES; s++) { /* times the area, which is n / 2 */
        for (int k = 0; k < 3; k++) {
          gradient[s][k] += height[ORB_RELIEF_SIZES * (size_t)v[i] + s] * across[k] / twice / 2;
        }
      }
    }
    for (int i = 0; i < 3; i++) {
      area[v[i]] += twice / 2;
      for (int k = 0; k < 3 * ORB_RELIEF_SIZES; k++) {
        slope[3 * ORB_RELIEF_SIZES * (size_t)v[i] + (size_t)k] += gradient[k / 3][k % 3];
      }
    }
  }
  for (int32_t v = 0; v < b->count; v++) {
    for (size_t k = 0; k < 3 * ORB_RELIEF_SIZES; k++) {
      slope[3 * ORB_RELIEF_SIZES * (size_t)v + k] /= area[v] + ORB_TINY;
    }
  }
}

orb_status orb_relief_create(orb_context *ctx, const orb_body *body, double grain, orb_relief *out) {
  const size_t n = (size_t)body->count;
  double *place = ORB_NEW(ctx, double, 3 * n), *normal = ORB_NEW(ctx, double, 3 * n), *area = ORB_NEW0(ctx, double, n);
  heat h = {0};
  out->height = ORB_NEW(ctx, double, (size_t)ORB_RELIEF_SIZES *n);
  out->slope = ORB_NEW(ctx, double, 3 * ORB_RELIEF_SIZES * n);
  orb_status status = heat_create(ctx, body, &h);
  if (!place || !normal || !area || !out->height || !out->slope) {
    status = ORB_E_NO_MEMORY;
  }
  double size = fmax(SMALLEST, EDGES * grain);
  for (int s = 0; s < ORB_RELIEF_SIZES && status == ORB_OK; s++, size *= 2) {
    status = fill_heights(ctx, &h, size, place, normal, out->height + s);
  }
  if (status == ORB_OK) {
    fill_slopes(body, out->height, area, out->slope);
  }
  heat_free(ctx, &h);
  orb_free(ctx, place);
  orb_free(ctx, normal);
  orb_free(ctx, area);
  return status;
}

double orb_relief_noise(const orb_body *a, const orb_relief *relief_a, const orb_relief *relief_b,
                        const int32_t *place) {
  const double most = DIFFERENCE_MOST * DIFFERENCE_MOST;
  double sum = 0, mass = ORB_TINY;
  for (int32_t v = 0; v < a->count; v++) {
    for (size_t s = 0; s < ORB_RELIEF_SIZES; s++) {
      const double difference = relief_a->height[ORB_RELIEF_SIZES * (size_t)v + s] -
                                relief_b->height[ORB_RELIEF_SIZES * (size_t)place[v] + s];
      sum += a->mass[v] * fmin(most, difference * difference);
      mass += a->mass[v];
    }
  }
  return sum / mass;
}

void orb_relief_step(const double *height, const orb_relief *b, int32_t u, const double from[3], const double normal[3],
                     double noise, double step[3]) {
  const double damping = DAMPING * fmax(NOISE_LEAST, noise);
  double normal_matrix[9] = {damping, 0, 0, 0, damping, 0, 0, 0, damping}, right[3] = {0}, cofactors[9];
  for (size_t s = 0; s < ORB_RELIEF_SIZES; s++) {
    const size_t at = ORB_RELIEF_SIZES * (size_t)u + s;
    const double *slope = b->slope + 3 * at;
    const double missing = height[s] - b->height[at] - orb_dot(slope, from),
                 counted = fmin(DIFFERENCE_MOST, fmax(-DIFFERENCE_MOST, missing));
    orb_add_outer(normal_matrix, slope, slope, 1);
    for (int k = 0; k < 3; k++) {
      right[k] += slope[k] * counted;
    }
  }
  const double det = orb_cofactors(normal_matrix, cofactors); /* above 0, by the damping */
  for (int k = 0; k < 3; k++) {
    step[k] = orb_dot(cofactors + 3 * k, right) / det;
  }
  const double length = orb_length(step), share = TAKEN * (length > STEP_MOST ? STEP_MOST / length : 1),
               off = orb_dot(step, normal);
  for (int k = 0; k < 3; k++) {
    step[k] = share * (step[k] - off * normal[k]);
  }
}
