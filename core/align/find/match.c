#include "align/find/match.h"

#include <math.h>
#include <string.h>

#include "align/find/branched.h"
#include "align/find/crossed.h"
#include "align/find/extended.h"
#include "align/find/hinted.h"
#include "align/find/mirrored.h"
#include "align/find/open_limbs.h"
#include "align/find/params.h"
#include "align/find/raised.h"
#include "align/find/trials.h"
#include "align/map/engine/spread.h"
#include "align/map/engine/surface.h"
#include "base/check.h"
#include "base/memory.h"
#include "elastic/carry.h"
#include "elastic/elastic.h"
#include "numeric/vec3.h"

_Static_assert((int)ORB_TRIALS_LISTED == 1 + (int)ORB_MATCH_OTHERS, "a match has all listed trials");

/* Vertices spread over the first shape, and those nearest to where a trial takes them. */
static orb_status write_pairs(const orb_trials *t, const orb_trial *one, orb_match_pairs *out) {
  memset(out, 0, sizeof *out);
  const orb_coarse_copy *copy = t->copy;
  int32_t sample[ORB_MATCH_PAIRS];
  orb_nearest *tree;
  ORB_TRY(orb_map_spread(t->ctx, copy[0].mesh.positions, copy[0].mesh.vertex_count, ORB_MATCH_PAIRS, sample));
  ORB_TRY(
      orb_nearest_create(t->ctx, copy[1].mesh.positions, copy[1].mesh.triangles, copy[1].mesh.triangle_count, &tree));
  for (int i = 0; i < ORB_MATCH_PAIRS; i++) {
    orb_place place;
    (void)orb_nearest_query(tree, one->pose[0].position + 3 * (size_t)sample[i], INFINITY, &place);
    int32_t first = copy[0].vertex[sample[i]];
    int32_t second = copy[1].vertex[orb_map_nearest_corner(copy[1].mesh.triangles, &place)];
    int is_new = 1;
    for (int32_t k = 0; k < out->count; k++) {
      is_new = is_new && out->first[k] != first && out->second[k] != second;
    }
    if (is_new) {
      out->first[out->count] = first;
      out->second[out->count++] = second;
    }
  }
  orb_nearest_destroy(t->ctx, tree);
  return ORB_OK;
}

/* How much a trial bends the shapes: the mean of both directions, or by the first one. */
static double bend_of(const orb_trial *one, int both) {
  return both ? (one->bend[0] + one->bend[1]) / 2 : one->bend[0];
}

/* The geometric mean of two ratios of another trial to the best one: of their bends, and of their costs. So what else
 * they cost counts by half: files say which of two sides that look alike is the front, but not that they look
 * different. */
static double lead_over(const orb_trial *best, const orb_trial *other) {
  const int both = other->cost < INFINITY;
  const double bend = bend_of(best, both), more = bend_of(other, both);
  const double cost = both ? best->cost : best->rough, dearer = both ? other->cost : other->rough;
  const double most = ORB_FIND_LEAD_MOST;
  return more * dearer < most * most * bend * cost ? sqrt(more / bend * (dearer / cost)) : most;
}

/* Writes the listed trials, without targets. */
static orb_status write_ranking(const orb_trials *t, orb_match *out) {
  const orb_trial *best = &t->trial[t->list[0]];
  double cost = 1;
  out->cost = best->cost;
  out->lead = t->listed > 1 ? INFINITY : ORB_FIND_LEAD_ALONE;
  out->bend = bend_of(best, 1);
  out->other_count = 0;
  for (int32_t i = 1; i < t->listed; i++) {
    const orb_trial *one = &t->trial[t->list[i]];
    orb_match_other *other = &out->other[out->other_count++];
    cost = fmax(cost, one->cost < INFINITY ? one->cost / best->cost : one->rough / best->rough);
    other->cost = cost;
    other->bend = bend_of(one, one->cost < INFINITY);
    out->lead = fmin(out->lead, lead_over(best, one));
    ORB_TRY(write_pairs(t, one, &other->pairs));
  }
  out->clear = t->listed > 1 ? 1 - 1 / out->other[0].cost : ORB_FIND_CLEAR_ALONE;
  return write_pairs(t, best, &out->pairs);
}

/* Registers copy s of a trial again with the landmarks as anchors. Until here landmarks only excluded maps, since
 * anchors would draw a wrong map to their partners as well. If the anchors bend the copy far more than before, they
 * have twisted a limb or the waist; then the pose without them stays until it settles. */
