/* The strict JSON reader, ids, requests and routes, against RFC 8259, RFC 3629 and known hashes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "api/ids.h"
#include "api/json.h"
#include "api/mesh_codec.h"
#include "api/problem.h"
#include "api/routes.h"
#include "api/supermesh_codec.h"

static int accepts(const char *text, size_t size) {
  api_json_error error;
  cJSON *value = api_json_parse(text, size, &error);
  if (!value) {
    assert_non_null(error.why);
    assert_true(error.offset <= size);
  }
  cJSON_Delete(value);
  return value != NULL;
}

static void test_grammar(void **state) {
  (void)state;
  static const char *const good[] = {"{}", " [1, -0.5e3, \"\\u00e9\\ud83d\\ude00\", true, null] ", "{\"a\":{\"a\":1}}",
                                     "0"};
  static const char *const bad[] = {"",
                                    " ",
                                    "{",
                                    "{\"a\"}",
                                    "[1,]",
                                    "{\"a\":1,}",
                                    "01",
                                    "1.",
                                    "+1",
                                    "1e999",
                                    "-1e999",
                                    "NaN",
                                    "Infinity",
                                    "{} x",
                                    "'a'",
                                    "\"\\x\"",
                                    "\"\\ud800\"",
                                    "\"a\nb\"",
                                    "\"\\u0000\"",
                                    "{\"a\":1,\"a\":2}",
                                    "[1][2]",
                                    "tru",
                                    "\"open",
                                    "[\"\\udc00\"]",
                                    "{1:2}",
                                    ",",
                                    "[1 2]"};
  for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
    assert_true(accepts(good[i], strlen(good[i])));
  }
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
    assert_false(accepts(bad[i], strlen(bad[i])));
  }
}

static void test_utf8(void **state) {
  (void)state;
  assert_true(accepts("\"\xc3\xa9\xf0\x9f\x98\x80\"", 8));
  assert_false(accepts("\"\xff\"", 3));
  assert_false(accepts("\"\xc0\xaf\"", 4));         /* overlong */
  assert_false(accepts("\"\xed\xa0\x80\"", 5));     /* surrogate */
  assert_false(accepts("\"\xf4\x90\x80\x80\"", 6)); /* beyond U+10FFFF */
  assert_false(accepts("\"a\0b\"", 5));
}

static void test_depth(void **state) {
  (void)state;
  char text[80];
  memset(text, '[', 40);
  memset(text + 32, ']', 32);
  assert_true(accepts(text, 64));
  memset(text, '[', 33);
  memset(text + 33, ']', 33);
  assert_false(accepts(text, 66));
}

static void test_numbers_read_back(void **state) {
  (void)state;
  static const double values[] = {0, 1, -1, 0.1, 1.0 / 3, 5e-324, 1.7976931348623157e308, 123456789.25};
  for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
    api_text text = {0};
    api_json_error error;
    api_json_number(&text, values[i]);
    cJSON *value = api_json_parse(text.data, text.size, &error);
    assert_non_null(value);
    assert_memory_equal(&value->valuedouble, &values[i], sizeof(double));
    cJSON_Delete(value);
    api_text_free(&text);
  }
}

