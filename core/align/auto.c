/* Alignment without landmarks.
 *
 * The rotation search, and then the one shape bent onto the other in space, are right for shapes in like poses, and the
 * energy of the composed map says so. Where it stays above that of nearly isometric shapes, other correspondences are
 * tried on coarse copies and ranked there (guess.c), which costs little. If one is better than what the rotation comes
 * to, an alignment by pin takes what it matches for landmarks and is then composed free of them, and the alignment of
 * less energy is returned; else the rotation is composed to the end. The preset `quality` does that in any case.
 */
#include <math.h>
#include <string.h>

#include "align/find/found.h"
#include "align/find/guess.h"
#include "align/methods.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"

/* Energies below it leave nothing to be won. Between it and ORB_MAP_GOOD_ENERGY shapes may differ so much, or a limb of
 * two nearly equal ones has gone wrong, which other correspondences show. */
static const double NEAR_ISOMETRY = 1.05;
/* Above it a map that was only pinned at the guesses before it was composed may have been caught on the way. */
static const double POOR_ENERGY = 1.45;
/* Of the coarse copies: above it thin limbs have caught even the best map there. */
static const double CAUGHT_ENERGY = 2;

typedef struct guesses {
  orb_guess *of;   /* each later shape's, from 1 on */
  int32_t count;   /* vertices that all of them match */
  int32_t *vertex; /* ORB_GUESS_MAX a shape */
  double energy;   /* in the mean, on the coarse copies */
  double clear;
} guesses;

/* Vertices of the first shape that every guess matches, and their partners. */
static void gather(guesses *g, int32_t shape_count) {
  for (int32_t i = 0; shape_count > 1 && i < g->of[1].count; i++) {
    int32_t found = 1;
    g->vertex[g->count] = g->of[1].first[i];
    for (int32_t s = 1; s < shape_count; s++) {
      for (int32_t k = 0; k < g->of[s].count; k++) {
        if (g->of[s].first[k] == g->of[1].first[i]) {
          g->vertex[(size_t)s * ORB_GUESS_MAX + (size_t)g->count] = g->of[s].second[k];
          found++;
        }
      }
    }
    g->count += found == shape_count;
  }
}

static orb_status guess_all(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, guesses *g) {
  g->clear = 1;
  g->of = ORB_NEW0(ctx, orb_guess, shape_count);
  g->vertex = ORB_NEW(ctx, int32_t, ORB_GUESS_MAX * (size_t)shape_count);
  if (!g->of || !g->vertex) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t s = 1; s < shape_count; s++) {
    ORB_TRY(orb_guess_find(ctx, shapes[0].mesh, shapes[s].mesh, &g->of[s]));
    g->clear = fmin(g->clear, g->of[s].clear);
    g->energy += g->of[s].energy / (shape_count - 1);
  }
  gather(g, shape_count);
  return ORB_OK;
}

/* Did splits leave every mesh as it was? */
static int is_unsplit(const orb_align_shape *shapes, const orb_alignment *a) {
  for (int32_t s = 0; s < a->shape_count; s++) {
    if (a->shapes[s].mesh.vertex_count != shapes[s].mesh->vertex_count) {
      return 0;
    }
  }
  return 1;
}

/* The one of less energy takes the place of the first, the other one is freed. Whether that was the second. */
static int keep_better(orb_context *ctx, orb_alignment *one, orb_alignment *other) {
  int better = other->energy < one->energy;
  orb_alignment_free(ctx, better ? one : other);
  if (better) {
    *one = *other;
  }
  return better;
}

/* Pinned at the guesses, and composed without them; `twice`: before that with them held. *held 0: they could not be met
 * as the meshes are, and `out` is empty. */
