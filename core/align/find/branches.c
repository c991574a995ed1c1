#include "align/find/branches.h"

#include <math.h>

#include "align/find/params.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum { LEAST = 4 }; /* tips: fewer have no branches */

static int32_t tips_of(const orb_tips *tips) {
  return tips->count < ORB_BRANCHES_TIPS ? tips->count : ORB_BRANCHES_TIPS;
}

/* The differences of the three sums of distances between four tips. */
static void fill_differences(const orb_tips *tips, const int32_t q[4], double out[3]) {
  const double sum[3] = {tips->apart[q[0]][q[1]] + tips->apart[q[2]][q[3]],
                         tips->apart[q[0]][q[2]] + tips->apart[q[1]][q[3]],
                         tips->apart[q[0]][q[3]] + tips->apart[q[1]][q[2]]};
  for (int k = 0; k < 3; k++) {
    out[k] = sum[k] - sum[(k + 1) % 3];
  }
}

/* By how much the differences of four tips differ from those of their partners. The lengths of a trunk are half of
 * them. */
static double differ(const orb_tips *first, const orb_tips *second, const int32_t q[4], const int32_t *to) {
  const int32_t partner[4] = {to[q[0]], to[q[1]], to[q[2]], to[q[3]]};
  double own[3], other[3], sum = 0;
  fill_differences(first, q, own);
  fill_differences(second, partner, other);
  for (int k = 0; k < 3; k++) {
    sum += fabs(own[k] - other[k]) / 2;
  }
  return sum / 3;
}

/* The mean of that over all sets of four tips that have partners. */
static double cost_of_branches(const orb_tips *first, const orb_tips *second, const orb_tip_match *m) {
  int32_t pair[ORB_BRANCHES_TIPS], n = 0, count = 0;
  double sum = 0;
  for (int32_t i = 0; i < tips_of(first); i++) {
    if (m->to[i] >= 0) {
      pair[n++] = i;
    }
  }
  for (int32_t i = 3; i < n; i++) {
    for (int32_t j = 2; j < i; j++) {
      for (int32_t k = 1; k < j; k++) {
        for (int32_t l = 0; l < k; l++) {
          const int32_t q[4] = {pair[i], pair[j], pair[k], pair[l]};
          sum += differ(first, second, q, m->to);
          count++;
        }
      }
    }
  }
  return sum / count;
}

/* Gives tip i its next partner that no tip before it has, or none if tips may be left over. Returns whether there is
 * one. */
static int advance(orb_tip_match *m, int32_t i, int32_t partners, int32_t *left_over, int *was_left) {
  if (*was_left) {
    *was_left = 0;
    ++*left_over;
    return 0;
  }
  for (int32_t next = m->to[i] + 1; next < partners; next++) {
    int is_free = 1;
    for (int32_t k = 0; k < i && is_free; k++) {
      is_free = m->to[k] != next;
    }
    if (is_free) {
      m->to[i] = next;
      return 1;
    }
  }
  m->to[i] = -1;
  *was_left = *left_over > 0;
  *left_over -= *was_left;
  return *was_left;
}

/* The least and the greatest distance from tip i at which its paths to two others part. is_meant: which tips these may
 * be; NULL: all. */
static void find_partings(const orb_tips *tips, const int *is_meant, int32_t i, double *least, double *most) {
  *least = INFINITY;
  *most = 0;
  for (int32_t j = 0; j < tips->count; j++) {
    for (int32_t k = 0; k < j; k++) {
      if (j != i && k != i && (!is_meant || (is_meant[j] && is_meant[k]))) {
        const double parting = (tips->apart[i][j] + tips->apart[i][k] - tips->apart[j][k]) / 2;
        *least = fmin(*least, parting);
        *most = fmax(*most, parting);
      }
    }
  }
}

/* The length of a tip's own limb. */
static double limb_length(const orb_tips *tips, int32_t i) {
  double least, most;
  find_partings(tips, NULL, i, &least, &most);
  return fmax(0, least);
}

