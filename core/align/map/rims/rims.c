#include "align/map/rims/rims.h"

#include <math.h>
#include <string.h>

#include "align/map/compose.h"
#include "align/map/engine/params.h"
#include "align/map/rims/along.h"
#include "align/sheet/copies.h"
#include "align/sheet/landmarks.h"
#include "align/sheet/sheet.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Most points of the rims of a shape. More lie so close together that some hold the others. The copy of a large shape
 * keeps its points and their neighbours, so it gets fewer. A rim gets at least as many as show its form. */
enum { MOST_POINTS = 1200, MOST_POINTS_OF_LARGE = 256, LEAST_POINTS_A_RIM = 16 };

/* Points that one vertex may be beside: one more than those of an edge of the rim. */
enum { MOST_BESIDE = 3 };

/* The base and a later shape, with points of their rims as vertices beside the landmarks of the alignment. */
typedef struct rim_job {
  orb_context *ctx;
  orb_preset preset;
  const orb_map_params *params;
  int holds_landmarks;  /* those of the alignment meet, and stay together */
  int32_t count, given; /* landmarks: first `given` that the alignment holds, then points */
  orb_landmark *landmarks;
  orb_place *at;           /* 2 each */
  int32_t *pins[2];        /* room for vertices that are pinned */
  orb_map_springs springs; /* room for all */
  orb_aligned_shape fixed, moving;
  int32_t *first, *second; /* the landmarks' vertices of these */
  int is_large;            /* a copy is composed in the place of `moving` */
  orb_copies copies;
  orb_aligned_shape copy;
  int32_t *of_copy;    /* the landmarks' vertices of it */
  double given_energy; /* of the alignment */
  double energy;       /* of the last map; INFINITY: none yet */
} rim_job;

static void job_free(rim_job *job) {
  orb_context *ctx = job->ctx;
  orb_free(ctx, job->landmarks);
  orb_free(ctx, job->at);
  orb_free(ctx, job->first);
  orb_free(ctx, job->second);
  orb_free(ctx, job->of_copy);
  orb_free(ctx, job->pins[0]);
  orb_free(ctx, job->pins[1]);
  orb_free(ctx, job->springs.moving);
  orb_free(ctx, job->springs.fixed);
  orb_free(ctx, job->springs.weight);
  orb_copies_free(ctx, &job->copies);
  job->fixed.landmark_vertices = job->moving.landmark_vertices = job->copy.landmark_vertices = NULL; /* borrowed */
  orb_aligned_shape_free(ctx, &job->fixed);
  orb_aligned_shape_free(ctx, &job->moving);
  orb_aligned_shape_free(ctx, &job->copy);
}

static orb_status reserve(rim_job *job, size_t most) {
  orb_context *ctx = job->ctx;
  job->landmarks = ORB_NEW0(ctx, orb_landmark, most);
  job->at = ORB_NEW(ctx, orb_place, 2 * most);
  job->of_copy = ORB_NEW(ctx, int32_t, most);
  job->pins[0] = ORB_NEW(ctx, int32_t, most);
  job->pins[1] = ORB_NEW(ctx, int32_t, most);
  job->springs =
      (orb_map_springs){0, ORB_NEW(ctx, int32_t, most), ORB_NEW(ctx, int32_t, most), ORB_NEW(ctx, double, most)};
  return job->of_copy && job->landmarks && job->at && job->pins[0] && job->pins[1] && job->springs.moving &&
                 job->springs.fixed && job->springs.weight
             ? ORB_OK
             : ORB_E_NO_MEMORY;
}

