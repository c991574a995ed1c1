/* Tip maps: tries all injective partial maps, depth first. With eight tips each there are 1.4 million, fewer where some
 * pairs are ruled out. */
#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/find/tip_maps.h"

typedef struct matcher {
  const orb_tips *a, *b;
  double pair[ORB_TIPS_MAX][ORB_TIPS_MAX][ORB_TIPS_MAX][ORB_TIPS_MAX]; /* i, j of a to k, l of b */
  double single[ORB_TIPS_MAX][ORB_TIPS_MAX];
  unsigned char ruled_out[ORB_TIPS_MAX][ORB_TIPS_MAX];
  orb_tip_map *list;
  int32_t count, capacity;
} matcher;

static double agreement(double x, double y, double spread, double worst) {
  double r = log(x / y) / spread, value = 1 - r * r;
  return value > worst ? value : worst;
}

/* Is one map a part of the other? */
static int consistent(const orb_tip_map *x, const orb_tip_map *y, int32_t count) {
  int x_in_y = 1, y_in_x = 1;
  for (int32_t i = 0; i < count; i++) {
    x_in_y = x_in_y && (x->to[i] < 0 || x->to[i] == y->to[i]);
    y_in_x = y_in_x && (y->to[i] < 0 || y->to[i] == x->to[i]);
  }
  return x_in_y || y_in_x;
}

/* Inserts a map into the ordered list if it is good enough, and removes maps that are parts of it. */
static void keep(matcher *m, const orb_tip_map *map) {
  if (m->count == m->capacity && map->score <= m->list[m->count - 1].score) {
    return;
  }
  int32_t left = 0;
  for (int32_t i = 0; i < m->count; i++) {
    if (consistent(map, &m->list[i], m->a->count) && m->list[i].score >= map->score) {
      return;
    }
  }
  for (int32_t i = 0; i < m->count; i++) {
    if (!consistent(map, &m->list[i], m->a->count)) {
      m->list[left++] = m->list[i];
    }
  }
  m->count = left < m->capacity ? left + 1 : left;
  int32_t at = m->count - 1;
  for (; at > 0 && m->list[at - 1].score < map->score; at--) {
    m->list[at] = m->list[at - 1];
  }
  m->list[at] = *map;
}

static double gain(const matcher *m, const orb_tip_map *map, int32_t i, int32_t k) {
  double sum = m->single[i][k];
  for (int32_t j = 0; j < i; j++) {
    if (map->to[j] >= 0) {
      sum += m->pair[j][i][map->to[j]][k];
    }
  }
  return sum;
}

static int is_free(const matcher *m, const orb_tip_map *map, int32_t i, int32_t k) {
  for (int32_t j = 0; j < i; j++) {
    if (map->to[j] == k) {
      return 0;
    }
  }
  return !m->ruled_out[i][k];
}

/* Depth first; the choice of each tip counts up from −1. */
static void try_all(matcher *m) {
  int32_t n = m->a->count, depth = 0;
  orb_tip_map at[ORB_TIPS_MAX + 1] = {{0}};
  int32_t choice[ORB_TIPS_MAX + 1] = {-2};
  for (int32_t i = 0; i < ORB_TIPS_MAX; i++) {
    at[0].to[i] = -1;
  }
  while (depth >= 0) {
    if (depth == n) {
      if (at[n].count >= ORB_FIND_TIPS_LEAST) {
        keep(m, &at[n]);
      }
      depth--;
      continue;
    }
    int32_t k = choice[depth] == -2 ? -1 : choice[depth] + 1;
    while (k >= 0 && k < m->b->count && !is_free(m, &at[depth], depth, k)) {
      k++;
    }
    if (k >= m->b->count) {
      depth--;
      continue;
    }
    choice[depth] = k;
    at[depth + 1] = at[depth];
    if (k >= 0) {
      at[depth + 1].score += gain(m, &at[depth], depth, k);
      at[depth + 1].to[depth] = k;
      at[depth + 1].count++;
    }
    depth++;
    choice[depth] = -2;
  }
}

/* Fills how well the distances of pairs of tips agree, weighted by `share`. */
static void fill_pairs(matcher *m, double share, double worst) {
  for (int32_t i = 0; i < m->a->count; i++) {
    for (int32_t k = 0; k < m->b->count; k++) {
      for (int32_t j = 0; j < m->a->count; j++) {
        for (int32_t l = 0; l < m->b->count; l++) {
          m->pair[i][j][k][l] = i != j && k != l ? share * agreement(m->a->distance[i][j], m->b->distance[k][l],
                                                                     ORB_FIND_PAIR_SPREAD, worst)
                                                 : 0;
        }
      }
    }
  }
}

void orb_tip_maps(const orb_tips *a, const orb_tips *b, orb_tip_map out[ORB_TIP_MAPS_MAX], int32_t *count) {
  matcher m = {.a = a, .b = b, .list = out, .capacity = ORB_TIP_MAPS_MAX};
  for (int32_t i = 0; i < a->count; i++) {
    for (int32_t k = 0; k < b->count; k++) {
      m.single[i][k] = agreement(a->far[i], b->far[k], ORB_FIND_FAR_SPREAD, ORB_FIND_WORST);
    }
  }
  fill_pairs(&m, 1, ORB_FIND_WORST);
  try_all(&m);
  *count = m.count;
}

int orb_tip_map_beside(const orb_tips *a, const orb_tips *b, double (*beside)[ORB_TIPS_MAX], orb_tip_map *out) {
  matcher m = {.a = a, .b = b, .list = out, .capacity = 1};
  for (int32_t i = 0; i < a->count; i++) {
    for (int32_t k = 0; k < b->count; k++) {
      m.single[i][k] = beside[i][k];
      m.ruled_out[i][k] = beside[i][k] <= 0;
    }
  }
  fill_pairs(&m, ORB_FIND_PAIR_SHARE, -1);
  try_all(&m);
  return m.count > 0;
}
