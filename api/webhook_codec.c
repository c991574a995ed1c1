#include "api/webhook_codec.h"

#include <stdio.h>
#include <string.h>

#include "api/options.h"

enum { EVENTS = 3 };

static const char *name_of(int event) {
  return api_job_state_name((api_job_state)((int)API_JOB_SUCCEEDED + event));
}

static int add_event(const char *name, size_t length, unsigned *events) {
  for (int i = 0; i < EVENTS; i++) {
    if (strlen(name_of(i)) == length && strncmp(name_of(i), name, length) == 0) {
      *events |= 1U << i;
      return 1;
    }
  }
  return 0;
}

int api_events_parse(const char *list, unsigned *out) {
  *out = 0;
  for (const char *at = list;; at++) {
    size_t length = strcspn(at, ",");
    if (!add_event(at, length, out)) {
      return 0;
    }
    at += length;
    if (!*at) {
      return 1;
    }
  }
}

void api_events_write(unsigned events, char out[API_EVENTS_TEXT]) {
  size_t n = 0;
  out[0] = 0;
  for (int i = 0; i < EVENTS; i++) {
    if (events & 1U << i) {
      n += (size_t)snprintf(out + n, API_EVENTS_TEXT - n, "%s%s", n ? "," : "", name_of(i));
    }
  }
}

static int read_events(const cJSON *list, unsigned *events, api_problem *problem) {
  const cJSON *item;
  int fine = cJSON_IsArray(list) && list->child;
  *events = 0;
  cJSON_ArrayForEach(item, list) {
    fine = fine && cJSON_IsString(item) && add_event(item->valuestring, strlen(item->valuestring), events);
  }
  return fine || api_refuse(problem, "invalid-request",
                            "\"events\" of \"webhook\" must be an array of succeeded, failed and cancelled.");
}

static int read_hook(const cJSON *hook, api_webhook *out, api_problem *problem) {
  static const char *const known[] = {"url", "events", NULL};
  if (!cJSON_IsObject(hook)) {
    return api_refuse(problem, "invalid-request", "\"webhook\" must be an object such as {\"url\": \"https://…\"}.");
  }
  if (!api_members_known(hook, "\"webhook\"", known, problem)) {
    return 0;
  }
  const cJSON *url = cJSON_GetObjectItemCaseSensitive(hook, "url");
  const cJSON *events = cJSON_GetObjectItemCaseSensitive(hook, "events");
  if (!cJSON_IsString(url) || !url->valuestring[0] || strlen(url->valuestring) >= sizeof out->url) {
    return api_refuse(problem, "invalid-request", "\"url\" of \"webhook\" must be a URL of at most %d bytes.",
                      API_WEBHOOK_URL - 1);
  }
  strcpy(out->url, url->valuestring);
  out->events = API_EVENTS_ALL;
  return !events || read_events(events, &out->events, problem);
}

int api_webhook_take(cJSON *body, api_webhook *out, api_problem *problem) {
  out->url[0] = 0;
  out->events = 0;
  cJSON *hook = cJSON_IsObject(body) ? cJSON_DetachItemFromObjectCaseSensitive(body, "webhook") : NULL;
  int fine = !hook || read_hook(hook, out, problem);
  cJSON_Delete(hook);
  return fine;
}

void api_webhook_body_write(api_job_state state, int64_t finished, const char *job, api_text *out) {
  api_json_open(out, '{');
  api_json_key(out, "type");
  api_text_printf(out, "\"job.%s\"", api_job_state_name(state));
  api_json_member_instant(out, "timestamp", finished);
  api_json_member_raw(out, "data", job);
  api_json_close(out, '}');
}

void api_message_id(const char *job, int number, char out[API_MESSAGE_ID]) {
  snprintf(out, API_MESSAGE_ID, "msg_%.32s_%d", job, number);
}

static void text_or_null(api_text *out, const char *name, const char *text) {
  if (text[0]) {
    api_json_member_string(out, name, text);
  } else {
    api_json_key(out, name);
    api_json_null(out);
  }
}

void api_delivery_write(const api_delivery_view *d, api_text *out) {
  static const char *const states[] = {"pending", "delivered", "failed"};
  char id[API_MESSAGE_ID];
  api_message_id(d->job, d->number, id);
  api_json_open(out, '{');
  api_json_member_integer(out, "number", d->number);
  api_json_member_string(out, "id", id);
  text_or_null(out, "webhook", d->webhook);
  api_json_member_string(out, "url", d->url);
  api_json_member_string(out, "type", d->type);
  api_json_member_string(out, "state", states[d->state]);
  api_json_member_integer(out, "attempts", d->attempts);
  api_json_key(out, "status");
  if (d->status) {
    api_json_integer(out, d->status);
  } else {
    api_json_null(out);
  }
  text_or_null(out, "error", d->error);
  api_json_member_instant(out, "created", d->created);
  api_json_member_instant(out, "next_attempt", d->state == API_DELIVERY_PENDING ? d->next : 0);
  api_json_member_instant(out, "finished", d->ended);
  api_json_close(out, '}');
}