/* The landmarks that the alignment holds, and the points. */
static orb_status gather_landmarks(rim_job *job, const orb_alignment *a, int32_t s, const orb_rim_points *points) {
  const orb_aligned_shape *shapes[2] = {&a->shapes[0], &a->shapes[s]};
  ORB_TRY(reserve(job, (size_t)a->landmark_count + (size_t)points->count));
  for (int32_t l = 0; job->holds_landmarks && l < a->landmark_count; l++) {
    orb_place *at = job->at + 2 * (size_t)job->count;
    const int32_t first = shapes[0]->landmark_vertices[l], second = shapes[1]->landmark_vertices[l];
    if (first >= 0 && second >= 0) {
      ORB_TRY(orb_place_of_vertex(job->ctx, &shapes[0]->mesh, first, &at[0]));
      ORB_TRY(orb_place_of_vertex(job->ctx, &shapes[1]->mesh, second, &at[1]));
      job->count++;
    }
  }
  job->given = job->count;
  memcpy(job->at + 2 * (size_t)job->count, points->at, 2 * (size_t)points->count * sizeof *points->at);
  job->count += points->count;
  for (int32_t l = 0; l < job->count; l++) {
    job->landmarks[l].at = job->at + 2 * (size_t)l;
    job->landmarks[l].weight = 1;
  }
  return ORB_OK;
}

/* Splits an edge unless it is part of a rim. */
static orb_status split_inner(orb_context *ctx, orb_sheet *sheet, int32_t h) {
  const int32_t *source = sheet->shape.mesh.source_triangle;
  int32_t middle;
  return (source[h / 3] == ORB_MADE_FILL) == (source[sheet->twin[h] / 3] == ORB_MADE_FILL)
             ? orb_sheet_split_edge(ctx, sheet, h, 0.5, &middle)
             : ORB_OK;
}

/* Splits the edges between landmarks, but for those along a rim: a triangle of three vertices that are held has no way
 * to follow where its rim bends the other way. Then those between landmarks and vertices beside several of them, which
 * would have to see all of these from one place. */
static orb_status split_beside(const rim_job *job, orb_sheet *sheet) {
  const orb_mesh *mesh = &sheet->shape.mesh;
  const int32_t count = mesh->vertex_count;
  unsigned char *held = ORB_NEW0(job->ctx, unsigned char, count);
  int32_t *beside = ORB_NEW0(job->ctx, int32_t, count);
  orb_status status = held && beside ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t l = 0; l < job->count && status == ORB_OK; l++) {
    held[sheet->shape.landmark_vertices[l]] = 1;
  }
  for (int32_t h = 0; h < 3 * mesh->triangle_count && status == ORB_OK; h++) {
    const int32_t a = mesh->triangles[h], b = mesh->triangles[orb_next(h)];
    if (a < count && b < count && held[a] && held[b] && h < sheet->twin[h]) {
      status = split_inner(job->ctx, sheet, h);
    }
  }
  for (int32_t h = 0; h < 3 * mesh->triangle_count && status == ORB_OK; h++) {
    const int32_t a = mesh->triangles[h], b = mesh->triangles[orb_next(h)];
    if (a < count && b < count && held[a] && !held[b]) {
      beside[b]++;
    }
  }
  for (int32_t h = 0; h < 3 * mesh->triangle_count && status == ORB_OK; h++) {
    const int32_t a = mesh->triangles[h], b = mesh->triangles[orb_next(h)];
    if (a < count && b < count && held[a] && !held[b] && beside[b] > MOST_BESIDE) {
      status = split_inner(job->ctx, sheet, h);
    }
  }
  orb_free(job->ctx, held);
  orb_free(job->ctx, beside);
  return status;
}

/* A copy of a shape with the landmarks as vertices, which *vertices takes over. moves: it is composed. */
static orb_status insert(const rim_job *job, const orb_align_shape *shape, const orb_landmark *landmarks, int32_t side,
                         int moves, orb_aligned_shape *out, int32_t **vertices) {
  orb_sheet sheet;
  orb_status status;
  ORB_GO(status, orb_sheet_create(job->ctx, shape->mesh, shape->points, &sheet), end);
  ORB_GO(status, orb_sheet_insert_landmarks(job->ctx, &sheet, landmarks, job->count, side), end);
  if (moves) {
    ORB_GO(status, split_beside(job, &sheet), end);
  }
  orb_sheet_release(job->ctx, &sheet, out);
  *vertices = out->landmark_vertices;
  out->landmark_vertices = NULL;
end:
  orb_sheet_free(job->ctx, &sheet);
  return status;
}

