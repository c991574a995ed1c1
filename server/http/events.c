/* GET /v1/jobs/{job}/events: server-sent events. The response is a stream that libmicrohttpd reads piece by piece. When
 * there is nothing to send, the reader suspends the connection and registers it as a waiter of the job; each event
 * resumes it. A comment every 15 s detects clients that have gone. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "http/http.h"
#include "metrics.h"

enum { PING_MS = 15000, BLOCK = 2048, ROWS = 64 };

typedef struct stream {
  waiter waiter;
  server *srv;
  struct MHD_Connection *connection;
  job *of;
  caller *caller;
  api_text pending;
  size_t sent;
  int64_t after, last_ms;
  int ended;
} stream;

static void suspend(waiter *w) {
  MHD_suspend_connection(((stream *)(void *)w)->connection);
}
static void resume(waiter *w) {
  MHD_resume_connection(((stream *)(void *)w)->connection);
}

/* Fills `pending`; 0 if there is nothing to send. */
static int fill(stream *s) {
  int ended;
  s->pending.size = s->sent = 0;
  s->after = queue_events_write(s->srv->q, s->of, s->after, &s->pending, &ended);
  s->ended = ended;
  if (s->pending.size == 0 && !ended && orb_clock_ms() - s->last_ms >= PING_MS - 500) {
    api_text_add(&s->pending, ": still there\n\n");
  }
  return s->pending.size > 0;
}

static ssize_t read_stream(void *user, uint64_t position, char *out, size_t room) {
  stream *s = user;
  (void)position;
  while (s->sent == s->pending.size) {
    if (s->ended || s->pending.failed || caller_revoked(s->caller) ||
        __atomic_load_n(&s->srv->stopping, __ATOMIC_ACQUIRE)) {
      return MHD_CONTENT_READER_END_OF_STREAM;
    }
    if (fill(s)) {
      break;
    }
    if (!s->ended) {
      s->waiter.wake = resume;
      s->waiter.events = 1;
      s->waiter.deadline = s->last_ms + PING_MS;
      if (queue_wait(s->srv->q, s->of, &s->waiter, s->after, suspend)) {
        return 0;
      }
    }
  }
  size_t n = s->pending.size - s->sent < room ? s->pending.size - s->sent : room;
  memcpy(out, s->pending.data + s->sent, n);
  s->sent += n;
  metrics_bytes(0, (int64_t)n);
  s->last_ms = orb_clock_ms();
  return (ssize_t)n;
}

static void free_stream(void *user) {
  stream *s = user;
  queue_release(s->srv->q, s->of);
  caller_release(s->caller);
  api_text_free(&s->pending);
  free(s);
}

static int64_t last_seen(const request *r) {
  const char *text = header_of(r, "Last-Event-ID");
  if (!text) {
    text = query_of(r, "last_event_id");
  }
  return parse_event_number(text);
}

static void add_headers(request *r) {
  reply_header(r, "Content-Type", "text/event-stream");
  reply_header(r, "Cache-Control", "no-store");
  reply_header(r, "X-Accel-Buffering", "no");
}

/* The client has seen every event: 204 stops an EventSource from reconnecting. */
static void reply_over(request *r) {
  reply_empty(r, 204);
}

/* Appends the stored events after a number; 0 if the catalogue cannot be read. */
static int write_stored(const request *r, int64_t after, api_text *text) {
  event_row events[ROWS];
  int n = ROWS;
  while (n == ROWS) {
    n = catalogue_events(r->srv->cat, r->id, after, ROWS, events);
    for (int i = 0; i < n; i++) {
      event_write(text, events[i].number, events[i].type, events[i].json);
      after = events[i].number;
      free(events[i].json);
    }
  }
  return n >= 0;
}

/* Whether the job has a stored event of this number. A client may name one that a crash lost; it then gets all events.
 */
static int is_event(const request *r, int64_t number) {
  event_row found = {0};
  int n = catalogue_events(r->srv->cat, r->id, number - 1, 1, &found);
  int same = n == 1 && found.number == number;
  free(found.json);
  return same;
}

/* Streams the events of a job in memory. Takes over the reference. */
static enum MHD_Result stream_job(request *r, job *j) {
  if (!access_sees(r, job_owner(j))) {
    queue_release(r->srv->q, j);
    reply_store(r, STORE_NOT_FOUND);
    return MHD_YES;
  }
  int over;
  int64_t after = queue_events_after(r->srv->q, j, last_seen(r), &over);
  if (over) {
    queue_release(r->srv->q, j);
    reply_over(r);
    return MHD_YES;
  }
  stream *s = calloc(1, sizeof *s);
  struct MHD_Response *response =
      s ? MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, BLOCK, read_stream, s, free_stream) : NULL;
  if (!response) {
    free(s);
    queue_release(r->srv->q, j);
    return MHD_NO;
  }
  s->srv = r->srv;
  s->connection = r->connection;
  s->of = j;
  s->caller = r->caller;
  r->caller = NULL; /* the stream owns the reference now */
  s->after = after;
  s->last_ms = orb_clock_ms();
  api_text_add(&s->pending, "retry: 2000\n\n");
  r->response = response;
  r->status = 200;
  r->phase = PHASE_SEND;
  add_headers(r);
  return MHD_YES;
}

/* A job that is not in memory runs on another node, or has ended: sends its stored events in one response. */
static void events_away(request *r) {
  job_row row;
  job *live = queue_follow(r->srv->q, r->id);
  if (live) {
    stream_job(r, live);
    return;
  }
  store_result result = catalogue_job_get(r->srv->cat, r->id, &row);
  if (result != STORE_OK) {
    reply_store(r, result);
    return;
  }
  int seen = access_sees(r, row.owner);
  job_row_free(&row);
  if (!seen) {
    reply_store(r, STORE_NOT_FOUND);
    return;
  }
  api_text text = {0};
  int64_t after = last_seen(r);
  int fine = write_stored(r, after, &text);
  if (fine && text.size == 0 && after > 0 && !is_event(r, after)) {
    fine = write_stored(r, 0, &text);
  }
  if (!fine) {
    api_text_free(&text);
    reply_store(r, STORE_ERROR);
    return;
  }
  if (text.size == 0 && !text.failed) {
    reply_over(r);
    return;
  }
  reply_text(r, 200, "text/event-stream", &text);
  reply_header(r, "Cache-Control", "no-store");
}

enum MHD_Result handle_job_events(request *r) {
  job *j = queue_find(r->srv->q, r->id);
  return j ? stream_job(r, j) : request_go_away(r, r->srv->io, events_away);
}
