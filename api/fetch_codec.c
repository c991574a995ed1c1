#include "api/fetch_codec.h"

#include <stdio.h>
#include <string.h>

#include "api/json.h"
#include "api/options.h"

/* The string of a member; NULL if the member is absent or not a string. In the latter case *fine becomes 0. */
static const char *text_of(const cJSON *body, const char *name, int *fine, api_problem *problem) {
  const cJSON *member = cJSON_GetObjectItemCaseSensitive(body, name);
  if (member && !cJSON_IsString(member)) {
    *fine = api_refuse(problem, "invalid-request", "\"%s\" must be a string.", name);
  }
  return cJSON_IsString(member) ? member->valuestring : NULL;
}

static int read_members(const cJSON *body, api_fetch_request *out, api_problem *problem) {
  int fine = 1;
  const char *url = text_of(body, "url", &fine, problem), *name = text_of(body, "name", &fine, problem);
  const char *format = text_of(body, "format", &fine, problem), *repair = text_of(body, "repair", &fine, problem);
  const char *part = text_of(body, "part", &fine, problem);
  char size[40] = "";
  const cJSON *handle_size = cJSON_GetObjectItemCaseSensitive(body, "handle_size");
  if (handle_size && !cJSON_IsNumber(handle_size)) {
    fine = api_refuse(problem, "invalid-request", "\"handle_size\" must be a number.");
  } else if (handle_size) {
    snprintf(size, sizeof size, "%.9g", handle_size->valuedouble);
  }
  const api_upload_query query = {
      .name = name, .repair = repair, .handle_size = handle_size ? size : NULL, .part = part, .format = format};
  if (!fine) {
    return 0;
  }
  if (!url || strlen(url) >= sizeof out->url) {
    return api_refuse(problem, "invalid-request", "\"url\" must be a URL of at most %d bytes.", API_URL - 1);
  }
  strcpy(out->url, url);
  if (!api_upload_read(&query, &out->upload, problem)) {
    problem->name = "invalid-request"; /* these are not query parameters */
    return 0;
  }
  return 1;
}

int api_fetch_request_read(const cJSON *body, api_fetch_request *out, api_problem *problem) {
  static const char *const known[] = {"url", "name", "format", "repair", "handle_size", "part", NULL};
  memset(out, 0, sizeof *out);
  if (!cJSON_IsObject(body)) {
    return api_refuse(problem, "invalid-request", "The request must be a JSON object.");
  }
  if (cJSON_GetObjectItemCaseSensitive(body, "asset") && !cJSON_GetObjectItemCaseSensitive(body, "url")) {
    return api_refuse(problem, "invalid-request",
                      "A body of the type application/json names a mesh by {\"url\": …}. Send the glTF file itself as "
                      "model/gltf+json, or without a Content-Type.");
  }
  return api_members_known(body, "the request", known, problem) && read_members(body, out, problem);
}

int api_fetch_request_load(const char *json, api_fetch_request *out, api_problem *problem) {
  api_json_error error;
  cJSON *body = api_json_parse(json, strlen(json), &error);
  memset(out, 0, sizeof *out);
  int fine =
      body ? read_members(body, out, problem)
           : api_refuse(problem, "corrupt", "The stored request of the job cannot be read: send the request again.");
  const cJSON *quota = cJSON_GetObjectItemCaseSensitive(body, "quota");
  out->quota = cJSON_IsNumber(quota) ? (int64_t)quota->valuedouble : 0;
  cJSON_Delete(body);
  return fine;
}

static void write_members(const api_fetch_request *request, api_text *out) {
  api_json_member_string(out, "url", request->url);
  api_json_member_string(out, "name", request->upload.name);
  if (request->upload.hint != ORB_FORMAT_AUTO) {
    api_json_member_string(out, "format", orb_format_name(request->upload.hint));
  }
  api_json_member_string(out, "repair", request->upload.repair);
}

void api_fetch_request_write(const api_fetch_request *request, api_text *out) {
  api_json_open(out, '{');
  write_members(request, out);
  api_json_member_integer(out, "quota", request->quota);
  api_json_close(out, '}');
}

int api_fetch_request_key(const api_fetch_request *request, char key[API_ID_SIZE]) {
  api_text text = {0};
  api_text_add(&text, "fetch");
  api_json_open(&text, '{');
  write_members(request, &text);
  api_json_close(&text, '}');
  int fine = !text.failed;
  if (fine) {
    api_id_of_text(text.data, text.size, key);
  }
  api_text_free(&text);
  return fine;
}