/* The base with the landmarks as vertices. *fine 0: its sphere has no room. */
static orb_status open_first(rim_job *job, const orb_align_shape *shape, int *fine) {
  const orb_mesh *mesh = &job->fixed.mesh;
  ORB_TRY(insert(job, shape, job->landmarks, 0, 0, &job->fixed, &job->first));
  ORB_TRY(orb_certify(job->ctx, job->fixed.points, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                      &job->fixed.certificate));
  *fine = job->fixed.certificate.valid;
  return ORB_OK;
}

/* The vertices beside the landmarks of the shape that is composed. A copy keeps them: without them, it has triangles of
 * three points. The caller frees *out. */
static orb_status find_ring(const rim_job *job, int32_t **out, int32_t *count) {
  const orb_mesh *mesh = &job->moving.mesh;
  unsigned char *held = ORB_NEW0(job->ctx, unsigned char, mesh->vertex_count);
  *out = ORB_NEW(job->ctx, int32_t, mesh->vertex_count);
  *count = 0;
  orb_status status = held && *out ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t l = 0; l < job->count && status == ORB_OK; l++) {
    held[job->second[l]] = 1;
  }
  for (int32_t h = 0; h < 3 * mesh->triangle_count && status == ORB_OK; h++) {
    const int32_t v = mesh->triangles[h], w = mesh->triangles[orb_next(h)];
    if (held[v] == 1 && !held[w]) {
      held[w] = 2;
      (*out)[(*count)++] = w;
    }
  }
  orb_free(job->ctx, held);
  return status;
}

/* The vertex at which a place lies. */
static int32_t vertex_at(const orb_mesh *mesh, const orb_place *place) {
  for (int k = 0; k < 3; k++) {
    if (place->at[k] == 1) {
      return mesh->triangles[3 * (size_t)place->triangle + (size_t)k];
    }
  }
  ORB_ASSERT(0 && "landmarks of copies are vertices");
}

/* Copies `moving`, with its landmarks and the vertices beside them. */
static orb_status open_copy(rim_job *job) {
  orb_context *ctx = job->ctx;
  const orb_align_shape shapes[2] = {{&job->fixed.mesh, job->fixed.points}, {&job->moving.mesh, job->moving.points}};
  int32_t *ring = NULL, beside = 0;
  orb_landmark *kept = NULL;
  orb_place *at = NULL;
  orb_sheet sheet = {0};
  orb_status status;
  ORB_GO(status, find_ring(job, &ring, &beside), end);
  const int32_t count = job->count + beside, keep_until = orb_map_keep_until(job->params, count);
  const int32_t size = orb_map_copy_size(job->params, keep_until);
  kept = ORB_NEW0(ctx, orb_landmark, count);
  at = ORB_NEW0(ctx, orb_place, 2 * (size_t)count);
  status = kept && at ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t l = 0; l < count && status == ORB_OK; l++) {
    kept[l].at = at + 2 * (size_t)l;
    status = orb_place_of_vertex(ctx, &job->moving.mesh, l < job->count ? job->second[l] : ring[l - job->count],
                                 &at[2 * (size_t)l + 1]);
  }
  if (status == ORB_OK) {
    status = orb_copies_create(ctx, shapes, 2, kept, count, size, keep_until, &job->copies);
  }
  if (status != ORB_OK) {
    goto end;
  }
  ORB_GO(status, orb_sheet_create(ctx, job->copies.shapes[1].mesh, job->copies.shapes[1].points, &sheet), end);
  orb_sheet_release(ctx, &sheet, &job->copy);
  for (int32_t i = 0; i < job->copy.mesh.vertex_count; i++) { /* where the alignment has it */
    const size_t v = (size_t)job->copies.of[1].copy.vertex[i];
    memcpy(job->copy.points + 3 * (size_t)i, job->moving.points + 3 * v, sizeof(double[3]));
  }
  for (int32_t l = 0; l < job->count; l++) {
    job->of_copy[l] = vertex_at(&job->copy.mesh, &job->copies.landmarks[l].at[1]);
  }