static orb_status draw_to_landmarks(orb_context *ctx, const orb_trials *t, orb_trial *one, int s) {
  const orb_mesh *copy = &t->copy[s].mesh;
  orb_elastic_anchor *anchors = NULL;
  orb_elastic_pose drawn = {NULL, NULL};
  double bend;
  orb_status status;
  ORB_GO(status, orb_hint_anchors_create(ctx, &t->hint, copy, s, &anchors), end);
  ORB_GO(status, orb_trial_pose_create(ctx, copy, &drawn), end);
  const orb_elastic_anchors held = {t->hint.count, anchors};
  ORB_GO(
      status,
      orb_elastic_register(ctx, copy, &t->copy[1 - s].mesh, &t->survey[s].around, &one->map[s], &held, &drawn, &bend),
      end);
  if (bend <= ORB_FIND_DRAWN_BEND * one->bend[s]) {
    const orb_elastic_pose before = one->pose[s];
    one->pose[s] = drawn;
    drawn = before;
  }
end:
  orb_trial_pose_free(ctx, &drawn);
  orb_free(ctx, anchors);
  return status;
}

/* Settles the fine copy of shape s on that of the other one, and carries its pose to all vertices. */
static orb_status write_targets(orb_context *ctx, const orb_match *match, orb_trial *one, int s, double **target) {
  const orb_trials *t = match->trials;
  const orb_mesh *fine = &t->fine[s].mesh, *mesh = t->mesh[s];
  const orb_trial_scaling *own = &t->scaling[s], *other = &t->scaling[1 - s];
  orb_elastic_pose pose = {NULL, NULL}, all = {NULL, NULL};
  orb_elastic_anchor *anchors = NULL;
  orb_elastic_anchors held = {0, NULL};
  size_t count = 3 * (size_t)mesh->vertex_count;
  double *points = ORB_NEW(ctx, double, count);
  orb_status status = ORB_E_NO_MEMORY;
  all.position = *target = ORB_NEW(ctx, double, count);
  if (!points || !all.position) {
    goto end;
  }
  ORB_GO(status, orb_trial_pose_create(ctx, fine, &pose), end);
  if (t->hint.count > 0) {
    ORB_GO(status, draw_to_landmarks(ctx, t, one, s), end);
    ORB_GO(status, orb_hint_anchors_create(ctx, &t->hint, fine, s, &anchors), end);
    held = (orb_elastic_anchors){t->hint.count, anchors};
  }
  ORB_GO(status, orb_elastic_carry(ctx, &t->copy[s].mesh, &one->pose[s], fine->positions, fine->vertex_count, &pose),
         end);
  const int is_bent = bend_of(one, 1) > match->walks_above, rounds = is_bent ? ORB_FIND_SETTLE_BENT : ORB_FIND_SETTLE;
  ORB_GO(status, orb_elastic_settle(ctx, fine, &t->fine[1 - s].mesh, &held, rounds, !is_bent, &pose), end);
  for (size_t i = 0; i < count; i++) {
    points[i] = (mesh->positions[i] - own->middle[i % 3]) * own->scale;
  }
  ORB_GO(status, orb_elastic_carry(ctx, fine, &pose, points, mesh->vertex_count, &all), end);
  for (size_t i = 0; i < count; i++) {
    all.position[i] = all.position[i] / other->scale + other->middle[i % 3];
  }
end:
  orb_free(ctx, points);
  orb_free(ctx, anchors);
  orb_trial_pose_free(ctx, &pose);
  return status;
}

/* How round a copy is: its volume, relative to a ball of the area that copies are scaled to. */
static double roundness(const orb_mesh *copy) {
  orb_extent extent;
  orb_mesh_extent(copy, &extent);
  return fabs(extent.volume) / (4 * M_PI / 3);
}

