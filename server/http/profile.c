/* Profiles of an asset: made from the stored asset on the first request, once, and kept as objects beside it. A process
 * of its own makes them (convert.h). */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "convert.h"
#include "evict.h"
#include "faults.h"
#include "http/http.h"
#include "log.h"
#include "store/keys.h"
#include "store/object_removal.h"
#include "store/owners.h"
#include "store/verify.h"

/* A profile that a thread makes, and the requests that wait for it. */
typedef struct flight {
  struct flight *next;
  char id[API_ID_SIZE];
  int profile;
  request *waiting; /* linked by next_waiting */
} flight;

static struct {
  pthread_mutex_t lock;
  flight *first;
} flights = {.lock = PTHREAD_MUTEX_INITIALIZER};

int profile_read(request *r) {
  const char *name = query_of(r, "profile");
  api_problem problem = {0};
  r->profile = ORB_PROFILE_FLOAT;
  while (name && r->profile < ORB_PROFILES && strcmp(orb_profile_name((orb_profile)r->profile), name) != 0) {
    r->profile++;
  }
  if (r->profile < ORB_PROFILES) {
    return 1;
  }
  api_refuse(&problem, "bad-query", "\"profile\" must be float, quantized or meshopt.");
  api_json_member_string(&problem.facts, "parameter", "profile");
  reply_problem(r, &problem);
  return 0;
}

/* The description as it is in the catalogue now; the one in memory may be older than the profile. */
static const cached *read_again(request *r, store_result *result) {
  resource row = {0};
  const char *view = r->route->id == ROUTE_MORPH ? access_tenant(r) : access_view(r);
  unsigned long long since = cache_drops(r->srv->descriptions);
  *result = view[0] ? catalogue_get_of(r->srv->cat, RESOURCE_SUPERMESH, r->id, view, &row)
                    : catalogue_get(r->srv->cat, RESOURCE_SUPERMESH, r->id, &row);
  const cached *entry = *result == STORE_OK ? cache_add(r->srv->descriptions, &row, view, since) : NULL;
  *result = *result == STORE_OK && !entry ? STORE_ERROR : *result;
  return entry;
}

/* A profile that is made, for the request that makes it and those that wait. */
typedef struct making {
  request *r;
  flight *mine;
} making;

static int is_wanted(void *user) {
  const making *m = user;
  pthread_mutex_lock(&flights.lock);
  const int others = m->mine->waiting != NULL;
  pthread_mutex_unlock(&flights.lock);
  return request_is_wanted(m->r) || (others && !__atomic_load_n(&m->r->srv->stopping, __ATOMIC_ACQUIRE));
}

/* Converts the asset to a temporary file. 1, or 0 with the problem. */
static int convert(request *r, orb_context *ctx, const convert_limits *limits, object_temp *out, api_problem *problem) {
  int fd;
  uint64_t size;
  resource row = {0};
  store_result found = catalogue_get(r->srv->cat, RESOURCE_SUPERMESH, r->id, &row);
  found = found == STORE_OK ? verify_once(r->srv->store, OBJECT_ASSET, r->id, row.sha) : found;
  resource_free(&row);
  found = found == STORE_OK ? objects_read(r->srv->store, OBJECT_ASSET, r->id, &fd, &size) : found;
  if (found != STORE_OK) {
    objects_settle(r->srv->store);
    int gone = found == STORE_NOT_FOUND && !evict_is_named(r->srv->cat, OBJECT_ASSET, r->id);
    return api_refuse(problem, gone ? "not-found" : "internal", "%s",
                      gone
                          ? "Nothing has this id: it may have been deleted, or belongs to another tenant. Check the id."
                      : found == STORE_NOT_FOUND
                          ? "The server has lost this file. DELETE the resource, then request it again."
                          : "The store could not be read. Try again later; the daemon's log tells the operator why.");
  }
  int fine = convert_asset(r->srv->cat, r->srv->store, ctx, r->id, (orb_profile)r->profile, fd, (int64_t)size,
                           access_tenant(r), limits, out, problem);
  close(fd);
  if (!fine && strcmp(problem->name, "cancelled") == 0) {
    api_refuse(problem, "unavailable",
               "The server is stopping, or the connection of this request ended; try again soon.");
  }
  return fine;
}

