/* Reads request bodies and writes documents while memory runs out: each ends with an out-of-memory error or correctly.
 */
#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "api/json.h"
#include "api/supermesh_codec.h"
#include "torture/torture.h"

#define ID_A "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
#define ID_B "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"

/* Reads a body and writes it back. Returns 0 and *problem if it is refused. */
typedef struct body {
  const char *text;
  int (*through)(const cJSON *value, api_text *out, api_problem *problem);
  char expected[8192]; /* without faults */
} body;

static int through_supermesh(const cJSON *value, api_text *out, api_problem *problem) {
  api_supermesh_request request;
  char id[API_ID_SIZE] = "";
  int fine = api_supermesh_request_read(value, &request, problem);
  if (fine) {
    api_supermesh_request_write(&request, out);
    out->failed |= !api_supermesh_request_id(&request, id);
    api_text_add(out, id);
  }
  api_supermesh_request_free(&request);
  return fine;
}

static int through_embedding(const cJSON *value, api_text *out, api_problem *problem) {
  api_embedding_request request;
  char id[API_ID_SIZE] = "";
  int fine = api_embedding_request_read(value, &request, problem);
  if (fine) {
    api_embedding_request_write(&request, out);
    out->failed |= !api_embedding_request_id(&request, id);
    api_text_add(out, id);
  }
  return fine;
}

/* The document of a refusal. */
static int through_refusal(const cJSON *value, api_text *out, api_problem *problem) {
  int fine = through_supermesh(value, out, problem);
  if (!fine) {
    api_problem_write(problem, out);
  }
  return 1;
}

static int read_body(void *user, torture_kind kind, long number, int for_ever) {
  body *b = user;
  api_json_error error = {0};
  api_problem problem = {0};
  api_text out = {0};
  torture_arm(kind, number, for_ever);
  cJSON *value = api_json_parse(b->text, strlen(b->text), &error);
  int read = value && b->through(value, &out, &problem);
  int met = torture_disarm();
  if (!value) {
    assert_null(error.why); /* not: broken JSON */
  } else if (!read) {
    assert_string_equal(problem.name, "no-memory");
  } else if (!out.failed && strcmp(out.data, b->expected) != 0) {
    /* A refusal may become an out-of-memory error; nothing else may differ. */
    assert_true(b->through == through_refusal && strstr(out.data, "no-memory"));
  }
  assert_true(met || (read && !out.failed));
  cJSON_Delete(value);
  api_problem_free(&problem);
  api_text_free(&out);
  return met;
}

static void torture_body(body *b) {
  api_json_error error;
  api_problem problem = {0};
  api_text out = {0};
  cJSON *value = api_json_parse(b->text, strlen(b->text), &error);
  assert_non_null(value);
  if (!b->through(value, &out, &problem)) {
    fail_msg("%s", problem.detail);
  }
  snprintf(b->expected, sizeof b->expected, "%s", out.data);
  cJSON_Delete(value);
  api_problem_free(&problem);
  api_text_free(&out);
  for (int for_ever = 0; for_ever < 2; for_ever++) {
    long failures = torture(read_body, b, TORTURE_ALLOC, for_ever, 1, LONG_MAX, 1);
    print_message("%ld allocations failed, %s\n", failures, for_ever ? "for ever" : "once");
    assert_true(failures >= 10);
  }
}

static void test_supermesh(void **state) {
  (void)state;
  body b = {.text = "{\"shapes\":[{\"mesh\":\"" ID_A "\",\"name\":\"one\"},{\"mesh\":\"" ID_B
                    "\"}],"
                    "\"landmarks\":[{\"name\":\"nose\",\"at\":[{\"vertex\":1},{\"point\":[1,0.5,2]}]},"
                    "{\"at\":[{\"triangle\":3,\"barycentric\":[0.25,0.25,0.5]},{\"vertex\":7}]},"
                    "{\"at\":[{\"vertex\":2},{\"vertex\":3}],\"confidence\":0.5}],"
                    "\"align\":{\"method\":\"pin\",\"options\":{\"steps\":7}},"
                    "\"remesh\":{\"method\":\"adaptive\",\"tolerance\":0.01}}",
            .through = through_supermesh};
  torture_body(&b);
}

static void test_embedding(void **state) {
  (void)state;
  body b = {.text = "{\"mesh\":\"" ID_A "\",\"method\":\"newton\"}", .through = through_embedding};
  torture_body(&b);
}

static void test_refusal(void **state) {
  (void)state;
  body b = {.text = "{\"shapes\":[{\"mesh\":\"" ID_A "\"},{\"mesh\":\"" ID_B
                    "\"}],"
                    "\"landmarks\":[{\"at\":[{\"vertex\":1},{\"vertex\":-1}]}]}",
            .through = through_refusal};
  torture_body(&b);
}

int main(void) {
  torture_begin();
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_supermesh), cmocka_unit_test(test_embedding),
                                     cmocka_unit_test(test_refusal)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