end:
  orb_sheet_free(ctx, &sheet);
  orb_free(ctx, ring);
  orb_free(ctx, kept);
  orb_free(ctx, at);
  return status;
}

/* Makes the shapes that are composed. *fine 0: the spheres have no room. */
static orb_status open_shapes(rim_job *job, const orb_align_shape shapes[2], int *fine) {
  ORB_TRY(open_first(job, &shapes[0], fine));
  ORB_TRY(insert(job, &shapes[1], job->landmarks, 1, 1, &job->moving, &job->second));
  return job->is_large ? open_copy(job) : ORB_OK;
}

/* What holds the landmarks together. */
typedef enum rim_hold {
  SPRINGS, /* those of the alignment are pinned, and springs draw the points of the rims together */
  PINS     /* all are pinned */
} rim_hold;

/* Composes from the map as it is. second: the landmarks' vertices of `moving`. *improved 0: there is no such map, and
 * nothing has changed. */
static orb_status compose(rim_job *job, orb_aligned_shape *moving, const int32_t *second, rim_hold how,
                          double stiffness, orb_map_guide guide, int *improved) {
  double energies[2];
  int32_t pins = 0;
  job->springs.count = 0;
  for (int32_t l = 0; l < job->count; l++) {
    if (how == PINS || l < job->given) {
      job->pins[0][pins] = job->first[l];
      job->pins[1][pins++] = second[l];
    } else {
      job->springs.fixed[job->springs.count] = job->first[l];
      job->springs.moving[job->springs.count] = second[l];
      job->springs.weight[job->springs.count++] = stiffness;
    }
  }
  guide.springs = job->springs;
  guide.keeps_angles = 1;
  job->fixed.landmark_vertices = job->pins[0];
  moving->landmark_vertices = job->pins[1];
  ORB_TRY(orb_compose(job->ctx, &job->fixed, moving, 0, pins, &guide, job->preset, energies, improved));
  job->energy = *improved ? energies[1] : job->energy;
  return ORB_OK;
}

/* Are the points near to the rims of the first shape? */
static orb_status have_met(const rim_job *job, const orb_rim_side *first, int *met) {
  const orb_mesh *mesh = &job->fixed.mesh;
  orb_locator *locator = NULL;
  int32_t near = 0;
  orb_status status = ORB_OK;
  ORB_TRY(orb_locator_create(job->ctx, job->fixed.points, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                             NULL, &locator));
  for (int32_t l = 0; l < job->count; l++) {
    orb_place place;
    double p[3];
    orb_locate(locator, job->moving.points + 3 * (size_t)job->second[l], -1, &place);
    orb_place_position(mesh, &place, p);
    double least = INFINITY;
    ORB_GO(status, orb_context_check(job->ctx), done);
    for (int32_t i = 0; i < first->holes.count && least > job->params->rims.met * first->diagonal; i++) {
      double distance;
      (void)orb_rim_nearest(first, &first->holes.of[i], p, &distance);
      least = fmin(least, distance);
    }
    near += least <= job->params->rims.met * first->diagonal;
  }
  *met = near >= job->params->rims.met_share * job->count;
done:
  orb_locator_destroy(job->ctx, locator);
  return status;
}

/* Lets the whole shape follow its copy. */
static orb_status lift(rim_job *job, rim_hold how, double stiffness) {
  orb_copied_shape *one = &job->copies.of[1];
  const orb_map_guide guide = {
      .from = ORB_MAP_FROM_COPY,
      .copy = {one->copy.mesh.vertex_count, one->copy.vertex, job->copy.points, &one->hierarchy, 0}};
  int improved;
  ORB_TRY(compose(job, &job->moving, job->second, how, stiffness, guide, &improved));
  job->energy = improved ? job->energy : INFINITY;
  return ORB_OK;
}

/* Brings the rims together: springs draw the points to their partners, and where they are nearly together, all are
 * pinned. */
