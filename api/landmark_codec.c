/* Reads the landmarks of a request or a landmark file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/landmark_codec.h"
#include "api/options.h"

static int refuse(api_problem *problem, int32_t landmark, int32_t shape, const char *why) {
  if (shape >= 0) {
    api_refuse(problem, "bad-landmarks", "Landmark %d, shape %d: %s.", landmark, shape, why);
  } else {
    api_refuse(problem, "bad-landmarks", "Landmark %d: %s.", landmark, why);
  }
  api_json_key(&problem->facts, "landmarks");
  api_json_open(&problem->facts, '[');
  api_json_integer(&problem->facts, landmark);
  api_json_close(&problem->facts, ']');
  if (shape >= 0) {
    api_json_member_integer(&problem->facts, "shape", shape);
  }
  return 0;
}

static int read_triple(const cJSON *value, double out[3]) {
  if (!cJSON_IsArray(value) || cJSON_GetArraySize(value) != 3) {
    return 0;
  }
  const cJSON *item = value->child;
  for (int k = 0; k < 3; k++, item = item->next) {
    if (!cJSON_IsNumber(item)) {
      return 0;
    }
    out[k] = item->valuedouble == 0 ? 0 : item->valuedouble;
  }
  return 1;
}

static int read_index(const cJSON *value, int32_t *out) {
  double x = value->valuedouble;
  if (!cJSON_IsNumber(value) || x < 0 || x > INT32_MAX || x != floor(x)) {
    return 0;
  }
  *out = (int32_t)x;
  return 1;
}

/* The sum of scaled coordinates differs from 1 by this at most: rounding of three quotients and two sums. */
static const double ROUNDING = 1e-15;

/* The sum of barycentric coordinates may differ from 1 by 1e-6; they are stored scaled to a sum of 1. Those that are
 * scaled already stay as they are: a request that is read back keeps its id. */
static const char *read_barycentric(const cJSON *value, double out[3]) {
  if (!read_triple(value, out)) {
    return "\"barycentric\" must be three numbers";
  }
  double sum = out[0] + out[1] + out[2];
  if (out[0] < 0 || out[1] < 0 || out[2] < 0 || !(fabs(sum - 1) <= 1e-6)) {
    return "barycentric coordinates must not be negative and must add up to 1";
  }
  for (int k = 0; k < 3 && fabs(sum - 1) > ROUNDING; k++) {
    out[k] /= sum;
  }
  return NULL;
}

/* Returns NULL, or why the place is not valid. */
static const char *read_spot(const cJSON *value, api_place *out) {
  const cJSON *vertex = cJSON_GetObjectItemCaseSensitive(value, "vertex");
  const cJSON *point = cJSON_GetObjectItemCaseSensitive(value, "point");
  const cJSON *triangle = cJSON_GetObjectItemCaseSensitive(value, "triangle");
  if (!cJSON_IsObject(value) || !!vertex + !!point + !!triangle != 1) {
    return "a place must be one of {\"vertex\":i}, {\"point\":[x,y,z]}, {\"triangle\":t,\"barycentric\":[a,b,c]}";
  }
  if (vertex) {
    out->kind = API_PLACE_VERTEX;
    return read_index(vertex, &out->index) ? NULL : "\"vertex\" must be a vertex number of the file, from 0";
  }
  if (point) {
    out->kind = API_PLACE_POINT;
    return read_triple(point, out->at) ? NULL : "\"point\" must be three numbers";
  }
  out->kind = API_PLACE_TRIANGLE;
  if (!read_index(triangle, &out->index)) {
    return "\"triangle\" must be a triangle number of the file, from 0";
  }
  return read_barycentric(cJSON_GetObjectItemCaseSensitive(value, "barycentric"), out->at);
}

static int read_places(const cJSON *at, int32_t landmark, api_landmark_list *list, api_problem *problem) {
  static const char *const known[] = {"vertex", "point", "triangle", "barycentric", NULL};
  if (!cJSON_IsArray(at) || cJSON_GetArraySize(at) != list->shape_count) {
    char why[100];
    snprintf(why, sizeof why, "\"at\" must list one place for each of the %d shapes", list->shape_count);
    return refuse(problem, landmark, -1, why);
  }
  int32_t shape = 0;
  for (const cJSON *place = at->child; place; place = place->next, shape++) {
    if (cJSON_IsObject(place) && !api_members_known(place, "a landmark's place", known, problem)) {
      return 0;
    }
    const char *why = read_spot(place, &list->spots[(size_t)landmark * (size_t)list->shape_count + (size_t)shape]);
    if (why) {
      return refuse(problem, landmark, shape, why);
    }
  }
  return 1;
}

#define LEAST_WEIGHT 0.01 /* a softer spring has no visible effect */
#define AT(field) offsetof(api_landmark_spec, field)
static const api_option numbers[] = {{"pass", API_OPTION_INT32, AT(pass), 0, 100, NULL},
                                     {"radius", API_OPTION_NUMBER, AT(radius), 0, 2, NULL},
                                     {"confidence", API_OPTION_NUMBER, AT(confidence), 0, 1, NULL},
                                     {"weight", API_OPTION_NUMBER, AT(weight), LEAST_WEIGHT, 1, NULL}};
enum { NUMBERS = sizeof numbers / sizeof *numbers };

