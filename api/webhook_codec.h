/* The JSON of webhooks and their deliveries: https://www.standardwebhooks.com. */
#ifndef ORB_API_WEBHOOK_CODEC_H
#define ORB_API_WEBHOOK_CODEC_H

#include <cjson/cJSON.h>

#include "api/job_codec.h"
#include "api/problem.h"

/* Events are a set of bits: of each state in which a job ends, API_EVENT(state). The catalogue stores these numbers. */
#define API_EVENT(state) (1U << ((unsigned)(state) - (unsigned)API_JOB_SUCCEEDED))
enum { API_EVENTS_ALL = 7, API_EVENTS_TEXT = 40, API_WEBHOOK_URL = 2048 };

/* Parses a list such as "succeeded,failed". Returns 0 if one of the names is not an event, or there is none. */
int api_events_parse(const char *list, unsigned *out);
void api_events_write(unsigned events, char out[API_EVENTS_TEXT]);

/* The member "webhook" of a request: {"url", "events"}. Without events: all. Does not check whether the service may
 * reach the URL. */
typedef struct api_webhook {
  char url[API_WEBHOOK_URL]; /* "": the request has none */
  unsigned events;
} api_webhook;
/* Removes the member from the body. Returns 1, or 0 with *problem filled. */
int api_webhook_take(cJSON *body, api_webhook *out, api_problem *problem);

/* The body of a delivery. job: the job as JSON. */
void api_webhook_body_write(api_job_state state, int64_t finished, const char *job, api_text *out);

/* The catalogue stores these numbers. */
typedef enum api_delivery_state {
  API_DELIVERY_PENDING,
  API_DELIVERY_DELIVERED,
  API_DELIVERY_FAILED
} api_delivery_state;
typedef struct api_delivery_view {
  const char *job, *webhook, *url, *type; /* webhook: its name; "": that of the job's request */
  const char *error;                      /* of the last attempt; "": none */
  api_delivery_state state;
  int number, attempts, status; /* status: of the last answer; 0: none */
  int64_t created, next, ended; /* next: of the next attempt; ms since 1970, 0: none */
} api_delivery_view;
void api_delivery_write(const api_delivery_view *delivery, api_text *out);
/* The webhook-id of a delivery; the same in every attempt. */
enum { API_MESSAGE_ID = 48 };
void api_message_id(const char *job, int number, char out[API_MESSAGE_ID]);

#endif