static orb_status bring_together(rim_job *job, const orb_rim_side *first) {
  orb_aligned_shape *moving = job->is_large ? &job->copy : &job->moving;
  const int32_t *second = job->is_large ? job->of_copy : job->second;
  const orb_map_guide draw = {.from = ORB_MAP_FROM_SPRINGS}, ease = {.from = ORB_MAP_FROM_PINS};
  int drawn, pinned = 0, eased;
  const orb_map_params *params = job->params;
  double stiffness = 0;
  for (size_t i = 0; i < sizeof params->rims.stiffness / sizeof stiffness && !pinned; i++) {
    stiffness = params->rims.stiffness[i];
    ORB_TRY(compose(job, moving, second, SPRINGS, stiffness, draw, &drawn));
    ORB_TRY(compose(job, moving, second, PINS, 0, draw, &pinned));
  }
  if (pinned) {
    ORB_TRY(compose(job, moving, second, PINS, 0, ease, &eased));
  }
  if (job->is_large && job->energy < INFINITY) {
    ORB_TRY(lift(job, pinned ? PINS : SPRINGS, stiffness));
  }
  const double more = pinned ? params->rims.paid_more : params->rims.paid_less;
  int met =
      job->energy <= params->rims.worst && job->energy - 1 <= params->rims.paid_times * (job->given_energy - 1) + more;
  if (met && !pinned) {
    ORB_TRY(have_met(job, first, &met));
  }
  job->energy = met ? job->energy : INFINITY;
  return ORB_OK;
}

static orb_status run(rim_job *job, orb_alignment *a, int32_t s, const orb_rim_side *first,
                      const orb_rim_points *points) {
  const orb_align_shape shapes[2] = {{&a->shapes[0].mesh, a->shapes[0].points},
                                     {&a->shapes[s].mesh, a->shapes[s].points}};
  int fine;
  ORB_TRY(orb_compose_energy(job->ctx, &a->shapes[0], &a->shapes[s], job->preset, &job->given_energy));
  ORB_TRY(gather_landmarks(job, a, s, points));
  ORB_TRY(open_shapes(job, shapes, &fine));
  return fine ? bring_together(job, first) : ORB_OK;
}

/* Puts a refined shape in the place of the one that it refines. */
static void take(orb_context *ctx, orb_aligned_shape *fresh, orb_aligned_shape *shape) {
  for (int32_t t = 0; t < fresh->mesh.triangle_count; t++) {
    fresh->parent[t] = shape->parent[fresh->parent[t]];
  }
  fresh->landmark_vertices = shape->landmark_vertices; /* vertices keep their numbers */
  shape->landmark_vertices = NULL;
  orb_aligned_shape_free(ctx, shape);
  *shape = *fresh;
  memset(fresh, 0, sizeof *fresh);
}

/* Composes the map to a shape with these points held. *met 0: there is no such map, for example because the spheres
 * have no room for the points, and nothing has changed. */
static orb_status hold(orb_context *ctx, const orb_align_options *options, const orb_map_params *params,
                       orb_alignment *a, int32_t s, const orb_rim_side *first, const orb_rim_points *points,
                       double *energy, int *met) {
  rim_job job = {.ctx = ctx,
                 .preset = options->preset,
                 .params = params,
                 .holds_landmarks = options->method != ORB_ALIGN_ROTATE,
                 .is_large = a->shapes[s].mesh.vertex_count > params->copies.large,
                 .energy = INFINITY};
  orb_status status = run(&job, a, s, first, points);
  *met = status == ORB_OK && job.energy < INFINITY;
  if (*met) {
    *energy = job.energy;
    take(ctx, &job.fixed, &a->shapes[0]);
    take(ctx, &job.moving, &a->shapes[s]);
  }
  job_free(&job);
  return orb_alignment_lacks_room(ctx, status) ? ORB_OK : status;
}

