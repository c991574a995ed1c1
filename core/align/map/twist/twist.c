/* Finds twisted limbs, and undoes a twist.
 *
 * A map can be nearly isometric and yet carry the end of a limb to the limb's other side: a twist by half a turn that
 * is spread over a tube costs little energy, no landmark at the tip forbids it, and descent does not undo it, since it
 * is a minimum. Halfway through the morph the tube then collapses. Around every vertex of the fixed shape the map
 * rotates space; where that rotation is far from the one of the whole shape, a limb may be twisted. Such a part is
 * grown towards its root and cut into rings (bands.c, limb.c). The rotation of each ring against the ring before it,
 * around the axis between their centres, is summed up from the root. If the sum is a twist, each ring is rotated back
 * by the sum up to it. A limb that is only posed differently has no such sum.
 *
 * Where landmarks hold both ends of a tube, such as elbow and hand, the map can only wind it by whole turns. The part
 * that is rotated is then a ring between both ends. What lies beyond keeps its place, and the ring's own rings are
 * rotated back by whole turns. No motion of the tube with both ends at rest leads there, so this is one step. A limb
 * that is posed differently is rotated as a whole, landmarks and all; such rings are looked for relative to the
 * rotation at each of these landmarks too.
 */
#include "align/map/twist/twist.h"

#include <math.h>
#include <string.h>

#include "align/map/twist/limb.h"
#include "align/map/twist/patch.h"
#include "base/check.h"
#include "base/memory.h"

static const double GROWTH_VERTICES = 1e4; /* vertices of a surface for which params.twist.growth counts rings */

typedef struct twist_run {
  orb_context *ctx;
  const orb_map_params *params;
  const orb_map_surface *b;
  double *back;            /* where each vertex of the surface comes from, 3 each */
  double *rotation;        /* of the surroundings of each vertex, 9 each */
  double whole[9];         /* rotation of the whole shape */
  const double *reference; /* the rotation that parts are compared with: that of the whole, or at a held vertex */
  double *height;          /* in the current limb */
  orb_map_patch patch;
  unsigned char *held, *taken; /* taken: in or next to an earlier limb */
} twist_run;

/* Is a vertex of the rim held, or one of another limb? */
static int is_blocked(const twist_run *run) {
  const orb_map_patch *patch = &run->patch;
  for (int32_t k = 0; k < patch->rim_count; k++) {
    if (run->held[patch->rim[k]] || run->taken[patch->rim[k]]) {
      return 1;
    }
  }
  return 0;
}

/* Adds rings to the flags inside until they widen, or a held vertex or another limb is in the way. */
static orb_status add_rings(twist_run *run) {
  orb_map_patch *patch = &run->patch;
  double narrowest = INFINITY;
  int rings = (int)(run->params->twist.growth * sqrt(fmax(1, run->b->vertex_count / GROWTH_VERTICES)));
  orb_map_patch_find_rim(patch);
  for (int i = 0; i < rings && patch->rim_count > 0; i++) {
    double length = orb_map_patch_dilate(patch);
    narrowest = fmin(narrowest, length);
    if (is_blocked(run) || length > run->params->twist.wider * narrowest) {
      break;
    }
    for (int32_t k = 0; k < patch->rim_count; k++) {
      patch->inside[patch->rim[k]] = ORB_PATCH_LIMB;
    }
    ORB_TRY(orb_context_check(run->ctx));
  }
  return ORB_OK;
}

/* Grows the part towards its root. */
static orb_status grow(twist_run *run) {
  ORB_TRY(add_rings(run));
  return orb_map_patch_fill(&run->patch, ORB_PATCH_LIMB);
}

/* Is what lies beyond the part in one piece? */
static int end_is_whole(orb_map_patch *patch) {
  int32_t piece = -1;
  orb_map_patch_join(patch, patch->inside, ORB_PATCH_END);
  for (int32_t v = 0; v < patch->b->vertex_count; v++) {
    if (patch->inside[v] == ORB_PATCH_END) {
      if (piece >= 0 && patch->joined[v] != piece) {
        return 0;
      }
      piece = patch->joined[v];
    }
  }
  return piece >= 0;
}

/* Grows the part towards its end, which stays in one piece. */
static orb_status grow_into_end(twist_run *run) {
  orb_map_patch *patch = &run->patch;
  const int32_t n = run->b->vertex_count;
  unsigned char *before = ORB_NEW(run->ctx, unsigned char, n);
  if (!before) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(before, patch->inside, (size_t)n);
  for (int32_t v = 0; v < n; v++) {
    patch->inside[v] = before[v] != ORB_PATCH_END;
  }
  const orb_status status = add_rings(run);
  for (int32_t v = 0; v < n; v++) {
    patch->inside[v] = (unsigned char)(!before[v] ? 0 : patch->inside[v] ? ORB_PATCH_LIMB : ORB_PATCH_END);
  }
  if (status == ORB_OK && !end_is_whole(patch)) {
    memcpy(patch->inside, before, (size_t)n);
  }
  orb_free(run->ctx, before);
  return status;
}

