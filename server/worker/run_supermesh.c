#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/json.h"
#include "store/alignments.h"
#include "store/spheres.h"
#include "worker/places.h"
#include "worker/run.h"

/* The inputs of a merge; memory of the context. */
typedef struct merge_input {
  api_supermesh_request request;
  orb_mesh meshes[API_SHAPES_MAX];
  int32_t *corners[API_SHAPES_MAX]; /* see run_load_mesh() */
  run_file files[API_SHAPES_MAX];   /* the first one for the method template; those that "transfer" names */
  orb_shape_file shape_files[API_SHAPES_MAX];
  double *points[API_SHAPES_MAX];
  orb_align_shape shapes[API_SHAPES_MAX];
  const char *names[API_SHAPES_MAX];
  const char *nodes[API_PARTS_MAX];
  orb_landmark *landmarks;
  orb_place *places;
  file_triangle *noted; /* landmark-major, as the spots */
  int gone;             /* an embedding has been deleted */
} merge_input;

static void free_input(orb_context *ctx, merge_input *in) {
  for (int32_t s = 0; s < in->request.shape_count; s++) {
    orb_mesh_free(ctx, &in->meshes[s]);
    orb_free(ctx, in->corners[s]);
    orb_free(ctx, in->points[s]);
    orb_mesh_free(ctx, &in->files[s].mesh);
    orb_free(ctx, in->files[s].bytes);
  }
  orb_free(ctx, in->landmarks);
  orb_free(ctx, in->places);
  orb_free(ctx, in->noted);
  api_supermesh_request_free(&in->request);
}

static int read_request(const run_job *j, api_supermesh_request *request, api_problem *problem) {
  api_json_error error;
  cJSON *body = api_json_parse(j->request, strlen(j->request), &error);
  int fine =
      body ? api_supermesh_request_read(body, request, problem)
           : api_refuse(problem, "corrupt", "The stored request of the job cannot be read: send the request again.");
  cJSON_Delete(body);
  return fine;
}

static int refuse_landmark(const merge_input *in, int32_t l, int32_t s, const char *why, api_problem *problem) {
  const api_place *spot = &in->request.landmarks.spots[(size_t)l * (size_t)in->request.shape_count + (size_t)s];
  api_refuse(problem, "bad-landmarks", "Landmark %d (\"%.60s\"), shape %d (\"%.60s\"), %s %d: %s.", l,
             in->request.landmarks.items[l].name, s, in->names[s],
             spot->kind == API_PLACE_TRIANGLE ? "triangle" : "vertex", spot->index, why);
  api_text_printf(&problem->facts, "\"landmarks\":[%d],\"shape\":%d,\"reason\":\"dropped\"", l, s);
  return 0;
}

/* Computes the places of all landmarks on one shape. */
static int place_all(orb_context *ctx, merge_input *in, int32_t s, api_problem *problem) {
  const api_landmark_list *list = &in->request.landmarks;
  orb_nearest *tree = NULL;
  int fine = 1;
  for (int32_t l = 0; l < list->count && fine; l++) {
    size_t at = (size_t)l * (size_t)list->shape_count + (size_t)s;
    const char *why = NULL;
    fine = run_place(ctx, &in->meshes[s], &list->spots[at], &in->noted[at], &tree, &in->places[at], &why);
    if (!fine && why) {
      refuse_landmark(in, l, s, why, problem);
    }
  }
  orb_nearest_destroy(ctx, tree);
  return fine;
}

/* What to load of the file of a shape besides its repaired mesh; NULL: nothing. */
static run_file *wanted_file(merge_input *in, int32_t s) {
  int wanted = in->files[s].wants_mesh = s == 0 && in->request.merge.remesh.method == ORB_REMESH_TEMPLATE;
  for (int32_t i = 0; i < in->request.carry_count; i++) {
    wanted |= in->request.carries[i].from == s;
  }
  return wanted ? &in->files[s] : NULL;
}

