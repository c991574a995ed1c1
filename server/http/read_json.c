#include "http/read_json.h"

#include "http/body.h"
#include "trim.h"

static pthread_mutex_t large = PTHREAD_MUTEX_INITIALIZER;
/* Of the task that this thread runs: the values of its large texts, and whether it holds the lock. */
static _Thread_local struct {
  size_t values;
  int holds;
} mine;

/* Waits until no other task reads a large text. 0 with the problem. */
static int enter(const char *text, size_t size, api_problem *problem) {
  if (size <= JSON_LARGE) {
    return 1;
  }
  mine.values += api_json_count(text, size); /* 0: malformed, and so no values are made */
  if (mine.values > JSON_VALUES_MOST) {
    api_refuse(problem, "too-large",
               "The body, with the landmarks that it names, has more than %d values of JSON. Send a smaller one.",
               JSON_VALUES_MOST);
    api_json_member_integer(&problem->facts, "limit", JSON_VALUES_MOST);
    return 0;
  }
  if (!mine.holds) {
    pthread_mutex_lock(&large);
    mine.holds = 1;
  }
  return 1;
}

static cJSON *parse(const char *text, size_t size, api_problem *problem) {
  api_json_error error;
  if (!enter(text, size, problem)) {
    return NULL;
  }
  cJSON *body = api_json_parse(text, size, &error);
  if (!body && !error.why) {
    api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  } else if (!body) {
    api_refuse(problem, "malformed-json", "The body is not valid JSON: %s (at byte %zu). Correct it there.", error.why,
               error.offset);
    api_json_member_integer(&problem->facts, "offset", (int64_t)error.offset);
  }
  return body;
}

cJSON *read_json(request *r, api_problem *problem) {
  cJSON *body = parse(r->body.data ? r->body.data : "", r->body.size, problem);
  body_free(r);
  if (!body) {
    json_done(NULL);
  }
  return body;
}

cJSON *read_json_beside(const char *text, size_t size, api_problem *problem) {
  return parse(text, size, problem);
}

void json_done(cJSON *body) {
  cJSON_Delete(body);
  mine.values = 0;
  if (mine.holds) {
    trim_now();
    mine.holds = 0;
    pthread_mutex_unlock(&large);
  }
}