static int read_landmark(const cJSON *value, int32_t index, api_landmark_list *list, api_problem *problem) {
  static const char *const known[] = {"name", "at", "pass", "radius", "confidence", "weight", NULL};
  api_landmark_spec *spec = &list->items[index];
  spec->confidence = spec->weight = 1;
  snprintf(spec->name, sizeof spec->name, "landmark %d", index);
  if (!cJSON_IsObject(value)) {
    return refuse(problem, index, -1, "a landmark must be an object with \"at\"");
  }
  if (!api_members_known(value, "a landmark", known, problem)) {
    return 0;
  }
  const cJSON *name = cJSON_GetObjectItemCaseSensitive(value, "name");
  if (name && (!cJSON_IsString(name) || strlen(name->valuestring) >= ORB_NAME_MAX)) {
    return refuse(problem, index, -1, "\"name\" must be a string of at most 127 bytes");
  }
  if (name) {
    snprintf(spec->name, sizeof spec->name, "%s", name->valuestring);
  }
  for (size_t k = 0; k < NUMBERS; k++) {
    cJSON *given = cJSON_GetObjectItemCaseSensitive(value, numbers[k].name);
    if (given) {
      cJSON one = *given, only = {.child = &one, .type = cJSON_Object};
      one.next = NULL;
      if (!api_options_read(&only, "a landmark", numbers, NUMBERS, spec, problem)) {
        return 0;
      }
    }
  }
  return read_places(cJSON_GetObjectItemCaseSensitive(value, "at"), index, list, problem);
}

int api_landmarks_read(const cJSON *value, int32_t shape_count, api_landmark_list *out, api_problem *problem) {
  memset(out, 0, sizeof *out);
  if (cJSON_IsObject(value)) {
    value = cJSON_GetObjectItemCaseSensitive(value, "landmarks");
  }
  if (cJSON_IsString(value) && strcmp(value->valuestring, "auto") == 0) {
    return 1;
  }
  if (!cJSON_IsArray(value)) {
    return api_refuse(problem, "bad-landmarks", "\"landmarks\" must be an array, or \"auto\".");
  }
  int count = cJSON_GetArraySize(value);
  if (count > API_LANDMARKS_MAX) {
    return api_refuse(problem, "bad-landmarks", "The request has %d landmarks. Send at most %d.", count,
                      API_LANDMARKS_MAX);
  }
  if (shape_count == 0 && count > 0) {
    shape_count = cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(value->child, "at"));
  }
  out->shape_count = shape_count;
  if (count == 0) {
    return 1;
  }
  out->items = calloc((size_t)count, sizeof *out->items);
  out->spots = calloc((size_t)count * (size_t)(shape_count > 0 ? shape_count : 1), sizeof *out->spots);
  if (!out->items || !out->spots) {
    return api_refuse(problem, "no-memory", "The server has no memory left. Try again later.");
  }
  for (const cJSON *item = value->child; item; item = item->next, out->count++) {
    if (!read_landmark(item, out->count, out, problem)) {
      return 0;
    }
  }
  return 1;
}

void api_landmarks_free(api_landmark_list *list) {
  free(list->items);
  free(list->spots);
  memset(list, 0, sizeof *list);
}

static void write_triple(api_text *out, const char *name, const double v[3]) {
  api_json_key(out, name);
  api_json_open(out, '[');
  for (int k = 0; k < 3; k++) {
    api_json_number(out, v[k]);
  }
  api_json_close(out, ']');
}

void api_place_write(api_text *out, const api_place *spot) {
  api_json_open(out, '{');
  if (spot->kind == API_PLACE_POINT) {
    write_triple(out, "point", spot->at);
  } else {
    api_json_member_integer(out, spot->kind == API_PLACE_VERTEX ? "vertex" : "triangle", spot->index);
    if (spot->kind == API_PLACE_TRIANGLE) {
      write_triple(out, "barycentric", spot->at);
    }
  }
  api_json_close(out, '}');
}

void api_landmark_weight_write(const api_landmark_spec *spec, api_text *out) {
  if (spec->weight < 1) {
    api_json_member_number(out, "weight", spec->weight);
  }
}

void api_landmarks_write(const api_landmark_list *list, api_text *out) {
  api_json_open(out, '[');
  for (int32_t l = 0; l < list->count; l++) {
    const api_landmark_spec *spec = &list->items[l];
    api_json_open(out, '{');
    api_json_member_string(out, "name", spec->name);
    api_json_key(out, "at");
    api_json_open(out, '[');
    for (int32_t s = 0; s < list->shape_count; s++) {
      api_place_write(out, &list->spots[(size_t)l * (size_t)list->shape_count + (size_t)s]);
    }
    api_json_close(out, ']');
    api_json_member_integer(out, "pass", spec->pass);
    api_json_member_number(out, "radius", spec->radius);
    api_json_member_number(out, "confidence", spec->confidence);
    api_landmark_weight_write(spec, out);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

int api_landmarks_id(const api_landmark_list *list, char id[API_ID_SIZE]) {
  api_text text = {0};
  api_landmarks_write(list, &text);
  int fine = !text.failed;
  if (fine) {
    api_id_of_text(text.data, text.size, id);
  }
  api_text_free(&text);
  return fine;
}

void api_landmarks_describe(const char *id, const api_landmark_list *list, int64_t created, api_text *out) {
  api_json_open(out, '{');
  api_json_member_string(out, "id", id);
  api_json_key(out, "url");
  api_text_printf(out, "\"/v1/landmarks/%s\"", id);
  api_json_member_integer(out, "count", list->count);
  api_json_member_integer(out, "shapes", list->shape_count);
  api_json_member_instant(out, "created", created);
  api_json_key(out, "landmarks");
  api_landmarks_write(list, out);
  api_json_close(out, '}');
}