/* Places the landmarks on the copies. *stretch: see orb_hint_stretch(); 0 if they do not tell. */
static orb_status take_hint(orb_trials *t, const orb_match_hint *hint, double *stretch) {
  double *at[2];
  int32_t count = 0, few = 0, trusted = 0;
  for (int s = 0; s < 2; s++) {
    at[s] = ORB_NEW(t->ctx, double, 3 * (size_t)hint->count);
  }
  for (int32_t i = 0; i < hint->count && at[0] && at[1]; i++) {
    const int32_t vertex[2] = {hint->first[i], hint->second[i]};
    if (vertex[0] < 0 || vertex[1] < 0) {
      continue;
    }
    for (int k = 0; k < 6; k++) {
      const int s = k / 3;
      const double x = t->mesh[s]->positions[3 * (size_t)vertex[s] + (size_t)(k % 3)];
      at[s][3 * (size_t)count + (size_t)(k % 3)] = (x - t->scaling[s].middle[k % 3]) * t->scaling[s].scale;
    }
    count++;
    few += i < hint->few;
    trusted += i < hint->trusted;
  }
  ORB_TRY(orb_hint_places_create(t->ctx, count, few, trusted, at, t->copy, &t->hint));
  ORB_TRY(orb_hint_stretch(t->ctx, &t->hint, t->copy, stretch));
  t->hint.tells = count >= ORB_FIND_HINT_LEAST && *stretch < INFINITY;
  *stretch = t->hint.tells ? *stretch : 0;
  return ORB_OK;
}

/* Are the shapes as much alike under a trial as the hint demands? */
static int suits_hint(const orb_trial *one, const orb_match_hint *hint, double stretch) {
  return !hint || stretch <= hint->sure || bend_of(one, 1) <= ORB_FIND_HINT_BEND;
}

/* Opens the trials of small copies, and surveys these with distances. Close *small in any case. */
static orb_status open_small(const orb_trials *t, orb_trials **small) {
  *small = ORB_NEW0(t->ctx, orb_trials, 1);
  if (!*small) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_trials_open_small(t, *small));
  return orb_trials_survey(*small, 1);
}

static void close_small(orb_context *ctx, orb_trials *small) {
  if (small) {
    orb_trials_close(small);
    orb_free(ctx, small);
  }
}

/* Do landmarks say nothing of so many limbs that it is open which is which? */
static orb_status are_limbs_open(const orb_trials *small, int *open) {
  int32_t limbs;
  ORB_TRY(orb_open_limbs_count(small, &limbs));
  *open = limbs >= ORB_FIND_HINT_OPEN;
  return ORB_OK;
}

/* Do landmarks leave open which limb is which, where trials bend the shapes much? A few do: five along the middle of a
 * spider say nothing of its legs. So do more, if several tips have none near them. Those that exclude one body do not
 * count: of 83 pairs of animals of other kinds (seed 31), with 8 and with 24 landmarks improved trials led to as much
 * error. */
static orb_status say_nothing_of_limbs(const orb_trials *small, int is_unlike, int *open) {
  *open = small->hint.count < ORB_FIND_HINT_FEW;
  return *open || is_unlike ? ORB_OK : are_limbs_open(small, open);
}

/* Improves trials that bend small copies much, unless landmarks say which limb is which. */
static orb_status improve_trials(orb_trials *small, int is_unlike) {
  int is_open;
  if (!orb_trials_bend_much(small)) {
    return ORB_OK;
  }
  ORB_TRY(say_nothing_of_limbs(small, is_unlike, &is_open));
  if (!is_open) {
    return ORB_OK;
  }
  ORB_TRY(orb_trials_branch(small));
  ORB_TRY(orb_trials_find_symmetries(small));
  ORB_TRY(orb_trials_extend(small));
  ORB_TRY(orb_trials_cross(small));
  ORB_TRY(orb_trials_weigh_asymmetry(small, small));
  return orb_trials_mirror(small);
}

/* Adds the trials of coarse copies to those that were raised, and ranks all. */
static orb_status rank_with_coarse(orb_trials *t) {
  ORB_TRY(orb_trials_make(t));
  return orb_trials_rank(t);
}

/* Do raised trials bend the coarse copies so little that they are of one body in two poses? */
static int are_of_one_body(const orb_trials *t) {
  return t->count > 0 && t->trial[orb_trials_best(t)].cost < INFINITY && orb_trials_bend(t) <= ORB_FIND_COARSE_BEND;
}

/* Ranks the raised trials. Small copies have too few vertices for thin limbs: bodies in poses, which bend little, get
 * the trials of coarse copies too. bends_little: the small ones do. Without raised trials, landmarks contradict all
 * trials of small copies. */
static orb_status rank_raised(orb_trials *t, int bends_little) {
  if (bends_little || t->count == 0) {
    return rank_with_coarse(t);
  }
  ORB_TRY(orb_trials_rank(t));
  return are_of_one_body(t) ? rank_with_coarse(t) : ORB_OK;
}