/* The pole: the held vertex inside, else the vertex deepest inside. */
static int32_t find_pole(twist_run *run) {
  const orb_map_surface *b = run->b;
  unsigned char *next = run->patch.next;
  int32_t pole = -1;
  for (int32_t v = 0; v < b->vertex_count; v++) {
    if (run->patch.inside[v] && run->held[v]) {
      return v;
    }
  }
  memcpy(next, run->patch.inside, (size_t)b->vertex_count);
  for (int32_t left = 1; left > 0;) { /* peel it, rim by rim */
    left = 0;
    for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
      if (next[b->triangles[h]] == 1 && !next[b->triangles[orb_next(h)]]) {
        next[b->triangles[h]] = 2;
      }
    }
    for (int32_t v = 0; v < b->vertex_count; v++) {
      pole = next[v] && !left ? v : pole;
      left += next[v] == 1;
      next[v] = next[v] == 1;
    }
  }
  return pole;
}

/* The height of a place on its limb. 0: it is on none. A triangle beyond the end of a limb may have corners at it. */
static double height_of(const orb_map_twists *twists, const int32_t *v, const orb_place *place, int32_t *limb) {
  double height = 0;
  int reaches = 0, leaves = 0;
  *limb = -1;
  for (int k = 0; k < 3; k++) {
    height += place->at[k] * twists->height[v[k]];
    *limb = twists->of[v[k]] > *limb ? twists->of[v[k]] : *limb;
  }
  for (int k = 0; k < 3; k++) {
    reaches |= twists->of[v[k]] == *limb && twists->height[v[k]] == 1;
    leaves |= twists->of[v[k]] != *limb;
  }
  return *limb < 0 || (reaches && leaves) ? 0 : height;
}

int orb_map_twists_undo(const orb_map_twists *twists, const orb_map_surface *b, double share, int unwinds,
                        orb_place *place) {
  int32_t limb;
  const double height = height_of(twists, b->triangles + 3 * (size_t)place->triangle, place, &limb);
  if (!(height > 0)) {
    return 0;
  }
  const orb_map_twist *t = &twists->limb[limb];
  const int is_wound = t->pole < 0;
  if (t->count < 2 || (is_wound && !unwinds)) {
    return 0;
  }
  int k = 1;
  while (k < t->count - 1 && t->height[k] < height) {
    k++;
  }
  double gap = t->height[k] - t->height[k - 1], f = gap > 0 ? (height - t->height[k - 1]) / gap : 1;
  double angle = t->angle[k - 1] + fmin(1, fmax(0, f)) * (t->angle[k] - t->angle[k - 1]);
  return orb_map_limb_rotate(b, twists->height, is_wound ? -angle : -share * angle, place);
}

/* Scales the angles of a limb whose end stays to whole turns at the end. The limb counts as not twisted if they are
 * none, if they are not clear, or if bands are too few to count them. */
static void settle_turns(const orb_map_params *params, orb_map_twist *limb) {
  const double total = limb->count > 0 ? limb->angle[limb->count - 1] : 0, turns = rint(total / (2 * M_PI));
  int counted = turns != 0 && fabs(total - 2 * M_PI * turns) < params->twist.unclear;
  for (int k = 1; k < limb->count; k++) {
    counted = counted && fabs(limb->angle[k] - limb->angle[k - 1]) < params->twist.step;
  }
  for (int k = 1; k < limb->count && counted; k++) {
    limb->angle[k] *= 2 * M_PI * turns / total;
  }
  limb->count = counted ? limb->count : 0;
}

/* Gives the vertices of the current limb their limb and height. Limbs stay apart: its neighbours, and on the side of
 * its end theirs, are closed to other limbs. What lies beyond is not. */
static void add_places(twist_run *run, orb_map_twists *out) {
  const orb_map_surface *b = run->b;
  orb_map_patch *patch = &run->patch;
  orb_map_patch_find_rim(patch);
  (void)orb_map_patch_dilate(patch);
  for (int32_t v = 0; v < b->vertex_count; v++) {
    if (patch->inside[v] == ORB_PATCH_LIMB || patch->reached[v]) {
      out->of[v] = out->count;
      out->height[v] = run->height[v];
    }
    run->taken[v] |= patch->inside[v] == ORB_PATCH_END ? patch->reached[v] : patch->next[v];
  }
  for (int32_t h = 0; h < 3 * b->triangle_count; h++) {
    run->taken[b->triangles[orb_next(h)]] |= patch->reached[b->triangles[h]];
  }
}