enum { LOST_TRIES = 3 };

/* Names the object in the row after it is published. */
static store_result add_profile(request *r, const char *sha, int64_t bytes) {
  store_result stored = catalogue_add_profile(r->srv->cat, r->id, r->profile - 1, sha, bytes);
  for (int i = 0; stored == STORE_LOST && i < LOST_TRIES; i++) {
    objects_hold_again(r->srv->store);
    stored = objects_look(r->srv->store, object_of_profile(r->profile - 1), r->id);
    stored = stored == STORE_OK ? catalogue_add_profile(r->srv->cat, r->id, r->profile - 1, sha, bytes) : STORE_ERROR;
  }
  return stored;
}

static void profile_away(request *r);

static store_result store_profile(request *r, object_temp *temp, int64_t *bytes) {
  server *srv = r->srv;
  char sha[API_ID_SIZE];
  object_kind kind = object_of_profile(r->profile - 1);
  *bytes = (int64_t)lseek(temp->fd, 0, SEEK_END);
  if (*bytes < 0 || !verify_hash(temp->fd, sha)) {
    return STORE_ERROR;
  }
  if (objects_free_bytes(srv->store) < (uint64_t)srv->options->disk_reserve) { /* with the temporary file */
    return STORE_FULL;
  }
  objects_hold(srv->store);
  store_result stored = objects_publish(srv->store, temp, kind, r->id);
  FAULT_POINT("profile-published");
  stored = stored == STORE_OK ? add_profile(r, sha, *bytes) : stored;
  objects_let_go(srv->store);
  if (stored == STORE_NOT_FOUND) {
    evict_unnamed(srv->cat, srv->store, kind, r->id);
  }
  return stored;
}

/* Makes it within the memory of the task. 1, or 0 with a response, or the request goes on with all the memory that a
 * profile may have. */
static int make(request *r, flight *mine) {
  const config *options = r->srv->options;
  const int64_t memory = r->away_task.memory, most = budget_for_profile(r->srv->memory, INT64_MAX);
  orb_context_options limits = {
      .memory_limit = (size_t)memory, .threads = 1, .deadline_ms = orb_clock_ms() + 1000 * options->job_seconds};
  making what = {r, mine};
  const convert_limits work = {.memory = memory, .deadline_ms = limits.deadline_ms, .wanted = is_wanted, .user = &what};
  orb_context *ctx = NULL;
  object_temp out = {.fd = -1};
  api_problem problem = {0};
  int64_t began = orb_clock_ms(), bytes = 0;
  if (!sign_may_work(r, &problem)) {
    reply_problem(r, &problem);
    return 0;
  }
  if (orb_context_create(&limits, &ctx) != ORB_OK) {
    reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
    return 0;
  }
  int fine = convert(r, ctx, &work, &out, &problem);
  store_result stored = fine ? store_profile(r, &out, &bytes) : STORE_OK;
  int64_t took = orb_clock_ms() - began;
  if (r->signer) {
    catalogue_key_use(r->srv->cat, r->signer->row.name, (int64_t)time(NULL) / 86400, 0, took);
  }
  if (fine && stored == STORE_OK) {
    char fields[REQUEST_FIELDS + 160];
    request_fields(r, fields);
    size_t n = strlen(fields);
    snprintf(fields + n, sizeof fields - n, ",\"id\":\"%s\",\"bytes\":%lld,\"ms\":%lld", r->id, (long long)bytes,
             (long long)took);
    log_write(LOG_INFO, fields, "profile %s made", orb_profile_name((orb_profile)r->profile));
    __atomic_add_fetch(&r->srv->profiles_made, 1, __ATOMIC_RELAXED);
  } else if (fine) {
    reply_store(r, stored);
  } else if (memory < most && strcmp(problem.name, "no-memory") == 0) {
    api_problem_free(&problem);
    request_go_on(r, r->srv->large_checks, most, profile_away);
  } else {
    reply_problem(r, &problem);
  }
  objects_abandon(&out);
  orb_context_destroy(ctx);
  return fine && stored == STORE_OK;
}

