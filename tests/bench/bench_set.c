/* Reads and embeds the shapes of one merge and places their landmarks. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "bench.h"

static int read_landmarks(const char *path, bench_set *set) {
  unsigned char *bytes;
  size_t size;
  api_json_error where;
  api_problem problem = {0};
  if (!bench_slurp(path, &bytes, &size)) {
    return 0;
  }
  cJSON *value = api_json_parse((const char *)bytes, size, &where);
  free(bytes);
  if (!value) {
    fprintf(stderr, "%s: malformed-json: %s at byte %zu\n", path, where.why ? where.why : "out of memory",
            where.offset);
    return 0;
  }
  int fine = api_landmarks_read(value, set->count, &set->list, &problem);
  if (!fine) {
    fprintf(stderr, "%s: %s: %s\n", path, problem.name, problem.detail);
  }
  api_problem_free(&problem);
  cJSON_Delete(value);
  return fine;
}

static int place_landmarks(orb_context *ctx, bench_set *set) {
  size_t shapes = (size_t)set->count;
  set->landmarks = orb_alloc(ctx, (size_t)set->list.count, sizeof *set->landmarks);
  set->places = orb_alloc(ctx, (size_t)set->list.count * shapes, sizeof *set->places);
  if (!set->landmarks || !set->places) {
    return 0;
  }
  memset(set->landmarks, 0, (size_t)set->list.count * sizeof *set->landmarks);
  for (int32_t s = 0; s < set->count; s++) {
    orb_nearest *tree = NULL;
    for (int32_t l = 0; l < set->list.count; l++) {
      const char *why;
      size_t at = (size_t)l * shapes + (size_t)s;
      if (!bench_place(ctx, &set->mesh[s], &set->list.spots[at], &tree, &set->places[at], &why)) {
        fprintf(stderr, "%s: bad-landmarks: landmark %d (\"%s\"): %s\n", set->name[s], l, set->list.items[l].name, why);
        orb_nearest_destroy(ctx, tree);
        return 0;
      }
    }
    orb_nearest_destroy(ctx, tree);
  }
  for (int32_t l = 0; l < set->list.count; l++) {
    const api_landmark_spec *spec = &set->list.items[l];
    orb_landmark *mark = &set->landmarks[l];
    snprintf(mark->name, sizeof mark->name, "%s", spec->name);
    mark->at = set->places + (size_t)l * shapes;
    mark->pass = spec->pass;
    mark->radius = spec->radius;
    mark->confidence = spec->confidence;
  }
  return 1;
}

int bench_set_load(orb_context *ctx, const bench_options *options, bench_set *set) {
  if (options->landmarks && !read_landmarks(options->landmarks, set)) {
    return 0;
  }
  for (int32_t s = 0; s < set->count; s++) {
    const char *path = options->files[s];
    if (!bench_load(ctx, path, options->repair, 1, &set->mesh[s])) {
      return 0;
    }
    set->name[s] = set->mesh[s].name;
    set->read += set->mesh[s].read_seconds + set->mesh[s].check_seconds;
    double start = orb_clock();
    if (orb_embed(ctx, &set->mesh[s].mesh, &options->embed, &set->embedding[s]) != ORB_OK) {
      bench_complain(path, ctx);
      return 0;
    }
    set->embed += orb_clock() - start;
    set->shape[s] = (orb_align_shape){.mesh = &set->mesh[s].mesh, .points = set->embedding[s].points};
  }
  return !options->landmarks || place_landmarks(ctx, set);
}

void bench_set_free(orb_context *ctx, bench_set *set) {
  for (int32_t s = 0; s < set->count; s++) {
    orb_embedding_free(ctx, &set->embedding[s]);
    bench_unload(ctx, &set->mesh[s]);
  }
  orb_free(ctx, set->landmarks);
  orb_free(ctx, set->places);
  api_landmarks_free(&set->list);
}
