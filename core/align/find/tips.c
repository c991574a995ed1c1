#include "align/find/tips.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/rotate/procrustes.h"
#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

enum {
  LEAST = 4, /* pairs: three meet under wrong rotations too often */
  TURNS = 4  /* of partners and rotation; most settle in two */
};

/* Areas of the vertices: a third of each triangle around them. */
static void fill_areas(const orb_mesh *mesh, double *area) {
  memset(area, 0, (size_t)mesh->vertex_count * sizeof *area);
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const int32_t *v = mesh->triangles + 3 * (size_t)t;
    const double third = orb_triangle_area_at(mesh->positions, v) / 3;
    for (int k = 0; k < 3; k++) {
      area[v[k]] += third;
    }
  }
}

/* The mean distance of each vertex from all others. Returns the mean of these. */
static double fill_means(const orb_survey *survey, const double *area, int32_t n, double *mean) {
  double total = 0, sum = 0;
  for (int32_t v = 0; v < n; v++) {
    const float *row = survey->apart + (size_t)v * (size_t)n;
    mean[v] = 0;
    for (int32_t u = 0; u < n; u++) {
      mean[v] += area[u] * (double)row[u];
    }
    total += area[v];
    sum += area[v] * mean[v];
  }
  return sum / total;
}

static int is_tip(const orb_survey *survey, const double *mean, int32_t n, int32_t v) {
  const float *row = survey->apart + (size_t)v * (size_t)n;
  int is = 1;
  for (int32_t u = 0; u < n && is; u++) {
    is = u == v || !((double)row[u] < ORB_FIND_TIP_NEAR) || mean[u] < mean[v] || (mean[u] == mean[v] && u > v);
  }
  return is;
}

/* Inserts a tip before all that are less far out. */
static void insert(orb_tips *out, const double *mean, int32_t v) {
  int32_t at = out->count < ORB_TIPS_MAX ? out->count++ : ORB_TIPS_MAX;
  for (; at > 0 && mean[out->vertex[at - 1]] < mean[v]; at--) {
    if (at < ORB_TIPS_MAX) {
      out->vertex[at] = out->vertex[at - 1];
    }
  }
  if (at < ORB_TIPS_MAX) {
    out->vertex[at] = v;
  }
}

orb_status orb_tips_find(orb_context *ctx, const orb_coarse_copy *copy, const orb_survey *survey, orb_tips *out) {
  const int32_t n = copy->mesh.vertex_count;
  double *area = ORB_NEW(ctx, double, n), *mean = ORB_NEW(ctx, double, n);
  const orb_status status = area && mean ? ORB_OK : ORB_E_NO_MEMORY;
  memset(out, 0, sizeof *out);
  if (status == ORB_OK) {
    fill_areas(&copy->mesh, area);
    const double usual = fill_means(survey, area, n, mean);
    for (int32_t v = 0; v < n; v++) {
      if (mean[v] >= ORB_FIND_TIP_FAR * usual && is_tip(survey, mean, n, v)) {
        insert(out, mean, v);
      }
    }
  }
  for (int32_t i = 0; i < out->count; i++) {
    memcpy(out->point[i], copy->points + 3 * (size_t)out->vertex[i], sizeof out->point[i]);
    for (int32_t k = 0; k < out->count; k++) {
      out->apart[i][k] = orb_survey_apart(survey, &copy->mesh, out->vertex[i], out->vertex[k]);
      out->log_apart[i][k] = log(out->apart[i][k] + ORB_FIND_AGREED_EDGE);
    }
  }
  orb_free(ctx, area);
  orb_free(ctx, mean);
  return status;
}

static double angle(const double p[3], const double q[3]) {
  return acos(fmin(1, fmax(-1, orb_dot(p, q))));
}

void orb_tip_match_fit(const orb_tips *first, const orb_tips *second, orb_tip_match *m) {
  double h[9] = {0};
  for (int32_t i = 0; i < first->count; i++) {
    if (m->to[i] >= 0) {
      orb_add_outer(h, second->point[m->to[i]], first->point[i], 1);
    }
  }
  (void)orb_nearest_rotation(h, m->rotation);
}

/* Finds partners under the rotation: the nearest pair first, until the next one is too far apart. */
static void find_partners(const orb_tips *first, const orb_tips *second, orb_tip_match *m) {
  const double least = cos(ORB_FIND_TIP_ANGLE);
  double near[ORB_TIPS_MAX][ORB_TIPS_MAX];
  int is_taken[ORB_TIPS_MAX] = {0};
  for (int32_t i = 0; i < first->count; i++) {
    double p[3];
    orb_rotate_point(m->rotation, first->point[i], p);
    m->to[i] = -1;
    for (int32_t k = 0; k < second->count; k++) {
      near[i][k] = orb_dot(p, second->point[k]);
    }
  }
  for (m->count = 0;; m->count++) {
    int32_t one = -1, other = -1;
    double best = least;
    for (int32_t i = 0; i < first->count; i++) {
      for (int32_t k = 0; k < second->count && m->to[i] < 0; k++) {
        if (!is_taken[k] && near[i][k] > best) {
          best = near[i][k];
          one = i;
          other = k;
        }
      }
    }
    if (one < 0) {
      return;
    }
    m->to[one] = other;
    is_taken[other] = 1;
  }
}

