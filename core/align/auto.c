/* Alignment without landmarks.
 *
 * The rotation search followed by non-rigid registration in space is right for shapes in like poses, and the energy of
 * the composed map says whether it is. Where the energy stays above that of nearly isometric shapes, other candidates
 * are tried and ranked on coarse copies (find/candidates.c), which costs little. If one is better than what the
 * rotation has reached, an alignment by pin uses its pairs as landmarks and is then composed without them, and the
 * alignment of less energy is returned; else the rotation is composed to the end. The preset `quality` does that in any
 * case.
 */
#include <math.h>
#include <string.h>

#include "align/find/candidates.h"
#include "align/find/found.h"
#include "align/find/match.h"
#include "align/find/params.h"
#include "align/map/engine/params.h"
#include "align/methods.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "orbmorph/locate.h"

/* The best candidates of all later shapes, and the vertices that they match. */
typedef struct matches {
  orb_candidate *of; /* of each later shape, from 1 on */
  int32_t count;     /* vertices that all candidates match */
  int32_t *vertex;   /* ORB_CANDIDATE_PAIRS a shape */
  double energy;     /* mean over the shapes, on the coarse copies */
  double clear;      /* least over the shapes, see orb_candidate */
  int is_certain;    /* for all shapes, see orb_candidate */
} matches;

/* Gathers the vertices of the first shape that every candidate matches, and their partners. */
static void gather(matches *m, int32_t shape_count) {
  for (int32_t i = 0; shape_count > 1 && i < m->of[1].count; i++) {
    int32_t found = 1;
    m->vertex[m->count] = m->of[1].first[i];
    for (int32_t s = 1; s < shape_count; s++) {
      for (int32_t k = 0; k < m->of[s].count; k++) {
        if (m->of[s].first[k] == m->of[1].first[i]) {
          m->vertex[(size_t)s * ORB_CANDIDATE_PAIRS + (size_t)m->count] = m->of[s].second[k];
          found++;
        }
      }
    }
    m->count += found == shape_count;
  }
}

static orb_status find_candidates(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, matches *m) {
  m->clear = 1;
  m->is_certain = 1;
  m->of = ORB_NEW0(ctx, orb_candidate, shape_count);
  m->vertex = ORB_NEW(ctx, int32_t, ORB_CANDIDATE_PAIRS * (size_t)shape_count);
  if (!m->of || !m->vertex) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 1; s < shape_count; s++) {
    ORB_TRY(orb_candidate_find(ctx, shapes[0].mesh, shapes[s].mesh, &m->of[s]));
    m->clear = fmin(m->clear, m->of[s].clear);
    m->is_certain = m->is_certain && m->of[s].is_certain;
    m->energy += m->of[s].energy / (shape_count - 1);
  }
  gather(m, shape_count);
  return ORB_OK;
}

/* Has no mesh been split? */
static int is_unsplit(const orb_align_shape *shapes, const orb_alignment *a) {
  for (int32_t s = 0; s < a->shape_count; s++) {
    if (a->shapes[s].mesh.vertex_count != shapes[s].mesh->vertex_count) {
      return 0;
    }
  }
  return 1;
}

/* Moves the alignment of less energy to *one and frees the other. Returns whether *other was the better one. */
static int keep_better(orb_context *ctx, orb_alignment *one, orb_alignment *other) {
  int better = other->energy < one->energy;
  orb_alignment_free(ctx, better ? one : other);
  if (better) {
    *one = *other;
  }
  return better;
}

/* Pins the shapes at the matches; `composed`: and composes the map with the matches held. The result has no landmarks.
 * *held 0: the matches cannot be met on the meshes as they are, and `out` is empty. */
static orb_status pin_matched(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, const matches *m,
                              const orb_align_options *options, int composed, orb_alignment *out, int *held) {
  orb_status status = ORB_E_NO_MEMORY;
  orb_align_options pin = *options;
  orb_place *at = ORB_NEW(ctx, orb_place, (size_t)m->count * (size_t)shape_count);
  orb_landmark landmarks[ORB_CANDIDATE_PAIRS];
  pin.method = ORB_ALIGN_PIN;
  pin.preset = composed ? options->preset : ORB_PRESET_FAST;
  pin.max_growth = 1e-9; /* practically none: 0 would mean the default */
  memset(out, 0, sizeof *out);
  memset(landmarks, 0, sizeof landmarks);
  *held = 0;
  if (!at) {
    goto end;
  }
  for (int32_t k = 0; k < m->count; k++) {
    landmarks[k].at = at + (size_t)k * (size_t)shape_count;
    for (int32_t s = 0; s < shape_count; s++) {
      ORB_GO(status,
             orb_place_of_vertex(ctx, shapes[s].mesh, m->vertex[(size_t)s * ORB_CANDIDATE_PAIRS + (size_t)k],
                                 &at[(size_t)k * (size_t)shape_count + (size_t)s]),
             end);
    }
  }
  status = orb_align_given(ctx, shapes, shape_count, landmarks, m->count, &pin, out);
  if (status == ORB_E_BAD_LANDMARKS) {
    orb_error_clear(ctx);
    status = ORB_OK;
    goto end;
  }
  if (status != ORB_OK || !is_unsplit(shapes, out)) {
    goto end;
  }
  out->landmark_count = 0;
  for (int32_t s = 0; s < shape_count; s++) {
    orb_free(ctx, out->shapes[s].landmark_vertices);
    out->shapes[s].landmark_vertices = NULL;
  }
  *held = 1;
end:
  orb_free(ctx, at);
  if (!*held) {
    orb_alignment_free(ctx, out);
  }
  return status;
}

