/* Jobs: GET, lists and DELETE (cancelling), and waiting for a job to end. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>

#include "http/http.h"

enum { LOOK_MS = 15000, CANCEL_WAIT_MS = 2000 };

int64_t read_wait_ms(request *r) {
  const char *query = query_of(r, "wait"), *prefer[HEADER_LINES];
  int lines = query ? 0 : header_lines(r, "Prefer", prefer);
  int64_t wait = query ? parse_wait_ms(query) : 0;
  for (int i = 0; i < lines && wait == 0; i++) {
    wait = parse_preferred_ms(prefer[i]);
  }
  if (wait < 0) {
    reply_bad_query(r, "wait", "\"wait\" must be a number of seconds; values above 60 mean 60.");
  }
  r->preferred_ms = wait > 0 && !query ? wait : 0;
  return wait;
}

static void refuse_ended(request *r, api_job_state state) {
  reply_refuse(r, "job-ended",
               "The job has already %s, so there is nothing to cancel. GET it for its result or its problem.",
               api_job_state_name(state));
}

/* Responds with the job. A request that cancels it is refused if the job succeeded or failed first. */
static void reply_job(request *r, job *j) {
  api_text json = {0};
  api_job_state state = queue_job_write(r->srv->q, j, &json);
  if (r->cancels && (state == API_JOB_SUCCEEDED || state == API_JOB_FAILED)) {
    api_text_free(&json);
    refuse_ended(r, state);
    return;
  }
  reply_json(r, 200, &json);
  if (!api_job_ended(state)) {
    reply_header(r, "Retry-After", "1");
  }
}

static void suspend(waiter *w) {
  request *r = (request *)(void *)((char *)w - offsetof(request, waiter));
  MHD_suspend_connection(r->connection);
}
static void resume(waiter *w) {
  request *r = (request *)(void *)((char *)w - offsetof(request, waiter));
  MHD_resume_connection(r->connection);
}