/* Adds the current limb to the list if it is twisted. */
static orb_status add_limb(twist_run *run, int32_t pole, orb_map_twists *out) {
  orb_map_patch *patch = &run->patch;
  orb_map_twist limb = {.pole = pole};
  ORB_TRY(orb_map_limb_heights(run->ctx, run->params, run->b, patch->inside, run->height));
  ORB_TRY(orb_map_bands_measure(run->params, patch, run->height, run->back, &limb));
  if (pole < 0) {
    settle_turns(run->params, &limb);
  }
  for (int k = 1; k < limb.count; k++) {
    limb.most = fmax(limb.most, fabs(limb.angle[k]));
  }
  if (limb.most < run->params->twist.twisted) {
    return ORB_OK;
  }
  add_places(run, out);
  out->limb[out->count++] = limb;
  return ORB_OK;
}

/* Does the limb lie on another one? */
static int is_taken(const twist_run *run) {
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    if ((run->patch.inside[v] == ORB_PATCH_LIMB || run->patch.reached[v]) && run->taken[v]) {
      return 1;
    }
  }
  return 0;
}

/* Would the limb move a held vertex? */
static int is_held(const twist_run *run) {
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    if (run->patch.inside[v] == ORB_PATCH_LIMB && run->held[v]) {
      return 1;
    }
  }
  return 0;
}

/* A limb with a free end. */
static orb_status examine_tip(twist_run *run, orb_map_twists *out) {
  unsigned char *inside = run->patch.inside;
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    inside[v] = inside[v] ? ORB_PATCH_LIMB : 0;
  }
  const int32_t pole = find_pole(run);
  ORB_TRY(grow(run));
  inside[pole] = ORB_PATCH_END;
  orb_map_patch_reach(&run->patch);
  return is_taken(run) ? ORB_OK : add_limb(run, pole, out);
}

/* A limb whose end is held. What lies beyond the part but has no held vertex is of the limb. */
static orb_status examine_tube(twist_run *run, orb_map_twists *out) {
  orb_map_patch *patch = &run->patch;
  const int32_t n = run->b->vertex_count;
  int32_t end = -1;
  orb_map_patch_join(patch, patch->inside, ORB_PATCH_END);
  for (int32_t v = 0; v < n; v++) {
    if (patch->inside[v] == ORB_PATCH_END && run->held[v]) {
      if (end >= 0 && patch->joined[v] != end) {
        return ORB_OK; /* several ends, such as those of the fingers: it is no tube */
      }
      end = patch->joined[v];
    }
  }
  for (int32_t v = 0; v < n; v++) {
    patch->inside[v] = patch->inside[v] == ORB_PATCH_END && patch->joined[v] != end ? ORB_PATCH_LIMB : patch->inside[v];
  }
  ORB_TRY(grow(run));
  ORB_TRY(grow_into_end(run));
  orb_map_patch_reach(patch);
  return is_taken(run) || is_held(run) ? ORB_OK : add_limb(run, -1, out);
}

/* Examines the piece that vertex `seed` represents. */
static orb_status examine(twist_run *run, const int32_t *piece, int32_t seed, orb_map_twists *out) {
  orb_map_patch *patch = &run->patch;
  const int against_whole = run->reference == run->whole;
  int32_t held_within = 0, held_beyond = 0;
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    patch->inside[v] = piece[v] == seed ? ORB_PATCH_LIMB : 0;
    held_within += patch->inside[v] && run->held[v];
  }
  ORB_TRY(orb_context_check(run->ctx));
  if (held_within > against_whole) { /* a tip may have one */
    return ORB_OK;
  }
  ORB_TRY(orb_map_patch_fill(patch, ORB_PATCH_END));
  for (int32_t v = 0; v < run->b->vertex_count; v++) {
    held_beyond += patch->inside[v] == ORB_PATCH_END && run->held[v];
  }
  const double share = orb_map_patch_share(patch);
  if (share < run->params->twist.smallest) {
    return ORB_OK;
  }
  if (against_whole && held_within + held_beyond <= 1) {
    return share <= run->params->twist.largest ? examine_tip(run, out) : ORB_OK;
  }
  const int is_tube = held_within == 0 && held_beyond > 0 && share <= run->params->twist.largest_tube;
  return is_tube ? examine_tube(run, out) : ORB_OK;
}

static double rotated(const twist_run *run, int32_t v) {
  return orb_map_rotations_angle(run->rotation + 9 * (size_t)v, run->reference);
}

