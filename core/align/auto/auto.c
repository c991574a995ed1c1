/* Alignment without landmarks.
 *
 * The shapes are embedded again, on spheres that keep angles. Every later shape is matched with the first one
 * (find/match.c), and the composed map goes to the targets of its match. If one of two shapes is a part of the other
 * one, what lies on each other in space is held instead (find/inset/inset.h). Two shapes that bend much hold a contest
 * of the ways to make the map instead (find/contest.h). If the targets give no good map of two shapes, the next best
 * match is tried. If two shapes match with little bend and their map is poor all the same, limbs have gone astray, and
 * the match is searched again from other small copies. If the targets give no good map of more shapes, pairs of the
 * matches are pinned as landmarks, and the map is composed with the pairs held and then without them. The alignment of
 * least energy is returned. The preset `fast` only searches for rotations of the given spheres.
 */
#include <math.h>
#include <string.h>

#include "align/find/contest.h"
#include "align/find/match.h"
#include "align/find/params.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "align/sheet/even.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

enum { LEAST_PAIRS = 3 };            /* least pairs that are pinned: two leave a rotation open */
static const double MOST_COST = 1e9; /* of an alternative, if the best rough map does not bend the shapes at all */
_Static_assert((int)ORB_MATCH_OTHERS <= (int)ORB_ALTERNATIVES_MAX, "all other maps fit");
_Static_assert((int)ORB_MATCH_PAIRS <= (int)ORB_ALTERNATIVE_PAIRS, "all pairs fit");

/* The matches of all later shapes with the first. */
typedef struct matches {
  int32_t shape_count;
  orb_match *of;          /* of each later shape, from 1 on */
  const double **targets; /* likewise */
  int32_t count;          /* vertices of the first shape that all matches pair */
  int32_t *vertex;        /* these, and their partners: ORB_MATCH_PAIRS a shape */
  int is_part;            /* one of two shapes is laid onto a part of the other one */
  double clear, lead;     /* least over the shapes */
  double bend;            /* most over the shapes */
  int are_found;          /* all of them */
  int keep_angles;        /* the spheres of the shapes do */
} matches;

static void matches_free(orb_context *ctx, matches *m) {
  for (int32_t s = 1; m->of && s < m->shape_count; s++) {
    orb_match_free(ctx, &m->of[s]);
  }
  orb_free(ctx, m->of);
  orb_free(ctx, m->targets);
  orb_free(ctx, m->vertex);
}

/* Gathers the vertices of the first shape that every match pairs, and their partners. */
static void gather(matches *m) {
  m->count = 0;
  for (int32_t i = 0; m->shape_count > 1 && i < m->of[1].pairs.count; i++) {
    int32_t found = 1;
    m->vertex[m->count] = m->of[1].pairs.first[i];
    for (int32_t s = 1; s < m->shape_count; s++) {
      for (int32_t k = 0; k < m->of[s].pairs.count; k++) {
        if (m->of[s].pairs.first[k] == m->of[1].pairs.first[i]) {
          m->vertex[(size_t)s * ORB_MATCH_PAIRS + (size_t)m->count] = m->of[s].pairs.second[k];
          found++;
        }
      }
    }
    m->count += found == m->shape_count;
  }
}

/* number: of the further search of two shapes; 0: the first one. */
static orb_status find_matches(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, int keep_angles,
                               int32_t number, matches *m) {
  *m = (matches){.shape_count = shape_count, .clear = 1, .lead = INFINITY, .are_found = 1, .keep_angles = keep_angles};
  m->of = ORB_NEW0(ctx, orb_match, shape_count);
  m->targets = ORB_NEW0(ctx, const double *, shape_count);
  m->vertex = ORB_NEW(ctx, int32_t, ORB_MATCH_PAIRS * (size_t)shape_count);
  if (!m->of || !m->targets || !m->vertex) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 1; s < shape_count; s++) {
    ORB_TRY(orb_match_find_again(ctx, shapes[0].mesh, shapes[s].mesh, number, shape_count == 2, &m->of[s]));
    m->are_found = m->are_found && m->of[s].is_found;
    m->clear = fmin(m->clear, m->of[s].clear);
    m->lead = fmin(m->lead, m->of[s].lead);
    m->bend = fmax(m->bend, m->of[s].bend);
  }
  gather(m);
  return ORB_OK;
}