static int load_shape(const run_env *env, orb_context *ctx, merge_input *in, int32_t s, api_problem *problem) {
  const api_landmark_list *list = &in->request.landmarks;
  api_embedding_request wanted = {.options = in->request.embedding};
  char embedding[API_ID_SIZE];
  memcpy(wanted.mesh, in->request.shapes[s].mesh, sizeof wanted.mesh);
  if (!api_embedding_request_id(&wanted, embedding)) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  file_triangle *noted = orb_alloc(ctx, (size_t)list->count, sizeof *noted);
  if (!noted) {
    return 0;
  }
  for (int32_t l = 0; l < list->count; l++) {
    const api_place *spot = &list->spots[(size_t)l * (size_t)list->shape_count + (size_t)s];
    noted[l].index = spot->kind == API_PLACE_TRIANGLE ? spot->index : -1;
  }
  run_file *file = wanted_file(in, s);
  int fine = run_load_mesh(env, ctx, wanted.mesh, &in->meshes[s], noted, list->count, &in->corners[s], file, problem);
  if (file && file->wants_mesh) {
    in->request.merge.file = &file->mesh;
    in->request.merge.file_bytes = file->bytes;
    in->request.merge.file_size = file->size;
  }
  if (file) {
    in->shape_files[s] = (orb_shape_file){in->corners[s], file->bytes, file->size};
  }
  for (int32_t l = 0; fine && l < list->count; l++) {
    in->noted[(size_t)l * (size_t)list->shape_count + (size_t)s] = noted[l];
  }
  orb_free(ctx, noted);
  if (fine && !run_load_points(env, ctx, embedding, &in->meshes[s], &in->points[s], problem)) {
    resource known = {0};
    in->gone = run_get(env, RESOURCE_EMBEDDING, embedding, &known) == STORE_NOT_FOUND;
    resource_free(&known);
    fine = 0;
  }
  in->shapes[s] = (orb_align_shape){.mesh = &in->meshes[s], .points = in->points[s]};
  return fine && place_all(ctx, in, s, problem);
}

static int load_input(const run_env *env, orb_context *ctx, merge_input *in, api_problem *problem) {
  const api_landmark_list *list = &in->request.landmarks;
  size_t places = (size_t)list->count * (size_t)in->request.shape_count;
  in->landmarks = orb_alloc(ctx, (size_t)list->count, sizeof *in->landmarks);
  in->places = orb_alloc(ctx, places, sizeof *in->places);
  in->noted = orb_alloc(ctx, places, sizeof *in->noted);
  if (!in->landmarks || !in->places || !in->noted) {
    return 0;
  }
  memset(in->landmarks, 0, (size_t)list->count * sizeof *in->landmarks);
  in->request.merge.carries = in->request.carries;
  in->request.merge.carry_count = in->request.carry_count;
  in->request.merge.files = in->shape_files;
  api_supermesh_request_parts(&in->request, in->nodes, &in->request.merge.file_parts);
  for (int32_t s = 0; s < in->request.shape_count; s++) {
    in->names[s] = in->request.shapes[s].name;
    progress_report(env->progress, "read", (double)s / (double)in->request.shape_count);
    if (!load_shape(env, ctx, in, s, problem)) {
      return 0;
    }
  }
  for (int32_t l = 0; l < list->count; l++) {
    memcpy(in->landmarks[l].name, list->items[l].name, ORB_NAME_MAX);
    in->landmarks[l].at = in->places + (size_t)l * (size_t)list->shape_count;
    in->landmarks[l].pass = list->items[l].pass;
    in->landmarks[l].radius = list->items[l].radius;
    in->landmarks[l].confidence = list->items[l].confidence;
    in->landmarks[l].weight = list->items[l].weight;
  }
  return 1;
}

static int store_places(const run_env *env, const orb_buffer *places, resource *result, api_problem *problem) {
  api_id_of_text((const char *)places->data, places->size, result->places);
  store_result stored = objects_put(env->store, OBJECT_PLACES, result->id, places->data, places->size);
  result->bytes += (int64_t)places->size;
  return stored == STORE_OK || task_refuse_store(stored, problem);
}

/* places: that are stored in the same object; NULL: they are one. */
static int store_spheres(const run_env *env, orb_context *ctx, const orb_merge_result *merged, const orb_buffer *places,
                         resource *result, api_problem *problem) {
  int64_t bytes = 0;
  orb_status status;
  store_result stored = spheres_put(env->store, ctx, result->id, &merged->alignment, places, &bytes, &status);
  result->bytes += bytes;
  if (stored != STORE_OK && status == ORB_OK) {
    task_refuse_store(stored, problem);
  }
  return stored == STORE_OK;
}

/* Like the asset, stored before the row: a supermesh with a row has all its objects. A bucket gets places and spheres
 * as one object, since each object costs a request. */