/* Pins the shapes at the matches and composes the map without them; `twice`: composes it first with the matches held.
 * *held 0: the matches cannot be met on the meshes as they are, and `out` is empty. */
static orb_status align_matched(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, const matches *m,
                                const orb_align_options *options, int twice, orb_alignment *out, int *held) {
  ORB_TRY(pin_matched(ctx, shapes, shape_count, m, options, twice, out, held));
  if (!*held) {
    return ORB_OK;
  }
  orb_status status = orb_compose_all(ctx, out, ORB_MAP_FROM_MAP, NULL, options->preset);
  if (status != ORB_OK) {
    *held = 0;
    orb_alignment_free(ctx, out);
  }
  return status;
}

/* Matches that are held pull a map to where they are a little off. They are right where shapes are nearly isometric, as
 * the energy reached so far says, and they free a map that thin limbs have caught. Where neither is known, the map is
 * composed without holding them, and also with them held if that leads to little; `quality` always tries both. */
static orb_status align_matched_best(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                     const matches *m, const orb_align_options *options, double reached,
                                     orb_alignment *out, int *held) {
  orb_alignment other;
  const orb_map_params params = orb_map_params_of(options->preset);
  int again, twice = reached <= params.energy.good || m->energy > params.energy.caught;
  ORB_TRY(align_matched(ctx, shapes, shape_count, m, options, twice, out, held));
  if (!*held || twice || (out->energy <= params.energy.poor && options->preset != ORB_PRESET_QUALITY)) {
    return ORB_OK;
  }
  orb_status status = align_matched(ctx, shapes, shape_count, m, options, 1, &other, &again);
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
    *held = 0;
  } else if (again) {
    (void)keep_better(ctx, out, &other);
  }
  return status;
}

/* How far the matched vertices go from their partners under an alignment, in the mean, in diagonals. */
static orb_status measure_away(orb_context *ctx, const orb_alignment *alignment, const matches *m, double *away) {
  *away = 0;
  for (int32_t s = 1; s < alignment->shape_count; s++) {
    const orb_aligned_shape *shape = &alignment->shapes[s];
    orb_locator *locator;
    orb_extent extent;
    orb_mesh_extent(&shape->mesh, &extent);
    ORB_TRY(orb_locator_create(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                               shape->mesh.triangle_count, NULL, &locator));
    for (int32_t k = 0; k < m->count; k++) {
      orb_place place;
      double image[3];
      const int32_t partner = m->vertex[(size_t)s * ORB_CANDIDATE_PAIRS + (size_t)k];
      orb_locate(locator, alignment->shapes[0].points + 3 * (size_t)m->vertex[k], -1, &place);
      orb_place_position(&shape->mesh, &place, image);
      *away += sqrt(orb_distance2(image, shape->mesh.positions + 3 * (size_t)partner)) / extent.diagonal /
               (m->count * (alignment->shape_count - 1));
    }
    orb_locator_destroy(ctx, locator);
  }
  return ORB_OK;
}

/* Aligns by the best candidates. *held 0: they are no better than the rotation search or than the energy reached so
 * far, or their pairs cannot be met; `out` is empty. *forced: `reached` is that of a map that is certainly wrong. */
static orb_status try_candidates(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                 const orb_align_options *options, const orb_alignment *reached, double *clear,
                                 orb_alignment *out, int *held, int *forced) {
  matches m = {0};
  orb_status status;
  double away = 0;
  *held = *forced = 0;
  ORB_GO(status, find_candidates(ctx, shapes, shape_count, &m), end);
  *clear = m.clear;
  if (m.count >= 3 && m.is_certain) {
    ORB_GO(status, measure_away(ctx, reached, &m, &away), end);
    *forced = away > ORB_FIND_AGREES;
  }
  if (m.count >= 3 && (m.energy < reached->energy || *forced)) {
    ORB_GO(status, align_matched_best(ctx, shapes, shape_count, &m, options, reached->energy, out, held), end);
  }
end:
  orb_free(ctx, m.of);
  orb_free(ctx, m.vertex);
  return status;
}

/* Improves a rotated alignment that registration in space has not brought near an isometry: candidates replace it if
 * they are better; else it is composed to the end unless it is good. */