/* The next best match of two shapes, with its map. */
typedef struct next_match {
  int is_open;
  double *target;
  orb_alignment alignment;
  orb_map_course course;
} next_match;

static void next_free(orb_context *ctx, next_match *next) {
  orb_free(ctx, next->target);
  orb_alignment_free(ctx, &next->alignment);
  memset(next, 0, sizeof *next);
}

/* The shapes with their spheres rotated onto each other. */
static orb_status rotate_spheres(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                 const orb_align_options *options, orb_alignment *out) {
  orb_align_options rotated = *options;
  rotated.preset = ORB_PRESET_FAST;
  return orb_align_given(ctx, shapes, shape_count, NULL, 0, &rotated, out);
}

/* Composes two shapes towards the next best match, unless the best one has led to a good map, or the next one is far
 * behind or bends the shapes so much that only a walk would follow it: of 43 such walks, one led to a better map, by
 * 0.2 %. Its start must beat that of the best match, which had the same effort. */
static orb_status next_open(orb_context *ctx, const orb_align_shape *shapes, const matches *m,
                            const orb_align_options *options, double energy, const orb_map_course *best,
                            next_match *next) {
  const double cost = m->shape_count == 2 && m->of[1].other_count > 0 ? m->of[1].other[0].cost : INFINITY;
  if (!(energy > ORB_FIND_OTHER_ABOVE) || cost > ORB_FIND_OTHER_BEHIND ||
      m->of[1].other[0].bend > ORB_FIND_WALKS_FIRST) {
    return ORB_OK;
  }
  ORB_TRY(orb_match_target(ctx, &m->of[1], 1, 1, &next->target));
  if (!next->target) {
    return ORB_OK;
  }
  ORB_TRY(rotate_spheres(ctx, shapes, m->shape_count, options, &next->alignment));
  next->is_open = 1;
  const double *const targets[2] = {NULL, next->target};
  const orb_aims aims = {.targets = targets,
                         .keep_angles = m->keep_angles,
                         .beat = {.bulk = best->first_bulk, .energy = energy},
                         .course = &next->course};
  return orb_compose_all(ctx, &next->alignment, ORB_MAP_FROM_SPACE, &aims, options->preset);
}

/* Is the map of the next best match clearly better? */
static int next_is_better(const next_match *next, const orb_map_course *best) {
  return next->is_open && !next->course.is_beaten && next->course.bulk - 1 < ORB_FIND_OTHER_GAIN * (best->bulk - 1);
}

/* Makes other match k the match; takes over its target. The best match can be wrong although it bends less, since a
 * twisted body can bend less when its limbs are swapped; then only the map shows the mistake. Since bend and map
 * disagree, the match counts as unclear. */
static orb_status choose_other(orb_context *ctx, matches *m, int32_t k, double *target, double clear) {
  ORB_TRY(orb_match_choose(ctx, &m->of[1], k, target, clear));
  m->targets[1] = m->of[1].target;
  m->clear = m->of[1].clear;
  m->lead = m->of[1].lead;
  m->bend = m->of[1].bend;
  gather(m);
  return ORB_OK;
}

/* Replaces the map of the best match by that of the next best one. */
static orb_status next_take(orb_context *ctx, matches *m, double poor, next_match *next, orb_alignment *alignment) {
  const double clear = fmax(0, 1 - next->alignment.energy / fmin(alignment->energy, poor));
  double *target = next->target;
  orb_alignment_free(ctx, alignment);
  *alignment = next->alignment;
  memset(next, 0, sizeof *next);
  return choose_other(ctx, m, 0, target, clear);
}

/* If a match has led to no map, its pairs are pinned. */
static orb_status pin_poor(orb_context *ctx, const orb_align_shape *shapes, const matches *m,
                           const orb_align_options *options, orb_alignment *alignment) {
  const orb_held_pairs pairs = {m->vertex, ORB_MATCH_PAIRS, m->count};
  orb_alignment other;
  int held;
  if (m->count < LEAST_PAIRS || alignment->energy <= ORB_FIND_PINS_ABOVE) {
    return ORB_OK;
  }
  ORB_TRY(orb_align_held(ctx, shapes, m->shape_count, &pairs, 0, options, &other, &held));
  if (held) {
    orb_alignment_keep_better(ctx, alignment, &other);
  }
  return ORB_OK;
}