static int store_places_and_spheres(const run_env *env, orb_context *ctx, const merge_input *in,
                                    const orb_merge_result *merged, resource *result, api_problem *problem) {
  const int joins = objects_go_to_bucket(env->store);
  orb_buffer places = {0};
  int fine = places_write(ctx, in->meshes, in->corners, merged, &places) == ORB_OK;
  if (fine && joins) {
    strcpy(result->places, RESOURCE_PLACES_JOINED);
  }
  fine = fine && (joins || store_places(env, &places, result, problem)) &&
         store_spheres(env, ctx, merged, joins ? &places : NULL, result, problem);
  orb_buffer_free(ctx, &places);
  return fine;
}

/* A place in the form in which a request names it: by a triangle of the file, or as a point if a repair added the
 * triangle. */
static void write_spot(const merge_input *in, size_t shape, const orb_place *place, api_place *out) {
  orb_place file;
  orb_place_in_file(&in->meshes[shape], in->corners[shape], place, &file);
  out->kind = file.triangle >= 0 ? API_PLACE_TRIANGLE : API_PLACE_POINT;
  out->index = file.triangle;
  memcpy(out->at, file.at, sizeof file.at);
  if (file.triangle < 0) {
    orb_place_position(&in->meshes[shape], place, out->at);
  }
}

/* Places of the found landmarks. NULL if out of memory. */
static api_place *found_spots(orb_context *ctx, const merge_input *in, const orb_merge_result *merged) {
  size_t shapes = (size_t)in->request.shape_count, count = (size_t)merged->alignment.found_count * shapes;
  api_place *spots = orb_alloc(ctx, count, sizeof *spots);
  for (size_t i = 0; spots && i < count; i++) {
    write_spot(in, i % shapes, &merged->alignment.found[i], &spots[i]);
  }
  return spots;
}

/* Places of all alternatives, one after the other. NULL if out of memory. */
static api_place *other_spots(orb_context *ctx, const merge_input *in, const orb_alignment *alignment) {
  const size_t shapes = (size_t)in->request.shape_count, most = ORB_ALTERNATIVES_MAX * ORB_ALTERNATIVE_PAIRS * shapes;
  api_place *spots = orb_alloc(ctx, most, sizeof *spots), *next = spots;
  for (int32_t a = 0; spots && a < alignment->alternative_count; a++) {
    const orb_alternative *one = &alignment->alternatives[a];
    for (size_t i = 0; i < (size_t)one->count * shapes; i++) {
      write_spot(in, i % shapes, &one->at[i], next++);
    }
  }
  return spots;
}

/* Where the suspects would lie. NULL if out of memory. */
static api_place *meant_spots(orb_context *ctx, const merge_input *in, const orb_alignment *alignment) {
  api_place *spots = orb_alloc(ctx, ORB_SUSPECTS_MAX, sizeof *spots);
  for (int32_t i = 0; spots && i < alignment->suspect_count; i++) {
    write_spot(in, (size_t)alignment->suspects[i].shape, &alignment->suspects[i].at, &spots[i]);
  }
  return spots;
}