/* Makes trials of small copies, raises the best of them, and ranks these. is_unlike: that of the match. */
static orb_status fill_trials(orb_trials *t, int is_unlike) {
  orb_trials *small;
  orb_status status;
  ORB_GO(status, open_small(t, &small), end);
  ORB_GO(status, orb_trials_make(small), end);
  ORB_GO(status, orb_trials_rank(small), end);
  const int bends_little = orb_trials_bend(small) <= ORB_FIND_COARSE_TOO;
  ORB_GO(status, improve_trials(small, is_unlike), end);
  ORB_GO(status, orb_trials_raise(small, t), end);
  ORB_GO(status, rank_raised(t, bends_little), end);
  if (t->hint.count == 0) { /* landmarks draw the best trial along its map, which crossing does not change */
    ORB_GO(status, orb_trials_cross(t), end);
  }
  if (!t->hint.tells) {
    status = orb_trials_weigh_asymmetry(small, t);
  }
end:
  close_small(t->ctx, small);
  return status;
}

/* Do landmarks that exclude one body leave limbs open? Pins then may take limbs to other limbs at little energy: four
 * of 54 pairs of slim and stout hands (`orbmorph-posed`, three poses, seeds 1 to 3) with eight landmarks came to 1.22
 * to 1.27 with fingers on other fingers, where right maps have 1.13. Fewer than FEW are not asked: of 83 pairs of
 * animals of other kinds (seed 31) with five, one was better with a match and one worse. */
static orb_status ask_limbs(const orb_trials *t, int *are_open) {
  orb_trials *small;
  orb_status status;
  *are_open = 0;
  if (t->hint.count < ORB_FIND_HINT_FEW || t->hint.count >= ORB_FIND_HINT_ALL) {
    return ORB_OK;
  }
  ORB_GO(status, open_small(t, &small), end);
  status = are_limbs_open(small, are_open);
end:
  close_small(t->ctx, small);
  return status;
}

/* Landmarks exclude that the shapes are one body; one may be a part of the other one. */
static orb_status give_up(orb_trials *t, const orb_match_hint *hint, orb_match *out) {
  if (hint->seeks_part && orb_inset_is_possible(t)) {
    ORB_TRY(orb_trials_survey(t, 0));
    ORB_TRY(orb_inset_find(t, &out->inset));
  }
  return hint->asks_limbs && out->inset.count == 0 ? ask_limbs(t, &out->leaves_open) : ORB_OK;
}

static orb_status run(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, const orb_match_hint *hint,
                      int walks, orb_match *out) {
  orb_trials *t = out->trials;
  double stretch = 0;
  ORB_TRY(orb_trials_open(ctx, first, second, t));
  if (hint) {
    ORB_TRY(take_hint(t, hint, &stretch));
  }
  out->is_unlike = stretch > ORB_FIND_HINT_STRETCH_MOST;
  out->walks_above = out->is_unlike ? ORB_FIND_HINT_BEND : ORB_FIND_WALKS_FIRST;
  if (hint && stretch > hint->stretch) {
    return give_up(t, hint, out);
  }
  const int may_be = hint ? hint->seeks_part && !out->is_unlike : walks; /* for unlike ones, give_up() looks */
  const int seeks = may_be && orb_inset_is_possible(t);
  double bend = INFINITY;
  if (!out->is_unlike) { /* the trial that landmarks make would bend unlike shapes too much */
    ORB_TRY(orb_trials_try_hinted(t, &bend));
  }
  if (hint && stretch > hint->sure && isfinite(bend) && bend > ORB_FIND_HINTED_UNLIKE) {
    out->is_unsure = 1;
    return ORB_OK;
  }
  if (t->count == 0) {
    ORB_TRY(fill_trials(t, out->is_unlike));
  }
  int32_t best = orb_trials_best(t);
  if (t->count == 0 || !(t->trial[best].cost < INFINITY)) {
    return seeks && hint ? orb_inset_find(t, &out->inset) : ORB_OK;
  }
  out->is_unsure = !suits_hint(&t->trial[best], hint, stretch);
  if (out->is_unsure) {
    return ORB_OK;
  }
  out->is_found = 1;
  out->moves = roundness(&t->copy[0].mesh) < ORB_FIND_LESS_ROUND * roundness(&t->copy[1].mesh) ? 0 : 1;
  orb_trials_list(t);
  ORB_TRY(write_ranking(t, out));
  if (seeks && out->bend > ORB_FIND_INSET_BENDS) {
    ORB_TRY(orb_inset_find(t, &out->inset));
  }
  if (hint && out->inset.count > 0) { /* nothing settles on the map */
    return ORB_OK;
  }
  return orb_trials_refine(t, walks && out->bend > out->walks_above ? ORB_FIND_FINE_BENT : ORB_FIND_FINE);
}