static orb_status align_guessed(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count, const guesses *g,
                                const orb_align_options *options, int twice, orb_alignment *out, int *held) {
  orb_status status = ORB_E_NO_MEMORY;
  orb_align_options pin = *options;
  orb_place *at = ORB_NEW(ctx, orb_place, (size_t)g->count * (size_t)shape_count);
  orb_landmark landmarks[ORB_GUESS_MAX];
  pin.method = ORB_ALIGN_PIN;
  pin.preset = twice ? options->preset : ORB_PRESET_FAST;
  pin.max_growth = 1e-9;
  memset(out, 0, sizeof *out);
  memset(landmarks, 0, sizeof landmarks);
  *held = 0;
  if (!at) {
    goto end;
  }
  for (int32_t k = 0; k < g->count; k++) {
    landmarks[k].at = at + (size_t)k * (size_t)shape_count;
    for (int32_t s = 0; s < shape_count; s++) {
      ORB_GO(status,
             orb_place_of_vertex(ctx, shapes[s].mesh, g->vertex[(size_t)s * ORB_GUESS_MAX + (size_t)k],
                                 &at[(size_t)k * (size_t)shape_count + (size_t)s]),
             end);
    }
  }
  status = orb_align_given(ctx, shapes, shape_count, landmarks, g->count, &pin, out);
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
  ORB_GO(status, orb_compose_all(ctx, out, ORB_MAP_FROM_MAP, options->preset), end);
  *held = 1;
end:
  orb_free(ctx, at);
  if (!*held) {
    orb_alignment_free(ctx, out);
  }
  return status;
}

/* Guesses that are held pull a map to where they are a little wrong. They are right where shapes are nearly isometric,
 * as the energy reached says, and help a map out where thin limbs catch it. Where neither is known before, both ways
 * are tried if the first one leads to little; `quality` always tries both. */
static orb_status align_guessed_best(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                                     const guesses *g, const orb_align_options *options, double reached,
                                     orb_alignment *out, int *held) {
  orb_alignment other;
  int again, twice = reached <= ORB_MAP_GOOD_ENERGY || g->energy > CAUGHT_ENERGY;
  ORB_TRY(align_guessed(ctx, shapes, shape_count, g, options, twice, out, held));
  if (!*held || twice || (out->energy <= POOR_ENERGY && options->preset != ORB_PRESET_QUALITY)) {
    return ORB_OK;
  }
  orb_status status = align_guessed(ctx, shapes, shape_count, g, options, 1, &other, &again);
  if (status != ORB_OK) {
    orb_alignment_free(ctx, out);
    *held = 0;
  } else if (again) {
    (void)keep_better(ctx, out, &other);
  }
  return status;
}

/* From the guesses. *held 0: they are no better than the rotation search or the energy that is reached already, or
 * cannot be met, and `out` is empty. */
static orb_status try_guesses(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                              const orb_align_options *options, double reached, double *clear, orb_alignment *out,
                              int *held) {
  guesses g = {0};
  orb_status status;
  *held = 0;
  ORB_GO(status, guess_all(ctx, shapes, shape_count, &g), end);
  *clear = g.clear;
  if (g.count >= 3 && g.energy < reached) {
    ORB_GO(status, align_guessed_best(ctx, shapes, shape_count, &g, options, reached, out, held), end);
  }
end:
  orb_free(ctx, g.of);
  orb_free(ctx, g.vertex);
  return status;
}

/* A rotated alignment that space alone has not made near to isometric: guesses take its place, or, where it is not good
 * either, it is composed to the end. */
static orb_status improve(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                          const orb_align_options *options, orb_alignment *alignment, double *clear) {
  orb_alignment other;
  int held;
  ORB_TRY(try_guesses(ctx, shapes, shape_count, options, alignment->energy, clear, &other, &held));
  int taken = held && keep_better(ctx, alignment, &other);
  if (!taken && options->preset != ORB_PRESET_QUALITY && alignment->energy > ORB_MAP_GOOD_ENERGY) {
    return orb_compose_all(ctx, alignment, ORB_MAP_SPACE_DONE, options->preset);
  }
  return ORB_OK;
}

orb_status orb_align_auto(orb_context *ctx, const orb_align_shape *shapes, int32_t shape_count,
                          const orb_align_options *options, orb_alignment *out) {
  orb_status status;
  orb_align_options rotated = *options;
  double clear = 1;
  rotated.preset = ORB_PRESET_FAST;
  ORB_TRY(orb_align_given(ctx, shapes, shape_count, NULL, 0, &rotated, out));
  if (options->preset != ORB_PRESET_FAST) {
    orb_map_from from = options->preset == ORB_PRESET_QUALITY ? ORB_MAP_FROM_SPACE : ORB_MAP_SPACE_ONLY;
    ORB_GO(status, orb_compose_all(ctx, out, from, options->preset), failed);
    if (out->energy > NEAR_ISOMETRY) {
      ORB_GO(status, improve(ctx, shapes, shape_count, options, out, &clear), failed);
    }
  }
  ORB_GO(status, orb_align_find(ctx, out, clear), failed);
  return ORB_OK;
failed:
  orb_alignment_free(ctx, out);
  return status;
}