static void test_ids(void **state) {
  (void)state;
  char id[API_ID_SIZE];
  api_id_of_text("abc", 3, id); /* FIPS 180-4, appendix B.1 */
  assert_string_equal(id, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  assert_true(api_id_valid(id, 64));
  id[0] = 'B';
  assert_false(api_id_valid(id, 64));
}

static void test_repairs(void **state) {
  (void)state;
  orb_repair_options options, again;
  char text[API_REPAIR_TEXT], canonical[API_REPAIR_TEXT];
  api_problem problem = {0};
  assert_true(api_repair_parse("largest_component,fill_holes", NULL, NULL, &options, text, &problem));
  assert_int_equal(options.repair, ORB_REPAIR_SAFE | ORB_REPAIR_FILL_HOLES | ORB_REPAIR_LARGEST_COMPONENT);
  assert_string_equal(text, "safe,fill_holes,largest_component");
  assert_true(api_repair_parse("close_handles", "0.050", NULL, &options, text, &problem));
  assert_int_equal(options.repair, ORB_REPAIR_SAFE | ORB_REPAIR_CLOSE_HANDLES);
  assert_string_equal(text, "safe,close_handles");
  assert_true(api_repair_parse("close_handles,largest_component", "0.1", "a, b", &options, text, &problem));
  assert_string_equal(text, "safe,close_handles:0.1,part:a, b");
  assert_string_equal(options.part_name, "a, b");
  assert_true(api_repair_parse(text, NULL, NULL, &again, canonical, &problem));
  assert_memory_equal(&again, &options, sizeof again);
  assert_string_equal(canonical, text);
  assert_true(api_repair_parse("safe", NULL, "2", &options, text, &problem));
  assert_string_equal(text, "safe,part:2");
  assert_int_equal(options.part, 2);
  static const char *const sizes[] = {"",     "0",  "-1", "nan",     "inf",    "1e",
                                      "0.1x", "11", " 1", "0x1p-3,", "5e-324", "1e-7"};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    assert_false(api_repair_parse("close_handles", sizes[i], NULL, &options, text, &problem));
    assert_string_equal(problem.name, "bad-query");
  }
  assert_false(api_repair_parse("safe", "0.1", NULL, &options, text, &problem));
  assert_false(api_repair_parse("safe", NULL, "", &options, text, &problem));
  assert_false(api_repair_parse("safe", NULL, "a\nb", &options, text, &problem));
  assert_false(api_repair_parse("none", NULL, "1", &options, text, &problem));
  assert_false(api_repair_parse("none,safe", NULL, NULL, &options, text, &problem));
  assert_false(api_repair_parse("", NULL, NULL, &options, text, &problem));
  assert_false(api_repair_parse("safe,", NULL, NULL, &options, text, &problem));
  api_problem_free(&problem);
}

#define MESH "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"

/* Returns the name of the problem, or "" and the id of a valid request. */
static const char *supermesh(const char *json, char id[API_ID_SIZE]) {
  api_supermesh_request request;
  api_problem problem = {0};
  api_json_error error;
  api_mesh_summary meshes[2] = {{.name = "a", .file_vertices = 10, .file_triangles = 16},
                                {.name = "b", .file_vertices = 10, .file_triangles = 16}};
  cJSON *body = api_json_parse(json, strlen(json), &error);
  assert_non_null(body);
  int fine =
      api_supermesh_request_read(body, &request, &problem) && api_supermesh_request_resolve(&request, meshes, &problem);
  if (fine) {
    api_text text = {0};
    api_supermesh_request again;
    char twice[API_ID_SIZE];
    assert_true(api_supermesh_request_id(&request, id));
    api_supermesh_request_write(&request, &text); /* the canonical text reads back as the same request */
    cJSON *canonical = api_json_parse(text.data, text.size, &error);
    assert_true(api_supermesh_request_read(canonical, &again, &problem));
    assert_true(api_supermesh_request_id(&again, twice));
    assert_string_equal(id, twice);
    api_supermesh_request_free(&again);
    cJSON_Delete(canonical);
    api_text_free(&text);
  }
  api_supermesh_request_free(&request);
  cJSON_Delete(body);
  const char *name = fine ? "" : problem.name;
  api_problem_free(&problem);
  return name;
}

#define SHAPES "\"shapes\":[{\"mesh\":\"" MESH "\"},{\"mesh\":\"" MESH "\"}]"

static void test_supermesh_requests(void **state) {
  (void)state;
  char a[API_ID_SIZE], b[API_ID_SIZE];
  assert_string_equal(supermesh("{" SHAPES "}", a), "");
  assert_string_equal(supermesh("{\"landmarks\":\"auto\"," SHAPES ",\"remesh\":{\"tolerance\":1e-3}}", b), "");
  assert_string_equal(a, b); /* defaults may be omitted, and order does not matter */
  assert_string_equal(supermesh("{" SHAPES ",\"remesh\":{\"tolerance\":0.002}}", b), "");
  assert_string_not_equal(a, b);
  assert_string_equal(supermesh("{" SHAPES ",\"zap\":1}", b), "unknown-member");
  assert_string_equal(supermesh("{" SHAPES ",\"align\":{\"options\":{\"seed\":1}}}", b), "unknown-member");
  assert_string_equal(supermesh("{" SHAPES ",\"align\":{\"method\":\"pin\"}}", b), "bad-landmarks");
  assert_string_equal(supermesh("{" SHAPES ",\"remesh\":{\"method\":\"magic\"}}", b), "bad-option");
  assert_string_equal(supermesh("{" SHAPES ",\"landmarks\":[{\"at\":[{\"vertex\":1}]}]}", b), "bad-landmarks");
  assert_string_equal(supermesh("{" SHAPES ",\"landmarks\":[{\"at\":[{\"vertex\":1},{\"vertex\":10}]}]}", b),
                      "bad-landmarks");
  assert_string_equal(supermesh("{" SHAPES ",\"landmarks\":[{\"at\":[{\"vertex\":1},{\"vertex\":9}]}]}", b), "");
  assert_string_equal(
      supermesh("{" SHAPES ",\"landmarks\":[{\"at\":[{\"vertex\":1},{\"triangle\":2,\"barycentric\":[1,1,0]}]}]}", b),
      "bad-landmarks");
}

