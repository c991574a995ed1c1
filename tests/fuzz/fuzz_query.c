/* A request line and its fields: lines of METHOD, path, query (NAME=VALUE&…, percent-encoded), then Prefer, trace,
 * tags, Priority, the number of an event, and the coding of a body. The parsed numbers must be within their bounds. */
#include <microhttpd.h>
#include <stdlib.h>
#include <string.h>

#include "api/mesh_codec.h"
#include "api/routes.h"
#include "api/transfer_codec.h"
#include "http/decode.h"
#include "http/parse.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static char *next_line(char **at) {
  char *line = *at ? strsep(at, "\n") : NULL;
  return line;
}

/* The value of a name of the query, unescaped in place as the HTTP library does it. */
static char *value_of(char *query, const char *name) {
  size_t n = strlen(name);
  for (char *at = query; at; at = strchr(at, '&') ? strchr(at, '&') + 1 : NULL) {
    if (strncmp(at, name, n) == 0 && at[n] == '=') {
      char *value = strndup(at + n + 1, strcspn(at + n + 1, "&"));
      if (value && !strstr(value, "%00")) {
        MHD_http_unescape(value);
      }
      return value;
    }
  }
  return NULL;
}

/* An accepted list of transfers is within its bounds, and its canonical form means the same. */
static void read_transfer(const char *text) {
  orb_carry read[ORB_CARRY_MAX], again[ORB_CARRY_MAX];
  int32_t count = 0, same = 0;
  api_problem problem = {0};
  cJSON *list = api_transfer_parse(text);
  if (list && api_transfer_read(list, 16, read, &count, &problem)) {
    api_text out = {0};
    api_transfer_write(read, count, &out);
    cJSON *written = out.data ? cJSON_Parse(out.data) : NULL;
    if (!written || !api_transfer_read(written, 16, again, &same, &problem) || same != count) {
      abort();
    }
    for (int32_t i = 0; i < count; i++) {
      if (read[i].from < 0 || read[i].from > 15 || read[i].from != again[i].from || read[i].what != again[i].what ||
          read[i].resolution > ORB_BAKE_MOST || read[i].resolution != again[i].resolution) {
        abort();
      }
    }
    cJSON_Delete(written);
    api_text_free(&out);
  } else if (list && !problem.name) {
    abort();
  }
  cJSON_Delete(list);
  api_problem_free(&problem);
}

static void read_query(char *query, const char *prefer) {
  char *limit = value_of(query, "limit"), *token = value_of(query, "page_token"), *wait = value_of(query, "wait");
  char *name = value_of(query, "name"), *repair = value_of(query, "repair"), *format = value_of(query, "format");
  char *handle_size = value_of(query, "handle_size"), *part = value_of(query, "part");
  char *transfer = value_of(query, "transfer");
  int most;
  uint64_t sealed;
  const char *why = NULL;
  if (parse_page(limit, token, &most, &sealed, &why) ? most < 1 || most > PAGE_MOST : !why) {
    abort();
  }
  int64_t ms = wait ? parse_wait_ms(wait) : 0, preferred = parse_preferred_ms(prefer);
  if (ms < -1 || ms > 60000 || preferred < 0 || preferred > 60000) {
    abort();
  }
  api_upload upload;
  api_problem problem = {0};
  const api_upload_query parameters = {name, repair, handle_size, part, format};
  if (api_upload_read(&parameters, &upload, &problem)) {
    char again[API_REPAIR_TEXT];
    orb_repair_options options;
    if (!api_repair_parse(upload.repair, NULL, NULL, &options, again, &problem) ||
        options.repair != upload.options.repair || options.part != upload.options.part ||
        strcmp(again, upload.repair) != 0) {
      abort(); /* the canonical list of repairs does not read back */
    }
  } else if (!problem.name) {
    abort();
  }
  api_problem_free(&problem);
  if (transfer) {
    read_transfer(transfer);
  }
  free(transfer);
  free(limit);
  free(token);
  free(wait);
  free(name);
  free(repair);
  free(format);
  free(handle_size);
  free(part);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char *text = strndup((const char *)data, size), *at = text;
  if (!text) {
    return 0;
  }
  char *method = next_line(&at), *path = next_line(&at), *query = next_line(&at), *prefer = next_line(&at);
  char *trace = next_line(&at), *tags = next_line(&at);
  char *urgency = next_line(&at), *event = next_line(&at), *body = next_line(&at);
  char id[API_ID_SIZE] = "", allow[64], kept[TRACE_SIZE];
  const route *found = path ? api_route_find(method, path, id, allow) : NULL;
  if ((found && found->id >= ROUTE_COUNT) || memchr(id, 0, sizeof id) == NULL) {
    abort();
  }
  if (parse_trace(trace, kept) && strlen(kept) != TRACE_SIZE - 1) {
    abort();
  }
  int urgent = parse_urgency(urgency);
  coding coded = coding_of(body);
  if (urgent < 0 || urgent > 7 || parse_event_number(event) < 0 || coded < CODING_UNKNOWN || coded > CODING_ZSTD) {
    abort();
  }
  (void)parse_tag_matches(tags, "\"0123456789abcdef0123456789abcdef\"");
  if (query) {
    read_query(query, prefer);
  }
  free(text);
  return 0;
}