/* Composes two shapes that bend much towards their match, or towards the next best one if both walks of the
 * match are poor and that leads to a better map. */
static orb_status hold_contest(orb_context *ctx, matches *m, const orb_align_options *options,
                               orb_alignment *alignment) {
  orb_contest_result won;
  ORB_TRY(orb_contest_run(ctx, &m->of[1], 0, INFINITY, options->preset, alignment, &won));
  return won.is_second ? choose_other(ctx, m, 0, NULL, won.clear) : ORB_OK;
}

/* Computes the targets of all matches; that of two shapes is only aimed at, and filled later. */
static orb_status aim(orb_context *ctx, matches *m, orb_map_aim *later) {
  for (int32_t s = 1; s < m->shape_count; s++) {
    if (m->of[s].is_found) {
      ORB_TRY(m->shape_count == 2 ? orb_match_aim(ctx, &m->of[s], later)
                                  : orb_match_target(ctx, &m->of[s], 0, 1, &m->of[s].target));
    }
    m->targets[s] = m->of[s].target;
  }
  return ORB_OK;
}

/* Aligns a part and its whole by the pairs that lie on each other in space. The match of the wholes becomes the first
 * of the others: no energy compares the two maps. *held 0: the pairs cannot be met, or their map is bad, and nothing
 * has changed. */
static orb_status align_inset(orb_context *ctx, const orb_align_shape *shapes, matches *m,
                              const orb_align_options *options, orb_alignment *alignment, int *held) {
  const orb_inset *inset = &m->of[1].inset;
  const orb_held_pairs pairs = {inset->vertex[0], ORB_FIND_INSET_PAIRS, inset->count};
  orb_alignment other;
  ORB_TRY(orb_align_held(ctx, shapes, 2, &pairs, 1, options, &other, held));
  if (*held && other.energy > ORB_FIND_INSET_MOST_ENERGY) {
    orb_alignment_free(ctx, &other);
    *held = 0;
  }
  if (*held) {
    orb_alignment_free(ctx, alignment);
    *alignment = other;
    orb_match_demote(&m->of[1]);
    m->is_part = 1;
  }
  return ORB_OK;
}

/* Composes a rotated alignment towards the matches. Two shapes that bend much hold a contest. If all others lead to no
 * good map, continues with the next best match of two shapes, or pins pairs of the matches of more. */
static orb_status follow_matches(orb_context *ctx, const orb_align_shape *shapes, matches *m,
                                 const orb_align_options *options, orb_alignment *alignment) {
  const double poor = orb_map_params_of(options->preset).energy.poor;
  if (m->shape_count == 2 && m->of[1].inset.count >= LEAST_PAIRS) {
    int held;
    ORB_TRY(align_inset(ctx, shapes, m, options, alignment, &held));
    if (held) {
      return ORB_OK;
    }
  }
  if (m->shape_count == 2 && orb_contest_is_open(&m->of[1], m->keep_angles)) {
    return hold_contest(ctx, m, options, alignment);
  }
  next_match next = {0};
  orb_status status;
  orb_map_course course = {0};
  orb_map_aim later = {0};
  ORB_TRY(aim(ctx, m, &later));
  const orb_aims aims = {.targets = m->targets,
                         .aim = later,
                         .keep_angles = m->keep_angles,
                         .course = m->shape_count == 2 ? &course : NULL, /* only pairs have a next match */
                         .walks_first = m->bend > ORB_FIND_WALKS_FIRST,
                         .walks_early = m->bend > ORB_FIND_WALKS_EARLY};
  ORB_TRY(orb_compose_all(ctx, alignment, ORB_MAP_FROM_SPACE, m->are_found ? &aims : NULL, options->preset));
  if (m->shape_count > 2) {
    return pin_poor(ctx, shapes, m, options, alignment);
  }
  ORB_GO(status, next_open(ctx, shapes, m, options, alignment->energy, &course, &next), end);
  if (next_is_better(&next, &course)) {
    status = next_take(ctx, m, poor, &next, alignment);
  }
end:
  next_free(ctx, &next);
  return status;
}

/* Is the map of a match that bends little so poor that limbs are in wrong places? */
static int has_gone_astray(const matches *m, double energy) {
  return m->shape_count == 2 && m->are_found && !m->is_part && m->bend <= ORB_FIND_COARSE_BEND &&
         energy > ORB_FIND_AGAIN_ABOVE;
}