/* Notes the pairs in the alignment. */
static orb_status note(orb_context *ctx, const orb_rim_side sides[2], const orb_rim_pair *pairs, int32_t count,
                       int32_t s, orb_alignment *out) {
  orb_rim_match *rims = orb_realloc(ctx, out->rims, (size_t)out->rim_count + (size_t)count, sizeof *rims);
  if (!rims) {
    return ORB_E_NO_MEMORY;
  }
  out->rims = rims;
  for (int32_t i = 0; i < count; i++) {
    orb_rim_match *one = &rims[out->rim_count++];
    *one = (orb_rim_match){.shape = s};
    for (int k = 0; k < 2; k++) {
      const orb_hole *hole = &sides[k].holes.of[pairs[i].hole[k]];
      one->hole[k] = pairs[i].hole[k];
      one->edges[k] = hole->edges;
      one->length_relative[k] = hole->length / sides[k].diagonal;
    }
  }
  return ORB_OK;
}

/* How far the rims of the last `count` matches are apart. */
static orb_status measure(orb_context *ctx, orb_alignment *a, int32_t s, int32_t count) {
  orb_rim_side sides[2];
  orb_status status;
  ORB_GO(status, orb_rim_sides_create(ctx, &a->shapes[0], &a->shapes[s], sides), done);
  for (int32_t i = a->rim_count - count; i < a->rim_count; i++) {
    const orb_hole *first = &sides[0].holes.of[a->rims[i].hole[0]], *second = &sides[1].holes.of[a->rims[i].hole[1]];
    for (int32_t k = 0; k < first->count; k++) {
      double distance;
      (void)orb_rim_nearest(&sides[1], second, sides[0].image + 3 * (size_t)(first->start + k), &distance);
      a->rims[i].off_relative = fmax(a->rims[i].off_relative, distance / sides[1].diagonal);
    }
  }
done:
  orb_rim_sides_free(ctx, sides);
  return status;
}

/* Matches the holes of shape s with those of the first shape. *energy changes with the map. */
static orb_status match_shape(orb_context *ctx, const orb_align_options *options, orb_alignment *a, int32_t s,
                              double *energy) {
  orb_rim_side sides[2];
  orb_rim_pair *pairs = NULL;
  orb_rim_points points = {0};
  const orb_map_params params = orb_map_params_of(options->preset);
  const int is_large = a->shapes[s].mesh.vertex_count > params.copies.large;
  int32_t count = 0;
  int met = 0;
  orb_status status;
  ORB_GO(status, orb_rim_sides_create(ctx, &a->shapes[0], &a->shapes[s], sides), done);
  ORB_GO(status, orb_rims_pair(ctx, &params, sides, &pairs, &count), done);
  for (int32_t i = 0; i < count; i++) {
    const int32_t share = (is_large ? MOST_POINTS_OF_LARGE : MOST_POINTS) / count;
    ORB_GO(status,
           orb_rims_along(ctx, &params, sides, &pairs[i], share > LEAST_POINTS_A_RIM ? share : LEAST_POINTS_A_RIM,
                          &points),
           done);
  }
  if (count > 0) {
    ORB_GO(status, note(ctx, sides, pairs, count, s, a), done);
    ORB_GO(status, hold(ctx, options, &params, a, s, &sides[0], &points, energy, &met), done);
    a->rim_count -= met ? 0 : count;
    status = met ? measure(ctx, a, s, count) : ORB_OK;
  }
done:
  orb_rim_sides_free(ctx, sides);
  orb_free(ctx, pairs);
  orb_rim_points_free(ctx, &points);
  return status;
}

orb_status orb_align_rims(orb_context *ctx, const orb_align_options *options, orb_alignment *out) {
  double sum = 0;
  int any = 0;
  for (int32_t s = 1; s < out->shape_count; s++) {
    any |= orb_has_holes(&out->shapes[s].mesh);
  }
  if (!any || !orb_has_holes(&out->shapes[0].mesh)) {
    return ORB_OK;
  }
  for (int32_t s = 1; s < out->shape_count; s++) {
    double energy = NAN;
    if (orb_has_holes(&out->shapes[s].mesh)) {
      ORB_TRY(match_shape(ctx, options, out, s, &energy));
    }
    if (isnan(energy)) {
      ORB_TRY(orb_compose_energy(ctx, &out->shapes[0], &out->shapes[s], options->preset, &energy));
    }
    sum += energy;
  }
  if (out->rim_count > 0) {
    out->energy = sum / (out->shape_count - 1);
  }
  return ORB_OK;
}
