/* A JSON body: parsed, and read as each request of the API and as a landmark file. An accepted body must be written in
 * canonical form, and its canonical text must read back to the same text. */
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/supermesh_codec.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void free_problem(api_problem *problem, int fine) {
  if (!fine && !problem->name) {
    abort(); /* refused without a reason */
  }
  api_text text = {0};
  if (problem->name) {
    api_problem_write(problem, &text);
    api_json_error error;
    cJSON *again = api_json_parse(text.data, text.size, &error);
    if (!again) {
      abort(); /* a problem that is not JSON */
    }
    cJSON_Delete(again);
  }
  api_text_free(&text);
  api_problem_free(problem);
}

static int write_embedding(const char *bytes, size_t size, api_text *out) {
  api_json_error error;
  api_problem problem = {0};
  api_embedding_request request;
  cJSON *body = api_json_parse(bytes, size, &error);
  int fine = body && api_embedding_request_read(body, &request, &problem);
  if (fine) {
    api_embedding_request_write(&request, out);
  }
  if (body) {
    free_problem(&problem, fine);
  }
  cJSON_Delete(body);
  return fine;
}

static int write_supermesh(const char *bytes, size_t size, api_text *out) {
  api_json_error error;
  api_problem problem = {0};
  api_supermesh_request request = {0};
  cJSON *body = api_json_parse(bytes, size, &error);
  int fine = body && api_supermesh_request_read(body, &request, &problem);
  if (fine) {
    api_supermesh_request_write(&request, out);
  }
  if (body) {
    free_problem(&problem, fine);
    api_supermesh_request_free(&request);
  }
  cJSON_Delete(body);
  return fine;
}

static void round_trip(int (*write)(const char *, size_t, api_text *), const char *bytes, size_t size) {
  api_text first = {0}, second = {0};
  if (write(bytes, size, &first) && (!write(first.data, first.size, &second) || first.size != second.size ||
                                     memcmp(first.data, second.data, first.size) != 0)) {
    abort();
  }
  api_text_free(&first);
  api_text_free(&second);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  api_json_error error = {0};
  cJSON *body = api_json_parse((const char *)data, size, &error);
  if (!body) {
    if (!error.why || error.offset > size) {
      abort();
    }
    return 0;
  }
  api_landmark_list list = {0};
  api_problem problem = {0};
  int fine = api_landmarks_read(body, 0, &list, &problem);
  free_problem(&problem, fine);
  api_landmarks_free(&list);
  cJSON_Delete(body);
  round_trip(write_embedding, (const char *)data, size);
  round_trip(write_supermesh, (const char *)data, size);
  char *text = strndup((const char *)data, size);
  api_mesh_summary summary;
  if (text) {
    (void)api_mesh_summarise(text, &summary); /* a stored description */
  }
  free(text);
  return 0;
}