/* The sum of the lengths of limbs without a partner. That of a knee is short. */
static double length_left_over(const orb_tips *first, const orb_tips *second, const orb_tip_match *m) {
  int is_taken[ORB_TIPS_MAX] = {0};
  double sum = 0;
  for (int32_t i = 0; i < tips_of(first); i++) {
    if (m->to[i] < 0) {
      sum += limb_length(first, i);
    } else {
      is_taken[m->to[i]] = 1;
    }
  }
  for (int32_t i = 0; i < tips_of(second); i++) {
    sum += is_taken[i] ? 0 : limb_length(second, i);
  }
  return sum;
}

/* Adds a match of all tips to the list, unless it costs more than all that are listed. */
static int32_t add(const orb_tips *first, const orb_tips *second, int32_t most, int32_t count, orb_tip_match *m,
                   orb_tip_match *list) {
  const double branches = cost_of_branches(first, second, m);
  if (count == most && branches >= list[most - 1].cost) {
    return count;
  }
  orb_tip_match_fit(first, second, m);
  m->cost = branches + ORB_FIND_BRANCH_ANGLE * orb_tip_match_angle(first, second, m) +
            ORB_FIND_BRANCH_LEFT * length_left_over(first, second, m);
  return orb_tip_match_keep(m, most, count, list);
}

int32_t orb_branches_match(const orb_tips *first, const orb_tips *second, int32_t most, orb_tip_match *out) {
  const int32_t tips = tips_of(first), partners = tips_of(second);
  int32_t count = 0, left_over = tips > partners ? tips - partners : 0;
  int was_left[ORB_BRANCHES_TIPS] = {0};
  orb_tip_match m = {.count = tips < partners ? tips : partners};
  if (m.count < LEAST) {
    return 0;
  }
  for (int32_t i = 0; i < ORB_TIPS_MAX; i++) {
    m.to[i] = -1;
  }
  for (int32_t i = 0; i >= 0;) {
    if (!advance(&m, i, partners, &left_over, &was_left[i])) {
      i--;
    } else if (i < tips - 1) {
      i++;
    } else if (left_over == 0) {
      count = add(first, second, most, count, &m, out);
    }
  }
  return count;
}

static size_t vertices_of(const orb_branches *b) {
  return (size_t)b->copy->mesh.vertex_count;
}

/* The limb of a tip that has a partner: the distances from its tip at which its paths to two other such tips part, the
 * nearest one and the farthest one, and that of the farthest vertex. The first is the root of the limb, the second the
 * far end of the trunk. */
typedef struct limb {
  const float *apart; /* of each vertex from the tip */
  double root, end, farthest;
} limb;

static limb limb_of(const orb_branches *b, const int *is_paired, int32_t i) {
  const orb_tips *tips = b->tips;
  const size_t n = vertices_of(b);
  limb l = {.apart = b->survey->apart + (size_t)tips->vertex[i] * n};
  find_partings(tips, is_paired, i, &l.root, &l.end);
  for (size_t v = 0; v < n; v++) {
    l.farthest = fmax(l.farthest, (double)l.apart[v]);
  }
  l.end = fmin(ORB_FIND_TRUNK_MOST * l.farthest, fmax(ORB_FIND_TRUNK_LEAST * l.farthest, l.end));
  l.root = fmin(ORB_FIND_ROOT_MOST * l.end, fmax(ORB_FIND_ROOT_LEAST * l.end, l.root));
  return l;
}

/* Where a vertex is: from 0 at the tip to 1 at the root, 2 at the far end of the trunk and 3 at the farthest vertex. */
static float place_on(const limb *l, size_t v) {
  const double d = (double)l->apart[v];
  const double place = d < l->root  ? d / l->root
                       : d < l->end ? 1 + (d - l->root) / (l->end - l->root)
                                    : 2 + (d - l->end) / (l->farthest - l->end);
  return (float)place;
}