/* The match that bends least of all further searches; costs do not compare, since only some searches weigh symmetries.
 * None is found, and `out` is empty, if none bends less than the one that has gone astray. */
static orb_status find_again(orb_context *ctx, const orb_align_shape *shapes, const matches *astray, matches *out) {
  double least = astray->bend;
  *out = (matches){.clear = 1};
  for (int32_t i = 1; i <= ORB_FIND_AGAIN; i++) {
    matches one;
    const orb_status status = find_matches(ctx, shapes, 2, astray->keep_angles, i, &one);
    if (status == ORB_OK && one.are_found && one.bend < least) {
      const matches worse = *out;
      least = one.bend;
      *out = one;
      one = worse;
    }
    matches_free(ctx, &one);
    ORB_TRY(status);
  }
  return ORB_OK;
}

/* Searches again where limbs have gone astray, and takes the better map and its match. Registrations of thin limbs are
 * a lottery on small copies: of 28 pairs of spiders in two poses, whose eight legs lie beside each other, three had
 * an energy of 2.5 to 3.4. */
static orb_status search_again(orb_context *ctx, const orb_align_shape *shapes, const orb_align_options *options,
                               matches *m, orb_alignment *alignment) {
  matches again = {.clear = 1};
  orb_alignment other = {0};
  orb_status status = ORB_OK;
  if (!has_gone_astray(m, alignment->energy)) {
    return ORB_OK;
  }
  ORB_GO(status, find_again(ctx, shapes, m, &again), end);
  if (!again.are_found) {
    goto end;
  }
  ORB_GO(status, rotate_spheres(ctx, shapes, 2, options, &other), end);
  ORB_GO(status, follow_matches(ctx, shapes, &again, options, &other), end);
  if (other.energy < alignment->energy && !again.is_part) { /* no energy compares a part with its whole */
    const matches worse_match = *m;
    const orb_alignment worse = *alignment;
    *m = again;
    *alignment = other;
    again = worse_match;
    other = worse;
  }
end:
  matches_free(ctx, &again);
  orb_alignment_free(ctx, &other);
  return status;
}

/* The vertex of a shape that its match takes nearest to a point of the first shape. */
static int32_t partner_of(const orb_mesh *mesh, const double *target, const double point[3]) {
  int32_t best = 0;
  double least = INFINITY;
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    const double *t = target + 3 * (size_t)v;
    double x = t[0] - point[0], y = t[1] - point[1], z = t[2] - point[2], d = x * x + y * y + z * z;
    if (d < least) {
      least = d;
      best = v;
    }
  }
  return best;
}

/* Lists the vertices that correspond if `other` is the map of shape s and all other shapes keep their best maps.
 * Returns how many; two pairs never share a vertex. `vertex`: as in matches. */
static int32_t pairs_of_other(const orb_align_shape *shapes, const matches *m, int32_t s, const orb_match_other *other,
                              int32_t *vertex) {
  int32_t count = 0;
  for (int32_t k = 0; k < other->pairs.count; k++) {
    const double *point = shapes[0].mesh->positions + 3 * (size_t)other->pairs.first[k];
    int is_free = 1;
    for (int32_t t = 0; t < m->shape_count; t++) {
      int32_t *row = vertex + (size_t)t * ORB_MATCH_PAIRS;
      row[count] = t == 0   ? other->pairs.first[k]
                   : t == s ? other->pairs.second[k]
                            : partner_of(shapes[t].mesh, m->targets[t], point);
      for (int32_t i = 0; i < count; i++) {
        is_free = is_free && row[i] != row[count];
      }
    }
    count += is_free;
  }
  return count;
}