static void test_routes(void **state) {
  (void)state;
  char id[API_ID_SIZE], allow[64];
  assert_int_equal(api_route_find("HEAD", "/v1/meshes/" MESH, id, allow)->id, ROUTE_MESH_GET);
  assert_string_equal(id, MESH);
  assert_null(api_route_find("PUT", "/v1/meshes", id, allow));
  assert_string_equal(allow, "POST, GET, HEAD");
  assert_null(api_route_find("GET", "/v1/meshes/", id, allow));
  assert_string_equal(allow, "");
  assert_null(api_route_find("GET", "/v1/meshes/../x", id, allow));
  static const char *const wrong[] = {"", "x", "-1", "01", "100", "1.5", "1/", "1.ply"};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
    char path[160];
    snprintf(path, sizeof path, "/v1/supermeshes/" MESH "/spheres/%s.ply", wrong[i]);
    assert_null(api_route_find("GET", path, id, allow));
  }
  const route *sphere = api_route_find("GET", "/v1/supermeshes/" MESH "/spheres/12.ply", id, allow);
  assert_int_equal(sphere->id, ROUTE_SUPERMESH_SPHERE);
  assert_string_equal(id, MESH);
  assert_int_equal(api_route_number(sphere, "/v1/supermeshes/" MESH "/spheres/12.ply"), 12);
  assert_int_equal(api_route_number(sphere, "/v1/supermeshes/" MESH "/spheres/0.ply"), 0);
  assert_int_equal(api_route_number(api_route_find("GET", "/v1/supermeshes/" MESH, id, allow), "/v1/supermeshes/" MESH),
                   -1);
  assert_null(api_route_find("GET", "/v1/jobs/" MESH, id, allow));
}

/* Stored descriptions may be damaged: counts must be integers that a double represents exactly. */
static void test_stored_meshes(void **state) {
  static const char *const counts[] = {"800", "9007199254740992", "9007199254740994", "8e49", "-1", "\"8\"", "null"};
  (void)state;
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
    char text[256];
    api_mesh_summary summary;
    snprintf(text, sizeof text,
             "{\"name\":\"cow\",\"format\":\"obj\",\"repair\":\"safe\",\"vertices\":402,\"triangles\":%s,"
             "\"file_vertices\":402,\"file_triangles\":800}",
             counts[i]);
    assert_int_equal(api_mesh_summarise(text, &summary), i < 2);
    if (i < 2) {
      assert_int_equal(summary.triangles, strtoll(counts[i], NULL, 10));
      assert_int_equal(summary.vertices, 402);
    }
  }
}

/* Dates as the C library computes them: every day of 400 years, the first and the last moment of far years, and random
 * instants. */
