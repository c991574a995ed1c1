#include "align/find/contest.h"

#include <math.h>

#include "align/find/params.h"
#include "align/map/draft.h"
#include "align/map/engine/params.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

/* Contestants: the three best matches, as orb_match_target() numbers them, and what fits best in space. */
enum { BEST, SECOND, THIRD, SPACE, MOST };

typedef struct contest {
  const orb_match *match;
  orb_alignment *alignment;
  orb_preset preset;
  double *target[MOST]; /* of the matches */
  orb_map_draft *draft[MOST];
  double energy[MOST];        /* of walks, then of finished maps; INFINITY: not walked, or none leads to a map */
  double known;               /* energy of the best walk of an earlier round, or INFINITY */
  double walked[MOST];        /* energy of walks */
  int32_t round[MOST], count; /* those that walk, and later those that are finished, side by side */
} contest;

int orb_contest_is_open(const orb_match *match, int keep_angles) {
  return keep_angles && match->is_found && match->bend > ORB_FIND_WALKS_FIRST && match->other_count > 0 &&
         match->other[0].cost <= ORB_FIND_OTHER_BEHIND;
}

/* Which shape moves: that of the match, unless it is too large. */
static int moving_of(const contest *c) {
  const int32_t large = orb_map_params_of(c->preset).copies.large;
  return c->match->moves == 0 && c->alignment->shapes[0].mesh.vertex_count <= large ? 0 : 1;
}

static orb_status walk(orb_context *ctx, void *arg, int32_t i) {
  contest *c = arg;
  const int32_t n = c->round[i];
  const int moving = moving_of(c);
  orb_aligned_shape *shapes = c->alignment->shapes;
  if (n != SPACE) {
    ORB_TRY(orb_match_target(ctx, c->match, n, moving, &c->target[n]));
    if (!c->target[n]) {
      return ORB_OK;
    }
  }
  return orb_map_draft_create(ctx, &shapes[1 - moving], &shapes[moving], c->target[n], c->known, c->preset,
                              &c->draft[n], &c->energy[n]);
}

/* By how much the energy exceeds 1, times the cost of the match relative to the best one. */
static double score(const contest *c, int32_t n) {
  const double cost = n == SECOND || n == THIRD ? c->match->other[n - SECOND].cost : 1;
  return c->energy[n] < INFINITY ? (c->energy[n] - 1) * cost : INFINITY;
}

/* The contestant of least score but for `omit`, or −1. */
static int32_t least_of(const contest *c, int32_t omit) {
  int32_t least = -1;
  for (int32_t n = 0; n < MOST; n++) {
    if (n != omit && score(c, n) < (least < 0 ? INFINITY : score(c, least))) {
      least = n;
    }
  }
  return least;
}

static void drop(orb_context *ctx, contest *c, int32_t n) {
  orb_map_draft_free(ctx, c->draft[n]);
  c->draft[n] = NULL;
}

/* Frees the worse of the first two drafts, unless it is close: each holds a copy of the surfaces. */
static void drop_worse(orb_context *ctx, contest *c) {
  const int32_t worse = score(c, SECOND) < score(c, BEST) ? BEST : SECOND;
  if (score(c, worse) > ORB_FIND_CONTEST_CLOSE * score(c, SECOND - worse)) {
    drop(ctx, c, worse);
    c->walked[worse] = c->energy[worse];
    c->energy[worse] = INFINITY;
  }
}

/* The best match walks first, and the second one beside it if it costs little more. If these walks are poor, the third
 * match and what fits best in space walk too. */
static orb_status walk_all(orb_context *ctx, contest *c) {
  c->count = c->match->other[0].cost <= ORB_FIND_CONTEST_BEHIND ? 2 : 1;
  c->round[0] = BEST;
  c->round[1] = SECOND;
  ORB_TRY(orb_tasks_run(ctx, c->count, walk, c));
  c->known = fmin(c->energy[BEST], c->energy[SECOND]);
  if (c->known <= ORB_FIND_CONTEST_POOR) {
    return ORB_OK;
  }
  drop_worse(ctx, c);
  c->count = 0;
  if (c->match->other_count > 1) {
    c->round[c->count++] = THIRD;
  }
  c->round[c->count++] = SPACE;
  return orb_tasks_run(ctx, c->count, walk, c);
}

static orb_status finish(orb_context *ctx, void *arg, int32_t i) {
  contest *c = arg;
  const int32_t n = c->round[i];
  return orb_map_draft_finish(ctx, c->draft[n], &c->energy[n]);
}

/* Finishes the best walk, and the next one if it is close. Frees all other drafts. */
static orb_status finish_best(orb_context *ctx, contest *c) {
  const int32_t best = least_of(c, -1), next = least_of(c, best);
  c->count = 1;
  c->round[0] = best < 0 ? BEST : best;
  if (next >= 0 && score(c, next) <= ORB_FIND_CONTEST_CLOSE * score(c, best)) {
    c->round[c->count++] = next;
  }
  for (int32_t n = 0; n < MOST; n++) {
    if (n != c->round[0] && (c->count < 2 || n != c->round[1])) {
      drop(ctx, c, n);
    }
  }
  return orb_tasks_run(ctx, c->count, finish, c);
}

/* How clearly a winner beats the best match: by finished maps if both are finished, otherwise by walks. */
static double clear_of(const contest *c, int32_t winner) {
  const double *energy = c->draft[BEST] ? c->energy : c->walked;
  const double least = fmin(energy[BEST], orb_map_params_of(c->preset).energy.poor);
  return winner == BEST ? 0 : fmax(0, 1 - energy[winner] / least);
}

/* Takes the better map. Of two that are as good, that of the match that bends the shapes less wins. */
static orb_status take_winner(orb_context *ctx, contest *c, orb_contest_result *out) {
  const int32_t first = c->count == 2 && c->round[1] < c->round[0], second = c->count - 1 - first;
  int32_t winner = c->round[first];
  if (score(c, c->round[second]) < ORB_FIND_CONTEST_GAIN * score(c, winner)) {
    winner = c->round[second];
  }
  out->is_space = winner == SPACE;
  out->other = winner == SPACE ? 0 : winner;
  out->clear = clear_of(c, winner);
  return orb_map_draft_take(ctx, c->draft[winner], &c->alignment->energy);
}

orb_status orb_contest_run(orb_context *ctx, const orb_match *match, orb_preset preset, orb_alignment *alignment,
                           orb_contest_result *out) {
  contest c = {.match = match, .alignment = alignment, .preset = preset, .known = INFINITY};
  orb_status status;
  *out = (orb_contest_result){0};
  for (int32_t n = 0; n < MOST; n++) {
    c.energy[n] = c.walked[n] = INFINITY;
  }
  ORB_GO(status, walk_all(ctx, &c), end);
  for (int32_t n = 0; n < MOST; n++) {
    c.walked[n] = c.draft[n] ? c.energy[n] : c.walked[n];
  }
  ORB_GO(status, finish_best(ctx, &c), end);
  status = take_winner(ctx, &c, out);
end:
  for (int32_t n = 0; n < MOST; n++) {
    orb_map_draft_free(ctx, c.draft[n]);
    orb_free(ctx, c.target[n]);
  }
  return status;
}