/* Examines the pieces of the surface that are rotated against the reference, the largest first. */
static orb_status examine_all(twist_run *run, orb_map_twists *out) {
  orb_map_patch *patch = &run->patch;
  int32_t n = run->b->vertex_count;
  int32_t *count = ORB_NEW0(run->ctx, int32_t, n), *piece = ORB_NEW(run->ctx, int32_t, n);
  orb_status status = count && piece ? ORB_OK : ORB_E_NO_MEMORY;
  if (status != ORB_OK) {
    goto done;
  }
  for (int32_t v = 0; v < n; v++) {
    patch->inside[v] = rotated(run, v) > run->params->twist.rotated;
  }
  orb_map_patch_join(patch, patch->inside, 1);
  memcpy(piece, patch->joined, (size_t)n * sizeof *piece);
  for (int32_t v = 0; v < n; v++) {
    count[piece[v]] += patch->inside[v];
  }
  for (int i = 0; i < ORB_MAP_LIMBS && out->count < ORB_MAP_LIMBS; i++) {
    int32_t best = 0;
    for (int32_t v = 0; v < n; v++) {
      best = count[v] > count[best] ? v : best;
    }
    if (count[best] < run->params->twist.band_vertices * run->params->twist.bands) {
      break;
    }
    count[best] = 0;
    ORB_GO(status, examine(run, piece, best, out), done);
  }
done:
  orb_free(run->ctx, count);
  orb_free(run->ctx, piece);
  return status;
}

/* Is this rotation near one that pieces have been compared with? */
static int is_known(const twist_run *run, const double *rotation, const double *const *known, int count) {
  for (int i = 0; i < count; i++) {
    if (orb_map_rotations_angle(rotation, known[i]) < run->params->twist.alike) {
      return 1;
    }
  }
  return 0;
}

/* Examines what is rotated against the whole, then what is so against posed parts with held vertices. */
static orb_status examine_from(twist_run *run, const int32_t *held, int32_t held_count, orb_map_twists *out) {
  const double *known[ORB_MAP_LIMBS];
  int count = 0;
  run->reference = run->whole;
  ORB_TRY(examine_all(run, out));
  for (int32_t i = 0; i < held_count && count < ORB_MAP_LIMBS; i++) {
    const double *at = run->rotation + 9 * (size_t)held[i];
    if (orb_map_rotations_angle(at, run->whole) > run->params->twist.rotated && !is_known(run, at, known, count)) {
      run->reference = known[count++] = at;
      ORB_TRY(examine_all(run, out));
    }
  }
  return ORB_OK;
}

void orb_map_twists_free(orb_context *ctx, orb_map_twists *twists) {
  orb_free(ctx, twists->of);
  orb_free(ctx, twists->height);
  memset(twists, 0, sizeof *twists);
}

orb_status orb_map_twists_find(orb_context *ctx, const orb_map_params *params, const orb_map_surface *b,
                               const orb_map_image *map, const int32_t *held, int32_t held_count, orb_map_twists *out) {
  size_t n = (size_t)b->vertex_count;
  twist_run run = {.ctx = ctx, .params = params, .b = b, .patch = {.ctx = ctx}};
  orb_status status = ORB_E_NO_MEMORY;
  memset(out, 0, sizeof *out);
  out->of = ORB_NEW(ctx, int32_t, n);
  out->height = ORB_NEW0(ctx, double, n);
  run.back = ORB_NEW(ctx, double, 3 * n);
  run.rotation = ORB_NEW(ctx, double, 9 * n);
  run.height = ORB_NEW(ctx, double, n);
  run.held = ORB_NEW0(ctx, unsigned char, n);
  run.taken = ORB_NEW0(ctx, unsigned char, n);
  if (!out->of || !out->height || !run.back || !run.rotation || !run.height || !run.held || !run.taken) {
    goto done;
  }
  ORB_GO(status, orb_map_patch_create(ctx, b, &run.patch), done);
  for (size_t v = 0; v < n; v++) {
    out->of[v] = -1;
  }
  for (int32_t i = 0; i < held_count; i++) {
    run.held[held[i]] = 1;
  }
  ORB_GO(status, orb_map_rotations_measure(ctx, b, map, run.back, run.rotation, run.whole, &out->kept), done);
  status = examine_from(&run, held, held_count, out);
done:
  orb_free(ctx, run.back);
  orb_free(ctx, run.rotation);
  orb_free(ctx, run.height);
  orb_free(ctx, run.held);
  orb_free(ctx, run.taken);
  orb_map_patch_free(&run.patch);
  if (status != ORB_OK) {
    orb_map_twists_free(ctx, out);
  }
  return status;
}