static void check_instant(int64_t unix_ms) {
  char expected[64], stamp[48];
  const time_t seconds = (time_t)(unix_ms / 1000);
  struct tm utc;
  assert_non_null(gmtime_r(&seconds, &utc));
  assert_true(strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%S", &utc) > 0);
  snprintf(expected, sizeof expected, "\"t\":\"%s.%03dZ\"", stamp, (int)(unix_ms % 1000));
  api_text text = {0};
  api_json_member_instant(&text, "t", unix_ms);
  assert_false(text.failed);
  assert_string_equal(text.data, expected);
  api_text_free(&text);
}

static void test_instants(void **state) {
  (void)state;
  const int64_t day = 86400000;
  uint64_t random = 1;
  for (int64_t i = 0; i < 146097; i++) {
    random = random * 6364136223846793005u + 1442695040888963407u;
    check_instant(1 + i * day);
    check_instant((i + 1) * day - 1);
    check_instant(1 + (int64_t)(random >> 18)); /* until the year 4200 */
  }
  check_instant(253402300799999); /* the end of the year 9999 */
  check_instant(253402300800000);
  check_instant(INT64_MAX / 1000000);
}

static void test_integers(void **state) {
  (void)state;
  static const int64_t values[] = {0, 1, -1, 9, 10, 999999999999999, -1000000000000000, INT64_MAX, INT64_MIN};
  static const double doubles[] = {0.0, -0.0, 1, -1, 100000, 999999999999999.0, 1e15, -1e15, 1e16, 123456789012345.0,
                                   0.5};
  for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
    char expected[32];
    api_text text = {0};
    snprintf(expected, sizeof expected, "%lld", (long long)values[i]);
    api_json_integer(&text, values[i]);
    assert_string_equal(text.data, expected);
    api_text_free(&text);
  }
  for (size_t i = 0; i < sizeof doubles / sizeof *doubles; i++) {
    char expected[32];
    api_text text = {0};
    snprintf(expected, sizeof expected, "%.15g", doubles[i]);
    api_json_number(&text, doubles[i]);
    assert_string_equal(text.data, expected);
    api_text_free(&text);
  }
}

/* Formatted text is the same wherever it crosses the end of the buffer, which grows from 256 bytes. */
static void test_formatted(void **state) {
  (void)state;
  for (size_t before = 0; before < 600; before++) {
    api_text text = {0};
    for (size_t i = 0; i < before; i++) {
      api_text_add(&text, "x");
    }
    api_text_printf(&text, "%d%s", 42, "nine bytes");
    assert_int_equal(text.size, before + 12);
    assert_string_equal(text.data + before, "42nine bytes");
    api_text_free(&text);
  }
}

/* A refusal for handles says how many loops it omits, and says nothing if it has all of them. */
/* RFC 8259 for the escapes, UAX 9 for the controls of text in two directions. Other characters stay as they are. */
static void test_output_of_a_program(void **state) {
  static const char bytes[] =
      "a\0b\x7f\xc2\x9b"
      "31m\xe2\x80\xae\xe2\x81\xa6\xd8\x9c\xff\x1b\n\"\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80\xe2\x80";
  api_text text = {0};
  (void)state;
  api_json_member_output(&text, "wrote", bytes, sizeof bytes - 1);
  assert_string_equal(
      text.data,
      "\"wrote\":\"a\xef\xbf\xbd"
      "b\\u007f\\u009b31m\\u202e\\u2066\\u061c\xef\xbf\xbd\\u001b\\n\\\"\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80"
      "\xef\xbf\xbd\xef\xbf\xbd\"");
  api_text_free(&text);
}

static void test_loops_left_out(void **state) {
  (void)state;
  orb_error *error = calloc(1, sizeof *error);
  error->status = ORB_E_NOT_GENUS_ZERO;
  error->line = error->offset = error->boundary_loops = -1;
  error->shape = error->transfer = -1;
  error->loop_count = 2;
  error->loop_start[1] = 3;
  error->loop_start[2] = 6;
  for (int i = 0; i < 6; i++) {
    error->loop_vertices[i] = i;
  }
  error->loop_length_relative[0] = error->loop_length_relative[1] = 0.5;
  for (int more = 0; more < 2; more++) {
    error->genus = more ? 40000 : 2;
    api_problem problem = {0};
    api_problem_of_error(error, &problem);
    assert_non_null(strstr(problem.facts.data, "\"loops\":[[0,1,2],[3,4,5]]"));
    const char *left_out = strstr(problem.facts.data, "\"loops_left_out\":39998");
    assert_true(more ? left_out != NULL : !strstr(problem.facts.data, "left_out"));
    api_problem_free(&problem);
  }
  free(error);
}