double orb_tip_match_angle(const orb_tips *first, const orb_tips *second, const orb_tip_match *m) {
  double away = 0;
  for (int32_t i = 0; i < first->count; i++) {
    double p[3];
    if (m->to[i] >= 0) {
      orb_rotate_point(m->rotation, first->point[i], p);
      away += angle(p, second->point[m->to[i]]) / m->count;
    }
  }
  return away;
}

static double cost_of(const orb_tips *first, const orb_tips *second, const orb_tip_match *m) {
  const int32_t most = first->count < second->count ? first->count : second->count;
  double stretched = 0;
  for (int32_t i = 0; i < first->count; i++) {
    for (int32_t k = 0; k < i && m->to[i] >= 0; k++) {
      stretched += m->to[k] < 0 ? 0 : fabs(first->log_apart[i][k] - second->log_apart[m->to[i]][m->to[k]]);
    }
  }
  return orb_tip_match_angle(first, second, m) + stretched / (m->count * (m->count - 1) / 2.0) +
         ORB_FIND_TIP_ALONE * (most - m->count);
}

int32_t orb_tip_match_keep(const orb_tip_match *m, int32_t most, int32_t count, orb_tip_match *list) {
  for (int32_t i = 0; i < count; i++) {
    if (memcmp(list[i].to, m->to, sizeof m->to) == 0) {
      return count;
    }
  }
  int32_t at = count < most ? count++ : most;
  for (; at > 0 && list[at - 1].cost > m->cost; at--) {
    if (at < most) {
      list[at] = list[at - 1];
    }
  }
  if (at < most) {
    list[at] = *m;
  }
  return count;
}

/* Starts from two tips and their partners, i → x and k → y. Returns whether enough tips find partners. */
static int match_from(const orb_tips *first, const orb_tips *second, const int32_t pair[4], orb_tip_match *m) {
  for (int32_t i = 0; i < ORB_TIPS_MAX; i++) {
    m->to[i] = -1;
  }
  m->to[pair[0]] = pair[2];
  m->to[pair[1]] = pair[3];
  for (int turn = 0; turn < TURNS; turn++) {
    orb_tip_match_fit(first, second, m);
    find_partners(first, second, m);
    if (m->count < LEAST) {
      return 0;
    }
  }
  orb_tip_match_fit(first, second, m);
  m->cost = cost_of(first, second, m);
  return 1;
}

int32_t orb_tips_match(const orb_tips *first, const orb_tips *second, int32_t most, orb_tip_match *out) {
  int32_t count = 0, pair[4];
  for (pair[0] = 1; pair[0] < first->count; pair[0]++) {
    for (pair[1] = 0; pair[1] < pair[0]; pair[1]++) {
      const double apart = angle(first->point[pair[0]], first->point[pair[1]]);
      for (pair[2] = 0; pair[2] < second->count; pair[2]++) {
        for (pair[3] = 0; pair[3] < second->count; pair[3]++) {
          orb_tip_match m;
          if (pair[2] != pair[3] &&
              fabs(apart - angle(second->point[pair[2]], second->point[pair[3]])) < ORB_FIND_TIP_ANGLE &&
              match_from(first, second, pair, &m)) {
            count = orb_tip_match_keep(&m, most, count, out);
          }
        }
      }
    }
  }
  return count;
}

void orb_tip_match_carry(const orb_tips *const tips[2], const orb_tip_match *match, int s, const double point[3],
                         double out[3]) {
  const double *m = match->rotation;
  double r[9], shift[3] = {0}, total = ORB_FIND_TIP_STAYS;
  for (int k = 0; k < 9; k++) {
    r[k] = s ? m[3 * (k % 3) + k / 3] : m[k];
  }
  orb_rotate_point(r, point, out);
  for (int32_t i = 0; i < tips[0]->count; i++) {
    if (match->to[i] >= 0) {
      const double *from = tips[s]->point[s ? match->to[i] : i], *to = tips[1 - s]->point[s ? i : match->to[i]];
      double p[3];
      orb_rotate_point(r, from, p);
      const double far = orb_distance2(p, out) + ORB_FIND_TIP_AT, weight = 1 / (far * far);
      total += weight;
      for (int k = 0; k < 3; k++) {
        shift[k] += weight * (to[k] - p[k]);
      }
    }
  }
  for (int k = 0; k < 3; k++) {
    out[k] += shift[k] / total;
  }
  orb_normalize(out);
}