/* Takes the flight of this profile, or waits for the thread that has it. 0: another thread owns the request now. */
static int take_flight(request *r, flight *mine) {
  pthread_mutex_lock(&flights.lock);
  flight *at = flights.first;
  while (at && (at->profile != r->profile || strcmp(at->id, r->id) != 0)) {
    at = at->next;
  }
  if (at) {
    r->next_waiting = at->waiting;
    at->waiting = r;
    request_handed_over();
  } else {
    *mine = (flight){.next = flights.first, .profile = r->profile};
    memcpy(mine->id, r->id, sizeof mine->id);
    flights.first = mine;
  }
  pthread_mutex_unlock(&flights.lock);
  return at == NULL;
}

/* Ends the flight. The waiting requests check again. They find the profile, or one of them tries to make it. */
static void land(request *r, flight *mine) {
  pthread_mutex_lock(&flights.lock);
  flight **at = &flights.first;
  while (*at != mine) {
    at = &(*at)->next;
  }
  *at = mine->next;
  pthread_mutex_unlock(&flights.lock);
  for (request *next, *w = mine->waiting; w; w = next) {
    next = w->next_waiting;
    tasks_add(r->srv->large_checks, &w->away_task);
  }
}

/* Sends the profile if it is stored. 1 with a response, also if there is no supermesh; 0: it has to be made. *bytes: of
 * the supermesh; may be NULL. */
static int send_if_stored(request *r, int64_t *bytes) {
  store_result result;
  const cached *entry = read_again(r, &result);
  if (!entry) {
    reply_store(r, result);
    return 1;
  }
  if (bytes) {
    *bytes = entry->row.bytes;
  }
  r->phase = PHASE_AWAY; /* also after a first answer that the object is lost */
  return reply_stored_asset(r, entry) && r->status != 404;
}

/* The task has no memory yet, or waited for it until nobody wanted the profile. */
static void wait_for_memory(request *r, int64_t bytes) {
  if (request_is_wanted(r)) {
    request_go_on(r, r->srv->large_checks, budget_for_profile(r->srv->memory, bytes), profile_away);
  } else {
    reply_refuse(r, "unavailable", "The server is stopping, or the connection of this request ended; try again soon.");
  }
}

/* Makes the profile of the supermesh r->id unless it exists, and sends it. Blocks. */
static void profile_away(request *r) {
  flight mine;
  int64_t bytes = 0;
  if (!send_if_stored(r, &bytes)) {
    if (r->away_task.memory == 0) {
      wait_for_memory(r, bytes);
      return;
    }
    if (!take_flight(r, &mine)) {
      return;
    }
    if (!send_if_stored(r, NULL) && make(r, &mine) && !send_if_stored(r, NULL)) {
      reply_lost(r);
    }
    land(r, &mine);
  }
  if (r->status == 404 && r->make_again) { /* the asset was damaged, and its row is gone */
    reply_drop(r);
    request_go_on(r, r->srv->io, 0, r->make_again);
  }
}

int reply_asset(request *r, const cached *entry) {
  int in_task = r->phase == PHASE_AWAY;
  int done = reply_stored_asset(r, entry);
  if (r->profile == ORB_PROFILE_FLOAT || (done && r->status != 404)) {
    return done;
  }
  if (in_task) { /* not made, or lost */
    r->status = 0;
    request_go_on(r, r->srv->large_checks, 0, profile_away);
  }
  return in_task;
}
