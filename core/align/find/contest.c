#include "align/find/contest.h"

#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/map/draft.h"
#include "align/map/engine/params.h"
#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"

/* Contestants: the match with the shape moving that it names, the same with the other one, and the next best match. */
enum { MATCH, TURNED, SECOND, MOST };

typedef struct contest {
  const orb_match *match;
  orb_alignment *alignment;
  orb_preset preset;
  int32_t landmark_count;
  double *target[MOST]; /* of the matches */
  orb_map_draft *draft[MOST];
  double energy[MOST];        /* of walks, then of finished maps; INFINITY: not walked, or none leads to a map */
  double walked[MOST];        /* of walks alone */
  double known;               /* the least energy of the caller's map and of walks of earlier rounds, or INFINITY */
  int32_t round[MOST], count; /* those that walk, and later those that are finished, side by side */
} contest;

int orb_contest_is_open(const orb_match *match, int keep_angles) {
  return keep_angles && match->is_found && match->bend > match->walks_above;
}

/* Is the first shape small enough to move? */
static int first_may_move(const contest *c) {
  return c->alignment->shapes[0].mesh.vertex_count <= orb_map_params_of(c->preset).copies.large;
}

static int moving_of(const contest *c, int32_t n) {
  const int moving = c->match->moves == 0 && first_may_move(c) ? 0 : 1;
  return n == TURNED ? 1 - moving : moving;
}

static orb_status walk(orb_context *ctx, void *arg, int32_t i) {
  contest *c = arg;
  const int32_t n = c->round[i];
  const int moving = moving_of(c, n);
  orb_aligned_shape *shapes = c->alignment->shapes;
  ORB_TRY(orb_match_target(ctx, c->match, n == SECOND, moving, &c->target[n]));
  if (!c->target[n]) {
    return ORB_OK;
  }
  return orb_map_draft_create(ctx, &shapes[1 - moving], &shapes[moving], c->landmark_count, c->target[n], c->known,
                              c->preset, &c->draft[n], &c->energy[n]);
}

/* The contestant of least energy but for `omit`, or −1. */
static int32_t least_of(const contest *c, int32_t omit) {
  int32_t least = -1;
  for (int32_t n = 0; n < MOST; n++) {
    if (n != omit && c->energy[n] < (least < 0 ? INFINITY : c->energy[least])) {
      least = n;
    }
  }
  return least;
}

/* Does the next best match walk too? If both walks of the match are poor, or if the costs do not tell which is better.
 */
static int second_walks(const contest *c) {
  if (c->landmark_count > 0 || c->match->other_count == 0) {
    return 0;
  }
  const double behind = c->match->other[0].cost;
  return behind <= ORB_FIND_CONTEST_TIE || (c->known > ORB_FIND_CONTEST_POOR && behind <= ORB_FIND_CONTEST_BEHIND);
}

/* The match walks both ways side by side, and then the next best one, if need be. */
static orb_status walk_all(orb_context *ctx, contest *c) {
  c->round[0] = MATCH;
  c->round[1] = TURNED;
  c->count = first_may_move(c) ? 2 : 1;
  ORB_TRY(orb_tasks_run(ctx, c->count, walk, c));
  c->known = fmin(c->known, fmin(c->energy[MATCH], c->energy[TURNED]));
  c->round[0] = SECOND;
  return second_walks(c) ? walk(ctx, c, 0) : ORB_OK;
}

static orb_status finish(orb_context *ctx, void *arg, int32_t i) {
  contest *c = arg;
  const int32_t n = c->round[i];
  return orb_map_draft_finish(ctx, c->draft[n], &c->energy[n]);
}

/* Finishes the best walk, and the next one if it is close. Frees all other drafts. */
static orb_status finish_best(orb_context *ctx, contest *c) {
  const int32_t best = least_of(c, -1), next = least_of(c, best);
  memcpy(c->walked, c->energy, sizeof c->walked);
  c->count = 1;
  c->round[0] = best < 0 ? MATCH : best;
  if (next >= 0 && c->energy[next] - 1 <= ORB_FIND_CONTEST_CLOSE * (c->energy[best] - 1)) {
    c->round[c->count++] = next;
  }
  for (int32_t n = 0; n < MOST; n++) {
    if (n != c->round[0] && (c->count < 2 || n != c->round[1])) {
      orb_map_draft_free(ctx, c->draft[n]);
      c->draft[n] = NULL;
    }
  }
  return orb_tasks_run(ctx, c->count, finish, c);
}

/* How far the match is behind the next best one, which has won: by finished maps if both were finished, or by walks. */
static double lead_of_second(const contest *c) {
  const double poor = orb_map_params_of(c->preset).energy.poor;
  const int32_t other = c->round[0] == SECOND ? c->round[c->count - 1] : c->round[0];
  const int both = other == MATCH || other == TURNED;
  const double own = both ? c->energy[SECOND] : c->walked[SECOND];
  const double its = both ? c->energy[other] : fmin(c->walked[MATCH], c->walked[TURNED]);
  return fmax(0, 1 - own / fmin(its, poor));
}

/* Takes the better map. That of the next best match must be clearly better. */
static orb_status take_winner(orb_context *ctx, contest *c, orb_contest_result *out) {
  const int32_t first = c->count == 2 && c->round[1] < c->round[0], second = c->count - 1 - first;
  int32_t winner = c->round[first];
  const double gain = c->round[second] == SECOND ? ORB_FIND_CONTEST_GAIN : 1;
  if (c->energy[c->round[second]] - 1 < gain * (c->energy[winner] - 1)) {
    winner = c->round[second];
  }
  out->is_second = winner == SECOND;
  if (winner == SECOND) {
    out->clear = lead_of_second(c);
  }
  return orb_map_draft_take(ctx, c->draft[winner], &c->alignment->energy, &out->loose);
}

orb_status orb_contest_run(orb_context *ctx, const orb_match *match, int32_t landmark_count, double known,
                           orb_preset preset, orb_alignment *alignment, orb_contest_result *out) {
  contest c = {
      .match = match, .alignment = alignment, .preset = preset, .landmark_count = landmark_count, .known = known};
  orb_status status;
  *out = (orb_contest_result){.loose = INFINITY};
  for (int32_t n = 0; n < MOST; n++) {
    c.energy[n] = INFINITY;
  }
  ORB_GO(status, walk_all(ctx, &c), end);
  if (known < INFINITY && !(c.known < known)) {
    alignment->energy = INFINITY;
    goto end;
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