static orb_status find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, const orb_match_hint *hint,
                       int walks, int32_t small_size, orb_match *out) {
  memset(out, 0, sizeof *out);
  out->trials = ORB_NEW0(ctx, orb_trials, 1);
  if (!out->trials) {
    return ORB_E_NO_MEMORY;
  }
  out->trials->small_size = small_size;
  return run(ctx, first, second, hint, walks, out);
}

orb_status orb_match_find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, const orb_match_hint *hint,
                          int walks, orb_match *out) {
  return find(ctx, first, second, hint, walks, ORB_FIND_SMALL, out);
}

orb_status orb_match_find_again(orb_context *ctx, const orb_mesh *first, const orb_mesh *second, int32_t number,
                                int walks, orb_match *out) {
  return find(ctx, first, second, NULL, walks, ORB_FIND_SMALL + number * ORB_FIND_SMALL_AGAIN, out);
}

orb_status orb_match_target(orb_context *ctx, const orb_match *match, int32_t n, int moving, double **target) {
  ORB_ASSERT(match->is_found && n >= 0 && n <= match->other_count);
  orb_trials *t = match->trials;
  orb_trial *one = &t->trial[t->list[n]];
  *target = NULL;
  if (!(one->cost < INFINITY)) { /* it was dropped before its way back was registered */
    ORB_TRY(orb_trials_complete(ctx, t, t->list[n]));
  }
  return one->cost < INFINITY ? write_targets(ctx, match, one, moving, target) : ORB_OK;
}

static size_t target_count(const orb_match *match) {
  return 3 * (size_t)match->trials->mesh[1]->vertex_count;
}

static orb_status fill_target(orb_context *ctx, void *user) {
  const orb_match *match = user;
  double *target;
  orb_status status = orb_match_target(ctx, match, 0, 1, &target);
  if (status == ORB_OK) {
    ORB_ASSERT(target); /* the best map has its way back */
    memcpy(match->target, target, target_count(match) * sizeof *target);
  }
  orb_free(ctx, target);
  return status;
}

orb_status orb_match_aim(orb_context *ctx, orb_match *match, orb_map_aim *aim) {
  match->target = ORB_NEW(ctx, double, target_count(match));
  *aim = (orb_map_aim){fill_target, match};
  return match->target ? ORB_OK : ORB_E_NO_MEMORY;
}

orb_status orb_match_choose(orb_context *ctx, orb_match *match, int32_t k, double *target, double clear) {
  orb_trials *t = match->trials;
  const int32_t chosen = t->list[1 + k];
  ORB_ASSERT(k < match->other_count && t->trial[chosen].cost < INFINITY);
  memmove(t->list + 1, t->list, (size_t)(1 + k) * sizeof *t->list);
  t->list[0] = chosen;
  orb_free(ctx, match->target);
  match->target = target;
  ORB_TRY(write_ranking(t, match));
  match->clear = clear;
  match->lead = 1;
  return ORB_OK;
}

void orb_match_demote(orb_match *match) {
  const int32_t kept = match->other_count < ORB_MATCH_OTHERS ? match->other_count : ORB_MATCH_OTHERS - 1;
  memmove(match->other + 1, match->other, (size_t)kept * sizeof *match->other);
  match->other[0] = (orb_match_other){.cost = 1, .bend = match->bend, .pairs = match->pairs};
  match->other_count = kept + 1;
}

void orb_match_free(orb_context *ctx, orb_match *match) {
  if (match->trials) {
    orb_trials_close(match->trials);
    orb_free(ctx, match->trials);
  }
  orb_free(ctx, match->target);
  memset(match, 0, sizeof *match);
}

double orb_match_confidence(double bend, double clear, double lead, double energy) {
  if (!(energy >= 1) || !isfinite(energy)) { /* rounding of an isometry, or not measured: as if the map were bad */
    energy = energy < 1 ? 1 : ORB_FIND_SURE_UNMEASURED;
  }
  double odds = ORB_FIND_SURE + ORB_FIND_SURE_CLEAR * fmin(clear, ORB_FIND_CLEAR) - ORB_FIND_SURE_BEND * bend -
                ORB_FIND_SURE_ENERGY * log(energy);
  const double share = 1 / (1 + exp(-(lead - 1) / ORB_FIND_TIE));
  return share / (1 + exp(-odds));
}
