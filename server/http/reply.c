#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "http/http.h"

static void take(request *r, unsigned status, struct MHD_Response *response, size_t size) {
  if (r->response) {
    MHD_destroy_response(r->response);
  }
  r->response = response;
  r->status = status;
  r->sends = (int64_t)size;
  r->phase = PHASE_SEND;
}

void reply_drop(request *r) {
  if (r->response) {
    MHD_destroy_response(r->response);
  }
  r->response = NULL;
  r->status = 0;
  r->sends = 0;
  r->phase = PHASE_AWAY;
}

void reply_header(request *r, const char *name, const char *value) {
  if (r->response && MHD_add_response_header(r->response, name, value) != MHD_YES) {
    MHD_destroy_response(r->response); /* out of memory: no response is better than one that lacks a header */
    r->response = NULL;
  }
}

/* The coding that the client accepts. */
static coding accepted(const request *r) {
  const char *lines[HEADER_LINES];
  int count = r->srv->options->encoded_bytes > 0 ? header_lines(r, "Accept-Encoding", lines) : 0;
  return coding_accepted(lines, count);
}

/* Marks an answer as one whose form depends on Accept-Encoding, whatever the form of this one. */
static void add_coding(request *r, coding which) {
  if (which != CODING_NONE) {
    reply_header(r, "Content-Encoding", coding_name(which));
  }
  reply_header(r, "Vary", "Accept-Encoding");
}

int reply_choose(request *r, const char *key, const char *etag, const void *bytes, size_t size) {
  coding which = header_of(r, "Range") || size < ENCODE_LEAST || size > ENCODE_MOST ? CODING_NONE : accepted(r);
  stpncpy(r->etag, etag, sizeof r->etag - 1);
  r->coded = CODING_NONE;
  if (which == CODING_NONE) {
    return 1;
  }
  const encoded *found =
      bytes ? encoded_make(r->srv->encoded, key, which, bytes, size) : encoded_find(r->srv->encoded, key, which);
  if (!found || !found->bytes) {
    encoded_release(found);
    return bytes || found;
  }
  encoded_release(r->encoded);
  r->encoded = found;
  r->coded = which;
  if (*etag) {
    snprintf(r->etag, sizeof r->etag, "%.*s-%s\"", (int)strlen(etag) - 1, etag, coding_name(which));
  }
  return 1;
}

static void free_encoded(void *user) {
  encoded_release(user);
}

void reply_memory(request *r, unsigned status) {
  const encoded *e = r->encoded;
  take(r, status,
       MHD_create_response_from_buffer_with_free_callback_cls(e->size, e->bytes, free_encoded, (void *)(uintptr_t)e),
       e->size);
  if (r->response) {
    r->encoded = NULL;
  }
}

void reply_encoded(request *r, unsigned status, const char *mime) {
  reply_memory(r, status);
  reply_header(r, "Content-Type", mime);
  add_coding(r, r->coded);
}

/* Replaces a text by its compressed form if the client accepts that. */
static coding squeeze(const request *r, api_text *text) {
  coding which = text->failed || text->size < ENCODE_LEAST ? CODING_NONE : accepted(r);
  void *bytes;
  size_t size;
  if (which == CODING_NONE || !encode_bytes(which, text->data, text->size, 1, &bytes, &size)) {
    return CODING_NONE;
  }
  api_text_free(text);
  *text = (api_text){.data = bytes, .size = size, .capacity = size};
  return which;
}

static void refuse_held(request *r) {
  reply_refuse(
      r, "unavailable",
      "The answers that the server holds for its callers have as many bytes as they may; try again soon, or ask "
      "for less at once.");
}

/* Bytes of an answer that is sent even where there is no room for it: the refusal that says so, and every short one. */
enum { ANSWER_SHORT = 2048 };