static int store_result_of(const run_env *env, orb_context *ctx, const run_job *j, const merge_input *in,
                           const orb_merge_result *merged, resource *result, api_problem *problem) {
  api_text json = {0};
  api_id_of_text((const char *)merged->asset.data, merged->asset.size, result->sha);
  result->kind = RESOURCE_SUPERMESH;
  result->bytes = (int64_t)merged->asset.size;
  result->created = (int64_t)time(NULL) * 1000;
  memcpy(result->id, j->key, sizeof result->id);
  store_result stored = objects_put(env->store, OBJECT_ASSET, result->id, merged->asset.data, merged->asset.size);
  if (stored != STORE_OK) {
    task_refuse_store(stored, problem);
    return 0;
  }
  if (!store_places_and_spheres(env, ctx, in, merged, result, problem)) {
    return 0;
  }
  api_place *found = found_spots(ctx, in, merged), *others = other_spots(ctx, in, &merged->alignment);
  api_place *meant = meant_spots(ctx, in, &merged->alignment);
  const int complete = found && others && meant;
  if (complete) {
    api_supermesh_write(result->id, &in->request, merged, found, others, meant, j->embed_ms, result->created, &json);
  }
  orb_free(ctx, found);
  orb_free(ctx, others);
  orb_free(ctx, meant);
  if (!complete) {
    return 0;
  }
  if (json.failed) {
    api_text_free(&json);
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  result->json = json.data;
  return 1;
}

/* Aligns again, from the alignment that the request names. If that is gone, the job fails: the same request gives the
 * same result, whatever is kept. */
static int align_again(const run_env *env, orb_context *ctx, const merge_input *in, orb_alignment *out,
                       api_problem *problem) {
  const api_supermesh_request *request = &in->request;
  resource row = {0};
  orb_alignment start = {0};
  const int kept = run_get(env, RESOURCE_ALIGNMENT, request->start, &row) == STORE_OK &&
                   alignments_get(env->cat, env->store, ctx, &row, in->shapes, request->shape_count, &start);
  resource_free(&row);
  const orb_status why = orb_context_error(ctx)->status;
  if (!kept && why != ORB_OK && why != ORB_E_BAD_OPTION) { /* no memory, or cancelled */
    return 0;
  }
  if (!kept) {
    api_refuse(
        problem, "bad-option",
        "The alignment that \"align.start\" names is no longer kept, or is of other shapes. Leave \"start\" out: "
        "the shapes are then aligned anew.");
    api_json_member_string(&problem->facts, "member", "start");
    return 0;
  }
  const orb_status status = orb_align_again(ctx, in->shapes, request->shape_count, in->landmarks,
                                            request->landmarks.count, &request->merge.align, &start, out);
  orb_alignment_free(ctx, &start);
  return status == ORB_OK;
}

/* Takes the kept alignment, or computes one and keeps it. *seconds: how long computing took, 0 if it was kept. */
static int align_shapes(const run_env *env, orb_context *ctx, const merge_input *in, orb_alignment *out,
                        double *seconds, api_problem *problem) {
  const api_supermesh_request *request = &in->request;
  char id[API_ID_SIZE];
  const int named = api_alignment_id(request, id);
  progress_report(env->progress, "align", 0);
  *seconds = 0;
  resource row = {0};
  if (named && run_get(env, RESOURCE_ALIGNMENT, id, &row) == STORE_OK) {
    int kept = alignments_get(env->cat, env->store, ctx, &row, in->shapes, request->shape_count, out);
    resource_free(&row);
    if (kept) {
      return 1;
    }
  }
  const double began = orb_clock();
  if (request->start[0]) {
    if (!align_again(env, ctx, in, out, problem)) {
      return 0;
    }
  } else if (orb_align(ctx, in->shapes, request->shape_count, in->landmarks, request->landmarks.count,
                       &request->merge.align, out) != ORB_OK) {
    return 0;
  }
  *seconds = orb_clock() - began;
  if (named) {
    alignments_put(env->cat, env->store, ctx, id, env->tenant, in->shapes, out);
  }
  return 1;
}

static int merge(const run_env *env, orb_context *ctx, const merge_input *in, orb_merge_result *out,
                 api_problem *problem) {
  orb_alignment alignment;
  double seconds;
  if (orb_merge_check(ctx, in->shapes, in->request.shape_count, &in->request.merge) != ORB_OK ||
      !align_shapes(env, ctx, in, &alignment, &seconds, problem) ||
      orb_merge_aligned(ctx, in->shapes, in->names, in->request.shape_count, in->landmarks, &alignment,
                        &in->request.merge, out) != ORB_OK) {
    return 0;
  }
  out->timings.align = seconds;
  out->timings.total += seconds;
  return 1;
}

int run_supermesh(const run_env *env, orb_context *ctx, const run_job *j, run_output *out, api_problem *problem) {
  resource known = {0};
  orb_merge_result merged;
  if (run_get(env, RESOURCE_SUPERMESH, j->key, &known) == STORE_OK) {
    resource_free(&known); /* of an earlier attempt or another owner */
    return 1;
  }
  merge_input *in = calloc(1, sizeof *in);
  if (!in) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  memset(&merged, 0, sizeof merged);
  int fine = read_request(j, &in->request, problem) && load_input(env, ctx, in, problem) &&
             merge(env, ctx, in, &merged, problem);
  if (fine) {
    for (int32_t s = 0; s < in->request.shape_count; s++) {
      out->flips += merged.alignment.shapes[s].certificate.flipped;
    }
    progress_report(env->progress, "store", 0);
    objects_hold(env->store);
    out->holds = 1;
    fine = store_result_of(env, ctx, j, in, &merged, &out->row, problem);
  }
  out->gone = in->gone;
  orb_merge_result_free(ctx, &merged);
  free_input(ctx, in);
  free(in);
  return fine;
}