static orb_status improve(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                          const orb_align_options *options, orb_alignment *alignment, double *clear) {
  orb_alignment other;
  int held, forced;
  ORB_TRY(try_candidates(ctx, shapes, shape_count, options, alignment, clear, &other, &held, &forced));
  if (held && forced) {
    orb_alignment_free(ctx, alignment);
    *alignment = other;
    return ORB_OK;
  }
  int taken = held && keep_better(ctx, alignment, &other);
  if (!taken && options->preset != ORB_PRESET_QUALITY &&
      alignment->energy > orb_map_params_of(options->preset).energy.good) {
    return orb_compose_all(ctx, alignment, ORB_MAP_SPACE_DONE, NULL, options->preset);
  }
  return ORB_OK;
}

/* The matches of all later shapes with the first. */
typedef struct found {
  orb_match *of;          /* of each later shape, from 1 on */
  const double **targets; /* likewise */
  int32_t shape_count;
  int all; /* a match was found for each */
} found;

static void found_free(orb_context *ctx, found *f) {
  for (int32_t s = 1; f->of && s < f->shape_count; s++) {
    orb_match_free(ctx, &f->of[s]);
  }
  orb_free(ctx, f->of);
  orb_free(ctx, f->targets);
}

static orb_status find_matches(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, found *f,
                               matches *m) {
  f->of = ORB_NEW0(ctx, orb_match, shape_count);
  f->targets = ORB_NEW0(ctx, const double *, shape_count);
  m->of = ORB_NEW0(ctx, orb_candidate, shape_count);
  m->vertex = ORB_NEW(ctx, int32_t, ORB_CANDIDATE_PAIRS * (size_t)shape_count);
  if (!f->of || !f->targets || !m->of || !m->vertex) {
    return ORB_E_NO_MEMORY;
  }
  f->shape_count = shape_count;
  f->all = 1;
  m->clear = 1;
  for (int32_t s = 1; s < shape_count; s++) {
    orb_match *one = &f->of[s];
    ORB_TRY(orb_match_find(ctx, shapes[0].mesh, shapes[s].mesh, one));
    f->targets[s] = one->target;
    f->all = f->all && one->is_found;
    m->clear = fmin(m->clear, one->clear);
    m->of[s].count = one->count;
    memcpy(m->of[s].first, one->first, sizeof one->first);
    memcpy(m->of[s].second, one->second, sizeof one->second);
  }
  gather(m, shape_count);
  return ORB_OK;
}

/* Composes a rotated alignment towards the matches. Where that has led to no good map, their pairs are pinned and
 * composed from there, and the better of both stays. *matched 0: a shape has no match, and nothing has changed. */
static orb_status follow_matches(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                 const orb_align_options *options, orb_alignment *alignment, double *clear,
                                 int *matched) {
  found f = {0};
  matches m = {0};
  orb_alignment other;
  int held;
  orb_status status;
  ORB_GO(status, find_matches(ctx, shapes, shape_count, &f, &m), end);
  *matched = f.all;
  if (!f.all) {
    goto end;
  }
  *clear = m.clear;
  ORB_GO(status, orb_compose_all(ctx, alignment, ORB_MAP_FROM_SPACE, f.targets, options->preset), end);
  if (m.count >= 3 && alignment->energy > orb_map_params_of(options->preset).energy.poor) {
    ORB_GO(status, align_matched(ctx, shapes, shape_count, &m, options, 1, &other, &held), end);
    if (held) {
      (void)keep_better(ctx, alignment, &other);
    }
  }
end:
  found_free(ctx, &f);
  orb_free(ctx, m.of);
  orb_free(ctx, m.vertex);
  return status;
}

orb_status orb_align_auto(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                          const orb_align_options *options, orb_alignment *out) {
  orb_status status;
  orb_align_options rotated = *options;
  double clear = 1;
  int matched = 0;
  rotated.preset = ORB_PRESET_FAST;
  ORB_TRY(orb_align_given(ctx, shapes, shape_count, NULL, 0, &rotated, out));
  if (options->preset != ORB_PRESET_FAST) {
    ORB_GO(status, follow_matches(ctx, shapes, shape_count, options, out, &clear, &matched), failed);
  }
  if (options->preset != ORB_PRESET_FAST && !matched) {
    orb_map_from from = options->preset == ORB_PRESET_QUALITY ? ORB_MAP_FROM_SPACE : ORB_MAP_SPACE_ONLY;
    ORB_GO(status, orb_compose_all(ctx, out, from, NULL, options->preset), failed);
    if (out->energy > orb_map_params_of(options->preset).energy.near_isometry) {
      ORB_GO(status, improve(ctx, shapes, shape_count, options, out, &clear), failed);
    }
  }
  ORB_GO(status, orb_align_find(ctx, out, clear), failed);
  return ORB_OK;
failed:
  orb_alignment_free(ctx, out);
  return status;
}