void reply_text(request *r, unsigned status, const char *mime, api_text *text) {
  struct MHD_Response *response = NULL;
  if (!request_holds(r, &r->answer_bytes, (int64_t)text->size) && text->size > ANSWER_SHORT) {
    api_text_free(text);
    refuse_held(r);
    return;
  }
  int large = text->size >= ENCODE_LEAST;
  coding which = squeeze(r, text);
  size_t size = text->size;
  if (!text->failed) {
    response = text->data ? MHD_create_response_from_buffer(text->size, text->data, MHD_RESPMEM_MUST_FREE)
                          : MHD_create_response_from_buffer(0, (void *)(uintptr_t) "", MHD_RESPMEM_PERSISTENT);
  }
  if (response) {
    *text = (api_text){0};
  } else {
    api_text_free(text);
  }
  take(r, status, response, size);
  reply_header(r, "Content-Type", mime);
  if (large) {
    add_coding(r, which);
  }
}

void reply_json(request *r, unsigned status, api_text *json) {
  reply_text(r, status, "application/json", json);
  reply_header(r, "Cache-Control", "no-store");
}

void reply_problem(request *r, api_problem *problem) {
  api_text text = {0};
  api_problem_write(problem, &text);
  unsigned status = (unsigned)api_problem_status(problem->name);
  if (r->wire > 0 && !r->body_done) {
    api_text_append(&r->refusal, text.data ? text.data : "", text.size);
  }
  reply_text(r, status, "application/problem+json", &text);
  reply_header(r, "Cache-Control", "no-store");
  if (status == 429 || status == 503) {
    char seconds[24];
    snprintf(seconds, sizeof seconds, "%lld", r->retry_s > 0 ? (long long)r->retry_s : 2);
    reply_header(r, "Retry-After", seconds);
  }
  if (strcmp(problem->name, "unsupported-encoding") == 0) {
    reply_header(r, "Accept-Encoding", "gzip, zstd");
  }
  if (status == 401) {
    reply_header(r, "WWW-Authenticate", "Bearer");
  }
  api_problem_free(problem);
}

void reply_refuse(request *r, const char *name, const char *format, ...) {
  char detail[512];
  api_problem problem = {0};
  va_list args;
  va_start(args, format);
  vsnprintf(detail, sizeof detail, format, args);
  va_end(args);
  api_refuse(&problem, name, "%s", detail);
  reply_problem(r, &problem);
}

void reply_bad_query(request *r, const char *parameter, const char *why) {
  api_problem problem = {0};
  api_refuse(&problem, "bad-query", "%s", why);
  api_json_member_string(&problem.facts, "parameter", parameter);
  reply_problem(r, &problem);
}

void reply_job_problem(request *r, const char *json) {
  const char *at = strstr(json, "\"status\":");
  int status = 0;
  if (!at || sscanf(at, "\"status\":%d", &status) != 1 || status < 400 || status > 599) {
    status = 500;
  }
  api_text text = {0};
  api_text_add(&text, json);
  reply_text(r, (unsigned)status, "application/problem+json", &text);
  reply_header(r, "Cache-Control", "no-store");
}

void reply_store(request *r, store_result result) {
  if (result == STORE_NOT_FOUND) {
    reply_refuse(r, "not-found",
                 "Nothing has this id: it may have been deleted, or belongs to another tenant. Check the id.");
  } else if (result == STORE_FULL) {
    reply_refuse(r, "storage-full", "The server's disk is full; nothing was stored. Free some space and try again.");
  } else if (result == STORE_AWAY) {
    reply_refuse(r, "unavailable", "The store of objects (S3) does not answer; nothing is lost. Try again soon.");
  } else if (result == STORE_LOST) {
    reply_refuse(
        r, "unavailable",
        "The connection to the catalogue (PostgreSQL) broke before this was stored; nothing is lost. Try again soon.");
  } else if (!catalogue_is_taken(r->srv->cat) &&
             (catalogue_is_away(r->srv->cat) || catalogue_was_away(r->srv->cat, r->began / 1000))) {
    reply_refuse(r, "unavailable", "The catalogue (PostgreSQL) does not answer; nothing is lost. Try again soon.");
  } else if (objects_is_read_only(r->srv->store)) {
    reply_refuse(r, "read-only",
                 "The server's data folder is on a read-only file system; nothing was stored. Stored results are still "
                 "served.");
  } else {
    reply_refuse(r, "internal",
                 "The store could not be read or written. Try again later; the daemon's log tells the operator why.");
  }
}

