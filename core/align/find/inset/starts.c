#include "align/find/inset/starts.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "numeric/quaternion.h"
#include "numeric/vec3.h"

/* The samples at one turn and one size, when the middle of the part is at a node: how many nodes away each of them is,
 * and its normal. */
typedef struct turned {
  int32_t away[ORB_FIND_INSET_LOOKUPS][3];
  float normal[ORB_FIND_INSET_LOOKUPS][3];
} turned;

/* The rotations that take a dodecahedron to itself, as unit quaternions: the cosines of half their angles come first.
 * Of each two opposite quaternions, which are one rotation, the one whose first number that is not 0 is positive. */
static void list_quaternions(double out[ORB_INSET_TURNS][4]) {
  static const double golden = 1.6180339887498949;
  const double size[3][4] = {{1, 0, 0, 0}, {0.5, 0.5, 0.5, 0.5}, {golden / 2, 0.5, 0.5 / golden, 0}};
  static const int order[12][4] = {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 0, 3, 2}, {1, 2, 0, 3}, {1, 3, 2, 0},
                                   {2, 0, 1, 3}, {2, 1, 3, 0}, {2, 3, 0, 1}, {3, 0, 2, 1}, {3, 1, 0, 2}, {3, 2, 1, 0}};
  int count = 0;
  for (int i = 0; i < 3 * 12 * 16; i++) {
    double q[4];
    int first = -1, is_new = 1;
    for (int k = 0; k < 4; k++) {
      const double length = size[i / 192][order[i / 16 % 12][k]];
      q[k] = i >> k & 1 ? -length : length;
      first = first < 0 && length > 0 ? k : first;
      is_new = is_new && !(length == 0 && (i >> k & 1));
    }
    is_new = is_new && q[first] > 0;
    for (int n = 0; n < count && is_new; n++) {
      is_new = memcmp(out[n], q, sizeof q) != 0;
    }
    if (is_new) {
      memcpy(out[count++], q, sizeof q);
    }
  }
  ORB_ASSERT(count == ORB_INSET_TURNS);
}

void orb_inset_fine_turns(double (*rotation)[9]) {
  static const double sign[5][3] = {{0, 0, 0}, {1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  double turn[ORB_INSET_TURNS][4];
  const double angle = ORB_FIND_INSET_BETWEEN * M_PI / 180, c = cos(angle / 2), s = sin(angle / 2) / sqrt(3);
  list_quaternions(turn);
  for (int i = 0; i < ORB_INSET_FINE_TURNS; i++) {
    const double *p = turn[i % ORB_INSET_TURNS], *axis = sign[i / ORB_INSET_TURNS];
    const double q[4] = {i < ORB_INSET_TURNS ? 1 : c, s * axis[0], s * axis[1], s * axis[2]};
    double both[4];
    orb_quaternion_product(p, q, both);
    orb_quaternion_rotation(both, rotation[i]);
  }
}

/* How well the samples lie on the large shape if the middle of the part is at a node: 0 to 1. Returns 0 early if the
 * first quarter lies badly. */
static double look_up(const orb_inset_grid *g, const turned *samples, const int32_t middle[3]) {
  const float scale = (float)(1 / (2 * g->step));
  float sum = 0;
  for (int i = 0; i < ORB_FIND_INSET_LOOKUPS; i++) {
    const int32_t *away = samples->away[i], x = middle[0] + away[0], y = middle[1] + away[1], z = middle[2] + away[2];
    if (x >= 0 && x < g->count[0] && y >= 0 && y < g->count[1] && z >= 0 && z < g->count[2]) {
      const float *node = orb_inset_node(g, x, y, z);
      const float *n = samples->normal[i];
      const float facing = n[0] * node[4] + n[1] * node[5] + n[2] * node[6], near = 1 - node[0] * scale;
      sum += facing > 0 && near > 0 ? facing * near : 0;
    }
    if (i + 1 == ORB_FIND_INSET_LOOKUPS / 4 && sum < (float)ORB_FIND_INSET_BAD * (float)(i + 1)) {
      return 0;
    }
  }
  return (double)sum / ORB_FIND_INSET_LOOKUPS;
}

static void turn_samples(const orb_inset_grid *g, const orb_inset_sample *sample, const orb_similarity *by,
                         turned *out) {
  for (size_t i = 0; i < ORB_FIND_INSET_LOOKUPS; i++) {
    double p[3], n[3];
    orb_similarity_apply(by, sample[i].position, p);
    orb_rotate_point(by->rotation, sample[i].normal, n);
    for (int k = 0; k < 3; k++) {
      out->away[i][k] = (int32_t)floor(p[k] / g->step + 0.5);
      out->normal[i][k] = (float)n[k];
    }
  }
}

/* Finds the best place of one turn and one size, at every other node along each axis. Returns 0 if there is none. */
static int best_place(const orb_inset_grid *g, const orb_inset_sample *sample, orb_similarity *one) {
  turned by;
  double best = 0;
  int32_t at[3];
  memset(one->shift, 0, sizeof one->shift);
  turn_samples(g, sample, one, &by);
  for (at[2] = 0; at[2] < g->count[2]; at[2] += 2) {
    for (at[1] = 0; at[1] < g->count[1]; at[1] += 2) {
      for (at[0] = 0; at[0] < g->count[0]; at[0] += 2) {
        const double score = look_up(g, &by, at);
        if (score > best) {
          best = score;
          for (int k = 0; k < 3; k++) {
            one->shift[k] = g->low[k] + g->step * at[k];
          }
        }
      }
    }
  }
  return best > 0;
}

orb_status orb_inset_starts(orb_context *ctx, const orb_inset_grid *grid, const orb_inset_sample *sample,
                            orb_similarity *start, int32_t *count) {
  double turn[ORB_INSET_TURNS][4];
  list_quaternions(turn);
  *count = 0;
  for (int i = 0; i < ORB_INSET_TURNS; i++) {
    for (int z = 0; z < ORB_FIND_INSET_SIZES; z++) {
      orb_similarity one = {.scale = ORB_FIND_INSET_SIZE[z]};
      orb_quaternion_rotation(turn[i], one.rotation);
      if (best_place(grid, sample, &one)) {
        start[(*count)++] = one;
      }
    }
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}

void orb_inset_starts_at(const double from[3], const double to[3], orb_similarity start[ORB_INSET_STARTS]) {
  double turn[ORB_INSET_TURNS][4];
  list_quaternions(turn);
  for (int i = 0; i < ORB_INSET_STARTS; i++) {
    orb_similarity *one = &start[i];
    double moved[3];
    one->scale = ORB_FIND_INSET_SIZE[i % ORB_FIND_INSET_SIZES];
    orb_quaternion_rotation(turn[i / ORB_FIND_INSET_SIZES], one->rotation);
    memset(one->shift, 0, sizeof one->shift);
    orb_similarity_apply(one, from, moved);
    orb_sub(to, moved, one->shift);
  }
}