/* Appends another map of shape s, as places, unless it has too few. */
static orb_status write_alternative(orb_context *ctx, const orb_align_shape *shapes, const matches *m, int32_t s,
                                    const orb_match_other *other, orb_alignment *out) {
  const size_t shape_count = (size_t)m->shape_count;
  orb_status status = ORB_OK;
  int32_t *vertex = ORB_NEW(ctx, int32_t, ORB_MATCH_PAIRS * shape_count);
  if (!vertex) {
    return ORB_E_NO_MEMORY;
  }
  const int32_t count = pairs_of_other(shapes, m, s, other, vertex);
  if (count >= LEAST_PAIRS) {
    orb_alternative *one = &out->alternatives[out->alternative_count];
    one->at = ORB_NEW0(ctx, orb_place, (size_t)count * shape_count);
    if (!one->at) {
      status = ORB_E_NO_MEMORY;
      goto end;
    }
    out->alternative_count++;
    one->cost = fmin(other->cost, MOST_COST);
    one->shape = s;
    one->count = count;
    for (size_t i = 0; i < (size_t)count * shape_count; i++) {
      const size_t t = i % shape_count;
      ORB_GO(status,
             orb_place_of_vertex(ctx, shapes[t].mesh, vertex[t * ORB_MATCH_PAIRS + i / shape_count], &one->at[i]), end);
    }
  }
end:
  orb_free(ctx, vertex);
  return status;
}

/* Lists the cheapest other maps of all matches. Those of one match come by rising cost. */
static orb_status write_alternatives(orb_context *ctx, const orb_align_shape *shapes, const matches *m,
                                     orb_alignment *out) {
  orb_status status = ORB_OK;
  int32_t *next = ORB_NEW0(ctx, int32_t, m->shape_count);
  out->alternatives = ORB_NEW0(ctx, orb_alternative, ORB_ALTERNATIVES_MAX);
  if (!next || !out->alternatives) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  while (out->alternative_count < ORB_ALTERNATIVES_MAX) {
    int32_t best = 0;
    for (int32_t s = 1; s < m->shape_count; s++) {
      if (next[s] < m->of[s].other_count &&
          (best == 0 || m->of[s].other[next[s]].cost < m->of[best].other[next[best]].cost)) {
        best = s;
      }
    }
    if (best == 0) {
      break;
    }
    ORB_GO(status, write_alternative(ctx, shapes, m, best, &m->of[best].other[next[best]++], out), end);
  }
end:
  orb_free(ctx, next);
  return status;
}

/* Adds what a caller may know of the matches: how sure the best ones are, and the next ones. */
static orb_status describe_matches(orb_context *ctx, const orb_align_shape *shapes, const matches *m,
                                   orb_alignment *out) {
  out->match.clear = m->clear;
  if (!m->are_found) {
    return ORB_OK;
  }
  out->match.is_measured = 1;
  out->match.is_part = m->is_part;
  out->match.bend = m->bend;
  out->match.lead = m->lead;
  return write_alternatives(ctx, shapes, m, out);
}

/* Aligns shapes whose spheres have been rotated onto each other, which `out` holds. */
static orb_status align_rotated(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, int keep_angles,
                                const orb_align_options *options, orb_alignment *out) {
  matches m = {.clear = 1};
  orb_status status;
  ORB_GO(status, find_matches(ctx, shapes, shape_count, keep_angles, 0, &m), end);
  ORB_GO(status, follow_matches(ctx, shapes, &m, options, out), end);
  ORB_GO(status, search_again(ctx, shapes, options, &m, out), end);
  status = describe_matches(ctx, shapes, &m, out);
end:
  matches_free(ctx, &m);
  return status;
}

/* The same on spheres that keep angles. */
static orb_status align_even(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                             const orb_align_options *options, orb_alignment *out) {
  orb_even_shapes even;
  orb_status status;
  orb_alignment_free(ctx, out);
  ORB_GO(status, orb_even_shapes_create(ctx, shapes, shape_count, &even), end);
  ORB_GO(status, rotate_spheres(ctx, even.shapes, shape_count, options, out), end);
  status = align_rotated(ctx, even.shapes, shape_count, 1, options, out);
end:
  orb_even_shapes_free(ctx, &even);
  return status;
}

orb_status orb_align_auto(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                          const orb_align_options *options, orb_alignment *out) {
  ORB_TRY(rotate_spheres(ctx, shapes, shape_count, options, out));
  orb_status status = ORB_OK;
  int alike = 1;
  if (options->preset != ORB_PRESET_FAST) {
    ORB_GO(status, orb_align_are_alike(ctx, out, options->preset, &alike), end);
    status = alike ? align_rotated(ctx, shapes, shape_count, 0, options, out)
                   : align_even(ctx, shapes, shape_count, options, out);
  } else {
    out->match.clear = 1;
  }
end:
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
  }
  return status;
}
