/* The JSON of landmarks and places. */
#ifndef ORB_API_LANDMARK_CODEC_H
#define ORB_API_LANDMARK_CODEC_H

#include "api/ids.h"
#include "api/json.h"
#include "api/problem.h"
#include "api/text.h"
#include "orbmorph/mesh.h"

enum { API_SHAPES_MAX = 16, API_LANDMARKS_MAX = 1024 };

typedef enum api_place_kind { API_PLACE_VERTEX, API_PLACE_POINT, API_PLACE_TRIANGLE } api_place_kind;

/* A place as a request names it: a vertex or triangle of the file, or a point in space. */
typedef struct api_place {
  api_place_kind kind;
  int32_t index; /* vertex or triangle number of the file */
  double at[3];  /* the point, or barycentric coordinates (≥ 0, sum 1) */
} api_place;

typedef struct api_landmark_spec {
  char name[ORB_NAME_MAX];
  int32_t pass;
  double radius, confidence, weight;
} api_landmark_spec;

typedef struct api_landmark_list {
  int32_t count, shape_count;
  api_landmark_spec *items; /* malloc'ed */
  api_place *spots;         /* count × shape_count */
} api_landmark_list;

/* Reads a `landmarks` array, or an object with that member (a landmark file). Returns 1, or 0 with *problem filled. The
 * caller frees *out in either case. shape_count: 0 takes the number of places of the first landmark. */
int api_landmarks_read(const cJSON *value, int32_t shape_count, api_landmark_list *out, api_problem *problem);

void api_landmarks_free(api_landmark_list *list);

/* Appends the member "weight" of a soft landmark; of others, nothing. */
void api_landmark_weight_write(const api_landmark_spec *spec, api_text *out);

/* Appends the canonical array, which reads back as the same list. */
void api_landmarks_write(const api_landmark_list *list, api_text *out);

/* The id of a list: the SHA-256 of its canonical array. Returns 1, or 0 if memory runs out. */
int api_landmarks_id(const api_landmark_list *list, char id[API_ID_SIZE]);
/* Appends the resource: id, url, count, shapes, created, and last `landmarks`, so that a list of resources can leave
 * them out. */
void api_landmarks_describe(const char *id, const api_landmark_list *list, int64_t created, api_text *out);

/* Appends {"vertex":i}, {"point":[…]} or {"triangle":t,"barycentric":[…]}. */
void api_place_write(api_text *out, const api_place *spot);

#endif