/* The places of all vertices of both copies: a row for each pair of a match. */
typedef struct places {
  int32_t count; /* pairs */
  float *row[2]; /* pairs × vertices */
  const orb_branches *both;
} places;

/* Free `out` in any case. */
static orb_status places_create(orb_context *ctx, const orb_branches both[2], const orb_tip_match *match, places *out) {
  int32_t tip[2][ORB_TIPS_MAX];
  *out = (places){.both = both};
  for (int32_t i = 0; i < both[0].tips->count; i++) {
    if (match->to[i] >= 0) {
      tip[0][out->count] = i;
      tip[1][out->count++] = match->to[i];
    }
  }
  for (int s = 0; s < 2; s++) {
    const size_t n = vertices_of(&both[s]);
    int is_paired[ORB_TIPS_MAX] = {0};
    out->row[s] = ORB_NEW(ctx, float, (size_t)out->count *n);
    if (!out->row[s]) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t i = 0; i < out->count; i++) {
      is_paired[tip[s][i]] = 1;
    }
    for (int32_t i = 0; i < out->count; i++) {
      const limb l = limb_of(&both[s], is_paired, tip[s][i]);
      for (size_t v = 0; v < n; v++) {
        out->row[s][(size_t)i * n + v] = place_on(&l, v);
      }
    }
  }
  return ORB_OK;
}

/* Adds how unlike the places of vertex v of copy s and of each vertex of the other copy are. Near tips say more. */
static void add_unlike(const places *p, int s, size_t v, float *restrict sum) {
  const size_t n = vertices_of(&p->both[s]), count = vertices_of(&p->both[1 - s]);
  float weight[ORB_TIPS_MAX], all = 0;
  for (int32_t i = 0; i < p->count; i++) {
    const float near = ORB_FIND_BRANCH_NEAR + p->row[s][(size_t)i * n + v];
    weight[i] = 1 / (near * near);
    all += weight[i];
  }
  for (int32_t i = 0; i < p->count; i++) {
    const float own = p->row[s][(size_t)i * n + v], share = weight[i] / all;
    const float *restrict other = p->row[1 - s] + (size_t)i * count;
    for (size_t u = 0; u < count; u++) {
      const float d = own - other[u];
      sum[u] += share * d * d;
    }
  }
}

/* sum: room for a number for each vertex of the other copy. */
static void map_copy(const places *p, const orb_tip_match *match, int s, float *sum, int32_t *out) {
  const orb_tips *const tips[2] = {p->both[0].tips, p->both[1].tips};
  const orb_coarse_copy *from = p->both[s].copy, *to = p->both[1 - s].copy;
  const size_t n = vertices_of(&p->both[s]), count = vertices_of(&p->both[1 - s]);
  for (size_t v = 0; v < n; v++) {
    double at[3];
    size_t best = 0;
    orb_tip_match_carry(tips, match, s, from->points + 3 * v, at);
    for (size_t u = 0; u < count; u++) {
      sum[u] = (float)(ORB_FIND_BRANCH_SIDE * (1 - orb_dot(at, to->points + 3 * u)));
    }
    add_unlike(p, s, v, sum);
    for (size_t u = 1; u < count; u++) {
      best = sum[u] < sum[best] ? u : best;
    }
    out[v] = (int32_t)best;
  }
}

orb_status orb_branches_map(orb_context *ctx, const orb_branches both[2], const orb_tip_match *match,
                            int32_t *const out[2]) {
  const size_t n = vertices_of(&both[0]), m = vertices_of(&both[1]);
  float *sum = ORB_NEW(ctx, float, n > m ? n : m);
  places p;
  orb_status status = places_create(ctx, both, match, &p);
  status = sum ? status : ORB_E_NO_MEMORY;
  for (int s = 0; s < 2 && status == ORB_OK; s++) {
    map_copy(&p, match, s, sum, out[s]);
  }
  for (int s = 0; s < 2; s++) {
    orb_free(ctx, p.row[s]);
  }
  orb_free(ctx, sum);
  return status;
}