void reply_empty(request *r, unsigned status) {
  take(r, status, MHD_create_response_from_buffer(0, (void *)(uintptr_t) "", MHD_RESPMEM_PERSISTENT), 0);
}

void reply_bytes(request *r, unsigned status, const char *mime, const void *bytes, size_t size) {
  take(r, status, MHD_create_response_from_buffer(size, (void *)(uintptr_t)bytes, MHD_RESPMEM_PERSISTENT), size);
  reply_header(r, "Content-Type", mime);
}

static int names_tag(const request *r, const char *header, const char *etag, int (*matches)(const char *, const char *),
                     int *lines) {
  const char *text[HEADER_LINES];
  int named = 0;
  *lines = header_lines(r, header, text);
  for (int i = 0; i < *lines; i++) {
    named |= matches(text[i], etag);
  }
  return named;
}

/* Whether a header names the tag of this form or, for what it does to the resource, of any form. */
static int names_any(const request *r, const char *header, const char *etag, int (*matches)(const char *, const char *),
                     int *lines) {
  char form[48];
  int named = names_tag(r, header, etag, matches, lines);
  for (coding which = CODING_GZIP; *lines > 0 && which <= CODING_ZSTD; which++) {
    int plain = (int)strcspn(etag + 1, "-\"") + 1;
    snprintf(form, sizeof form, "%.*s-%s\"", plain, etag, coding_name(which));
    named |= names_tag(r, header, form, matches, lines);
    snprintf(form, sizeof form, "%.*s\"", plain, etag);
    named |= names_tag(r, header, form, matches, lines);
  }
  return named;
}

int reply_conditions(request *r, const char *etag) {
  int lines, reads = r->route->method[0] == 'G';
  if (!names_any(r, "If-Match", etag, parse_tag_matches_strong, &lines) && lines > 0) {
    reply_refuse(
        r, "precondition-failed",
        "The current ETag is %s, which If-Match does not name. Nothing was done. Send the current ETag, or omit "
        "If-Match.",
        etag);
    return 1;
  }
  if (!(reads ? names_tag : names_any)(r, "If-None-Match", etag, parse_tag_matches, &lines)) {
    return 0;
  }
  if (reads) {
    reply_empty(r, 304);
  } else {
    reply_refuse(r, "precondition-failed",
                 "The current ETag is %s, which If-None-Match excludes. Nothing was done. Omit If-None-Match.", etag);
  }
  return 1;
}

void reply_cached(request *r, unsigned status, const cached *entry) {
  static const char *const paths[RESOURCE_KINDS] = {"meshes", "embeddings", "supermeshes", "landmarks"};
  char location[128], key[64];
  int reads = r->route->method[0] == 'G';
  snprintf(key, sizeof key, "json %s", entry->etag);
  reply_choose(r, key, entry->etag, entry->row.json, entry->json_size);
  int decided = reads && reply_conditions(r, r->etag);
  if (decided && r->status != 304) {
    cache_release(r->srv->descriptions, entry);
    return;
  }
  if (!decided && !r->encoded && !request_holds(r, &r->answer_bytes, (int64_t)entry->json_size)) {
    refuse_held(r);
    cache_release(r->srv->descriptions, entry);
    return;
  }
  snprintf(location, sizeof location, "/v1/%s/%s", paths[entry->row.kind], entry->row.id);
  if (!decided && r->encoded) {
    reply_encoded(r, status, "application/json");
  } else if (!decided) {
    take(r, status, MHD_create_response_from_buffer(entry->json_size, entry->row.json, MHD_RESPMEM_MUST_COPY),
         entry->json_size);
    reply_header(r, "Content-Type", "application/json");
    add_coding(r, CODING_NONE);
  } else {
    add_coding(r, CODING_NONE);
  }
  reply_header(r, "ETag", r->etag);
  reply_header(r, "Cache-Control", "no-cache");
  if (r->route->method[0] == 'P') {
    reply_header(r, "Location", location);
    reply_header(r, "Content-Location", location);
  }
  cache_release(r->srv->descriptions, entry);
}