/* The facts of 10,000 handles with loops of four vertices, shortened: what stays is a prefix, and all are counted. */
static void test_shortened_loops(void **state) {
  (void)state;
  enum { HANDLES = 10000, MOST = 3000 };
  orb_error *error = calloc(1, sizeof *error);
  error->status = ORB_E_NOT_GENUS_ZERO;
  error->line = error->offset = error->boundary_loops = -1;
  error->shape = error->transfer = -1;
  error->genus = error->loop_count = HANDLES;
  for (int i = 0; i < HANDLES; i++) {
    error->loop_start[i + 1] = 4 * (i + 1);
    error->loop_length_relative[i] = 1.0 / (i + 3);
    for (int k = 4 * i; k < 4 * (i + 1); k++) {
      error->loop_vertices[k] = k;
    }
  }
  api_problem problem = {0}, whole = {0};
  api_problem_of_error(error, &problem);
  api_problem_of_error(error, &whole);
  api_problem_shorten(&problem, problem.facts.size);
  assert_string_equal(problem.facts.data, whole.facts.data);
  api_problem_shorten(&problem, MOST);
  assert_false(problem.facts.failed);
  assert_in_range(problem.facts.size, MOST / 3, MOST + 100);
  api_text text = {0};
  api_problem_write(&problem, &text);
  api_json_error why;
  cJSON *json = api_json_parse(text.data, text.size, &why);
  const cJSON *loops = cJSON_GetObjectItemCaseSensitive(json, "loops");
  const cJSON *lengths = cJSON_GetObjectItemCaseSensitive(json, "loop_lengths_relative");
  const int kept = cJSON_GetArraySize(loops);
  assert_in_range(kept, 20, MOST / 13);
  assert_int_equal(cJSON_GetArraySize(lengths), kept);
  assert_int_equal(cJSON_GetObjectItemCaseSensitive(json, "loops_left_out")->valueint, HANDLES - kept);
  assert_int_equal(cJSON_GetObjectItemCaseSensitive(json, "genus")->valueint, HANDLES);
  const cJSON *last = cJSON_GetArrayItem(loops, kept - 1);
  assert_int_equal(cJSON_GetArrayItem(last, 3)->valueint, 4 * kept - 1);
  assert_true(cJSON_GetArrayItem(lengths, kept - 1)->valuedouble == 1.0 / (kept + 2));
  cJSON_Delete(json);
  api_text_free(&text);
  api_problem_free(&problem);
  api_problem_free(&whole);
  free(error);
}

/* A mesh's summary beside lists of any length; what is nested does not count. */
static void test_summaries(void **state) {
  (void)state;
  api_text text = {0};
  api_mesh_summary summary;
  api_text_add(&text, " {\"id\":\"x\",\"repairs\":[{\"name\":\"no\",\"loop\":[0");
  for (int i = 1; i < 100000; i++) {
    api_text_printf(&text, ",%d", i);
  }
  api_text_add(
      &text,
      "]}],\"name\" : \"a\\\"]}\\u00e9\",\"format\":\"obj\",\"repair\":\"weld\",\"vertices\":4,\"triangles\":5,"
      "\"file_vertices\":6,\"topology\":{\"vertices\":9},\"file_triangles\":7 } ");
  assert_true(api_mesh_summarise(text.data, &summary));
  assert_string_equal(summary.name, "a\"]}\303\251");
  assert_string_equal(summary.format, "obj");
  assert_string_equal(summary.repair, "weld");
  assert_int_equal(summary.vertices, 4);
  assert_int_equal(summary.triangles, 5);
  assert_int_equal(summary.file_vertices, 6);
  assert_int_equal(summary.file_triangles, 7);
  api_text_free(&text);
  assert_false(api_mesh_summarise("{\"name\":\"a\",\"topology\":{\"format\":\"obj\"}}", &summary));
  assert_false(api_mesh_summarise("[]", &summary));
  assert_false(api_mesh_summarise("", &summary));
}