static int peer_is_gone(const request *r) {
  const union MHD_ConnectionInfo *info = MHD_get_connection_info(r->connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  char byte;
  if (!info) {
    return 0;
  }
  ssize_t n = recv(info->connect_fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return n == 0 || (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

static void result_away(request *r) {
  store_result result;
  job *j = r->waits_for;
  static const resource_kind kinds[API_JOB_KINDS] = {RESOURCE_EMBEDDING, RESOURCE_SUPERMESH, RESOURCE_MESH};
  const cached *entry = find_description(r->srv, kinds[job_kind(j)], job_result(j), access_tenant(r), &result);
  if (entry && r->waits_for_what == WAIT_ASSET) {
    reply_asset(r, entry);
  } else if (entry) {
    reply_cached(r, 200, entry);
  } else {
    reply_store(r, result);
  }
}

/* The job has not made the asset: its problem, or when to ask again. */
static void refuse_asset(request *r, job *j, api_job_state state) {
  api_problem problem = {0};
  char *why = queue_job_problem(r->srv->q, j), url[64];
  snprintf(url, sizeof url, "/v1/jobs/%s", job_id(j));
  if (why) {
    reply_job_problem(r, why);
  } else if (state == API_JOB_CANCELLED) {
    reply_refuse(r, "cancelled", "A client cancelled the job that computes this morph; request it again.");
  } else {
    api_refuse(&problem, "not-ready", "The morph is still being computed; request it again after Retry-After seconds.");
    api_json_member_string(&problem.facts, "url", url);
    reply_problem(r, &problem);
  }
  free(why);
}

static enum MHD_Result waited_enough(request *r) {
  job *j = r->waits_for;
  if (r->waits_for_what == WAIT_JOB) {
    reply_job(r, j);
    return MHD_YES;
  }
  api_text json = {0};
  api_job_state state = queue_job_write(r->srv->q, j, &json);
  if (state != API_JOB_SUCCEEDED && r->waits_for_what == WAIT_ASSET) {
    api_text_free(&json);
    refuse_asset(r, j, state);
    return MHD_YES;
  }
  if (state == API_JOB_SUCCEEDED) {
    api_text_free(&json);
    return request_go_away(r, r->srv->io, result_away);
  }
  char location[64];
  snprintf(location, sizeof location, "/v1/jobs/%s", job_id(j));
  reply_json(r, 202, &json);
  reply_header(r, "Location", location);
  reply_header(r, "Retry-After", "1");
  return MHD_YES;
}

enum MHD_Result handle_wait(request *r) {
  int64_t now = orb_clock_ms();
  if (now < r->wait_until) {
    if (peer_is_gone(r) || caller_revoked(r->caller) || signer_revoked(r->signer)) {
      return MHD_NO;
    }
    r->waiter.wake = resume;
    r->waiter.events = 0;
    r->waiter.deadline = r->wait_until < now + LOOK_MS ? r->wait_until : now + LOOK_MS;
    if (queue_wait(r->srv->q, r->waits_for, &r->waiter, 0, suspend)) {
      return MHD_YES;
    }
  }
  return waited_enough(r);
}

static void write_row(const job_row *row, api_text *out) {
  api_job_view view = {.id = row->id,
                       .result = row->result[0] ? row->result : row->key,
                       .stage = NULL,
                       .problem = api_job_ended(row->state) ? row->problem : NULL,
                       .kind = row->kind,
                       .state = row->state,
                       .progress = row->state == API_JOB_SUCCEEDED ? 1 : 0,
                       .attempt = row->attempt,
                       .created = row->created,
                       .started = row->started,
                       .finished = row->finished};
  api_job_write(&view, out);
}

/* Responds with a job in memory, or waits for it. Takes over the reference. */
static void get_live(request *r, job *j) {
  if (!access_sees(r, job_owner(j))) {
    reply_store(r, STORE_NOT_FOUND);
  } else if (r->wait_until > 0) {
    r->waits_for = j;
    r->phase = PHASE_WAIT;
    return;
  } else {
    reply_job(r, j);
  }
  queue_release(r->srv->q, j);
}

static void get_away(request *r) {
  job *live = queue_follow(r->srv->q, r->id);
  if (live) {
    get_live(r, live);
    return;
  }
  job_row row;
  store_result result = catalogue_job_get(r->srv->cat, r->id, &row);
  if (result != STORE_OK) {
    reply_store(r, result);
    return;
  }
  if (access_sees(r, row.owner)) {
    api_text json = {0};
    write_row(&row, &json);
    reply_json(r, 200, &json);
  } else {
    reply_store(r, STORE_NOT_FOUND);
  }
  job_row_free(&row);
}

enum MHD_Result handle_job_get(request *r) {
  int64_t wait = read_wait_ms(r);
  if (wait < 0) {
    return MHD_YES;
  }
  r->wait_until = wait ? orb_clock_ms() + wait : 0;
  job *j = queue_find(r->srv->q, r->id);
  if (!j) {
    return request_go_away(r, r->srv->io, get_away);
  }
  get_live(r, j);
  return r->phase == PHASE_WAIT ? handle_wait(r) : MHD_YES;
}

static void cancel_away(request *r) {
  server *srv = r->srv;
  job *j = queue_follow(srv->q, r->id);
  if (!j) { /* not in memory: it ended long ago, or does not exist */
    job_row row;
    store_result result = catalogue_job_get(srv->cat, r->id, &row);
    if (result != STORE_OK) {
      reply_store(r, result);
      return;
    }
    if (!access_sees(r, row.owner)) {
      reply_store(r, STORE_NOT_FOUND);
    } else if (row.state == API_JOB_CANCELLED) {
      api_text json = {0};
      write_row(&row, &json);
      reply_json(r, 200, &json);
    } else {
      refuse_ended(r, row.state);
    }
    job_row_free(&row);
    return;
  }
  if (!access_sees(r, job_owner(j))) {
    reply_store(r, STORE_NOT_FOUND);
    queue_release(srv->q, j);
    return;
  }
  api_text json = {0};
  api_job_state state = queue_job_write(srv->q, j, &json);
  api_text_free(&json);
  if (state == API_JOB_SUCCEEDED || state == API_JOB_FAILED) {
    refuse_ended(r, state);
    queue_release(srv->q, j);
    return;
  }
  store_result result = queue_cancel(srv->q, j);
  if (result != STORE_OK) {
    reply_store(r, result);
    queue_release(srv->q, j);
    return;
  }
  r->cancels = 1;
  r->waits_for = j;
  r->wait_until = orb_clock_ms() + CANCEL_WAIT_MS;
  r->phase = PHASE_WAIT;
}

enum MHD_Result handle_job_cancel(request *r) {
  return request_go_away(r, r->srv->io, cancel_away);
}

static api_job_state write_live(request *r, const job_row *row, api_text *out) {
  job *live = row->state == API_JOB_QUEUED    ? queue_find(r->srv->q, row->id)
              : row->state == API_JOB_RUNNING ? queue_follow(r->srv->q, row->id)
                                              : NULL;
  api_job_state state = row->state;
  if (live) {
    state = queue_job_write(r->srv->q, live, out);
    queue_release(r->srv->q, live);
  } else {
    write_row(row, out);
  }
  return state;
}

/* Adds a job to the list if its state is wanted (state < 0: any) and there is room. 1 if its state is wanted. */
static int add_to_list(request *r, const job_row *row, int state, int room, api_text *out) {
  api_text json = {0};
  int shown = (int)write_live(r, row, &json), taken = state < 0 || shown == state;
  if (taken && room) {
    api_json_raw(out, json.data ? json.data : "null");
    out->failed |= json.failed;
  }
  api_text_free(&json);
  return taken;
}

static void list_away(request *r) {
  int state = -1;
  const char *state_text = query_of(r, "state");
  list_page page;
  int64_t last = 0;
  if (state_text && (state = api_job_state_of_name(state_text)) < 0) {
    reply_bad_query(r, "state", "\"state\" must be queued, running, succeeded, failed or cancelled.");
    return;
  }
  if (!list_begin(r, "jobs", sizeof(job_row), &page)) {
    return;
  }
  /* A job that is queued in the catalogue is shown as running while an embedding that it needs runs. The filter
   * applies to the shown state, so the query asks for both. */
  int asked = state >= 0 && !api_job_ended((api_job_state)state) ? CATALOGUE_UNFINISHED : state;
  job_row *rows = page.rows;
  const char *view = access_view(r);
  int64_t before = page.before;
  int found = 0, count;
  do {
    count = catalogue_job_list(r->srv->cat, view[0] ? view : NULL, page.prefix, asked, before, page.limit + 1, rows);
    for (int i = 0; i < count; i++) {
      before = rows[i].seq;
      if (found <= page.limit && add_to_list(r, &rows[i], state, found < page.limit, &page.json)) {
        last = found < page.limit ? before : last;
        found++;
      }
      job_row_free(&rows[i]);
    }
  } while (count == page.limit + 1 && found <= page.limit);
  list_end(r, &page, last, count < 0 ? count : found);
}

enum MHD_Result handle_job_list(request *r) {
  return request_go_away(r, r->srv->io, list_away);
}