/* Facts as another program could write them. */
static void test_shortened_texts(void **state) {
  (void)state;
  const struct {
    const char *facts, *shortened; /* NULL: they cannot be shortened */
  } cases[] = {
      {"\"genus\":3,\"loops\":[[1,2],[3]],\"loop_lengths_relative\":[0.5,0.25],\"x\":\"]}\\\"\"",
       "\"genus\":3,\"x\":\"]}\\\"\",\"loops\":[[1,2]],\"loop_lengths_relative\":[0.5],\"loops_left_out\":2"},
      {" \"loops\" : [ [1] , [2] ] , \"genus\" : 2 , \"loop_lengths_relative\" : [ 1 , 1 ], \"loops_left_out\": 9 ",
       "\"genus\" : 2,\"loops\":[[1],[2]],\"loop_lengths_relative\":[1,1]"},
      {"\"loops\":[],\"loop_lengths_relative\":[],\"long\":[1,2,3]",
       "\"long\":[1,2,3],\"loops\":[],\"loop_lengths_relative\":[]"},
      {"\"a\":{\"loops\":[[1]]},\"b\":[]", "\"a\":{\"loops\":[[1]]},\"b\":[]"},
      {"\"loops\":[[1],[2]],\"genus\":2,\"b\":[]", NULL},
      {"\"loops\":{},\"loop_lengths_relative\":\"a\"", NULL}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    api_problem problem = {0};
    api_text_add(&problem.facts, cases[i].facts);
    assert_true(api_json_is_object(problem.facts.data, problem.facts.size, 1, 100));
    api_problem_shorten(&problem, 14);
    assert_int_equal(problem.facts.failed, cases[i].shortened == NULL);
    if (cases[i].shortened) {
      assert_string_equal(problem.facts.data, cases[i].shortened);
      assert_true(api_json_is_object(problem.facts.data, problem.facts.size, 1, 100));
    }
    api_problem_free(&problem);
  }
}

/* What is checked without a tree: objects, and members without braces. */
static void test_objects(void **state) {
  (void)state;
  const struct {
    const char *text;
    int bare, most, is;
  } cases[] = {{"{\"a\":1,\"b\":[2,{\"a\":3,\"a\":4}]}", 0, 7, 1},
               {"{\"a\":1,\"b\":[2,{\"a\":3,\"a\":4}]}", 0, 6, 0},
               {" {} ", 0, 1, 1},
               {"[1]", 0, 9, 0},
               {"1", 0, 9, 0},
               {"", 0, 9, 0},
               {"{\"a\":1,\"b\":2,\"a\":3}", 0, 9, 0},
               {"{\"a\":1,\"\\u0061\":3}", 0, 9, 0},
               {"{\"a\":1", 0, 9, 0},
               {"{\"a\":1}}", 0, 9, 0},
               {"\"a\":1", 1, 9, 1},
               {"\"a\":{\"b\":[]} , \"b\":\"}\"", 1, 9, 1},
               {"\"a\":1,\"a\":2", 1, 9, 0},
               {"\"a\":1}", 1, 9, 0},
               {"\"a\":1},{\"b\":1", 1, 9, 0},
               {"\"a\":{\"b\":1", 1, 9, 0},
               {"\"a\":1,", 1, 9, 0},
               {"\"a\"", 1, 9, 0},
               {"{\"a\":1}", 1, 9, 0},
               {"1", 1, 9, 0},
               {"", 1, 9, 0}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    const size_t size = strlen(cases[i].text);
    if (api_json_is_object(cases[i].text, size, cases[i].bare, (size_t)cases[i].most) != cases[i].is) {
      fail_msg("%s", cases[i].text);
    }
  }
  for (int names = API_JSON_NAMES; names <= API_JSON_NAMES + 1; names++) {
    api_text text = {0};
    api_json_open(&text, '{');
    for (int i = 0; i < names; i++) {
      char name[16];
      snprintf(name, sizeof name, "n%d", i);
      api_json_member_integer(&text, name, i);
    }
    api_json_close(&text, '}');
    assert_int_equal(api_json_is_object(text.data, text.size, 0, 1000), names == API_JSON_NAMES);
    api_text_free(&text);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_instants),
                                     cmocka_unit_test(test_integers),
                                     cmocka_unit_test(test_formatted),
                                     cmocka_unit_test(test_grammar),
                                     cmocka_unit_test(test_utf8),
                                     cmocka_unit_test(test_depth),
                                     cmocka_unit_test(test_numbers_read_back),
                                     cmocka_unit_test(test_ids),
                                     cmocka_unit_test(test_repairs),
                                     cmocka_unit_test(test_supermesh_requests),
                                     cmocka_unit_test(test_stored_meshes),
                                     cmocka_unit_test(test_routes),
                                     cmocka_unit_test(test_output_of_a_program),
                                     cmocka_unit_test(test_loops_left_out),
                                     cmocka_unit_test(test_shortened_loops),
                                     cmocka_unit_test(test_shortened_texts),
                                     cmocka_unit_test(test_summaries),
                                     cmocka_unit_test(test_objects)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
