#include "parts.h"

#include <string.h>
#include <unistd.h>

#include "evict.h"
#include "isolate/readers.h"
#include "log.h"
#include "net/client.h"
#include "scrub.h"
#include "store/object_removal.h"
#include "store/place.h"
#include "trace/send.h"

enum { CACHE_BYTES = 8 << 20 };

static int has_role(const config *options, const char *role) {
  return strcmp(options->role, role) == 0;
}

int parts_reload_callers(server *srv) {
  int fine = callers_reload(srv->callers) & signers_reload(srv->signers);
  if (fine) {
    queue_wake_once(srv->q); /* ends streams and waits whose token or key has been removed */
  } else {
    log_error("the tokens and keys could not be read again; the previous ones stay valid");
  }
  return fine;
}

/* Another node may have changed what this one has in memory. */
static void on_shared_change(void *user, const char *what) {
  server *srv = user;
  if (what[0] == 't') {
    parts_reload_callers(srv);
  } else if (what[0] == 'u') {
    callers_recount(srv->callers, what + 1);
  } else if (what[0] == '*') {
    cache_drop_all(srv->descriptions);
    parts_reload_callers(srv);
  } else if (what[0] == 'r' && what[1] >= '0' && what[1] < '0' + RESOURCE_KINDS) {
    cache_drop(srv->descriptions, (resource_kind)(what[1] - '0'), what + 2);
  }
}

static int may_deliver(void *q) {
  return queue_does_housekeeping(q);
}

static int start_outbox(server *srv, deliver_options *options) {
  options->may = may_deliver;
  options->user = srv->q;
  srv->outbox = deliver_start(options, srv->cat);
  if (srv->outbox) {
    queue_on_end(srv->q, deliver_wake, srv->outbox);
  }
  return srv->outbox != NULL;
}

/* A damaged catalogue would answer some requests and lose others: the service does not start on one. */
static int check_catalogue(const server *srv) {
  char why[512];
  if (catalogue_quick_check(srv->cat, why, sizeof why)) {
    return 1;
  }
  why[strcspn(why, "\n")] = 0;
  log_error(
      "the catalogue %s/catalogue.sqlite is damaged: %s. Restore a backup into a new folder (orbmorphd restore DIR "
      "--data "
      "NEW). Without a backup, keep a copy of the folder and save the readable rows with sqlite3 and its command "
      ".recover",
      srv->options->data, why);
  return 0;
}

static void heal(void *user, object_kind kind, const char *id) {
  const server *srv = user;
  const evict_env env = {.cat = srv->cat, .store = srv->store, .descriptions = srv->descriptions, .q = srv->q};
  evict_damaged(&env, kind, id);
}

/* From now on, damaged results are deleted and made again. */
static int heals(server *srv) {
  objects_on_quarantine(srv->store, heal, srv);
  return 1;
}

static int start_scrub(server *srv) {
  const config *o = srv->options;
  srv->scrub = scrub_start(srv->cat, srv->store, o->scrub_rate, 1000 * o->scrub_seconds);
  return srv->scrub || o->scrub_rate == 0;
}

static int start_traces(const config *o) {
  return !o->traces[0] ||
         trace_start(&(trace_options){.url = o->traces, .authorities = o->tls_authorities, .role = o->role});
}

static int open_stores(server *srv) {
  const store_place place = store_place_of(srv->options);
  store_result result = stores_open(&place, &srv->store, &srv->cat);
  srv->unfit = result == STORE_UNFIT;
  return result == STORE_OK;
}

int parts_start(server *srv, worker_pool **workers) {
  const config *o = srv->options;
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
  srv->memory = budget_create(o->job_memory);
  srv->arriving = temporary_create();
  const queue_sharing sharing = {.url = o->catalogue,
                                 .data = o->data,
                                 .works = !has_role(o, "serve"),
                                 .lease_ms = 1000 * o->lease_seconds,
                                 .changed = on_shared_change,
                                 .user = srv};
  queue_options queued = {.workers = (int)o->workers,
                          .cores = cores > 0 ? (int)cores : 1,
                          .limit = (int)o->queue_limit,
                          .memory = srv->memory,
                          .sharing = config_is_shared(o) ? &sharing : NULL};
  worker_options limits = {.workers = (int)o->workers,
                           .nice = (int)o->worker_nice,
                           .job_memory = o->job_memory,
                           .job_ms = 1000 * o->job_seconds,
                           .max_triangles = o->max_triangles,
                           .fetch = {.authorities = o->tls_authorities,
                                     .check_ms = 1000 * o->check_seconds,
                                     .memory = srv->memory,
                                     .arriving = srv->arriving,
                                     .max_triangles = o->max_triangles,
                                     .total_ms = 1000 * o->fetch_seconds,
                                     .most = o->max_body,
                                     .disk_reserve = o->disk_reserve}};
  deliver_options delivered = {.authorities = o->tls_authorities, .retry_ms = 1000 * o->webhook_retry_seconds};
  char wrong[NETWORKS_WRONG];
  networks_read(o->webhook_allow, &srv->webhook_allowed, wrong); /* config.c has checked them */
  networks_read(o->fetch_allow, &srv->fetch_allowed, wrong);
  delivered.allowed = srv->webhook_allowed;
  limits.fetch.allowed = srv->fetch_allowed;
  if (queued.cores < queued.workers) {
    queued.cores = queued.workers;
  }
  srv->works_only = has_role(o, "work");
  const char *where = srv->works_only ? o->metrics_listen : o->listen;
  int listens = !where[0] || listen_open(o, where, &srv->at);
  srv->needs_token = strcmp(o->auth, "on") == 0 || (strcmp(o->auth, "off") != 0 && !srv->at.local);
  return listens && srv->memory && srv->arriving && open_stores(srv) && check_catalogue(srv) &&
         (srv->callers = callers_open(srv->cat)) && (srv->signers = signers_open(srv->cat)) &&
         (srv->descriptions = cache_create(CACHE_BYTES)) && (srv->q = queue_create(&queued, srv->cat)) &&
         queue_recover(srv->q, isolate_is_on()) == STORE_OK && heals(srv) &&
         (srv->io = tasks_start((int)o->io_threads, NULL)) && readers_start(srv->memory) &&
         (srv->checks = tasks_start((int)o->workers, srv->memory)) &&
         (srv->large_checks = tasks_start((int)o->workers, srv->memory)) && net_start() && start_traces(o) &&
         start_outbox(srv, &delivered) &&
         (!sharing.works || (*workers = worker_pool_start(&limits, srv->q, srv->cat, srv->store))) &&
         (srv->at.fd < 0 || http_start(srv)) && start_scrub(srv);
}

void parts_stop(server *srv, worker_pool *workers) {
  __atomic_store_n(&srv->stopping, 1, __ATOMIC_RELEASE);
  scrub_stop(srv->scrub);
  if (srv->q) {
    queue_stop(srv->q, 1);
    worker_pool_join(workers);
    queue_wake_all(srv->q);
  }
  if (srv->daemon) {
    MHD_quiesce_daemon(srv->daemon);
  }
  tasks_stop(srv->io); /* runs the remaining tasks, which resume their connections or go on in `checks` */
  tasks_stop(srv->checks);
  tasks_stop(srv->large_checks);
  http_stop(srv);
  listen_remove(&srv->at);
  if (srv->signers) {
    signers_store_use(srv->signers);
  }
  deliver_stop(srv->outbox); /* workers and tasks have ended and no longer wake it */
  readers_stop();            /* they give memory back, and the budget tells the queue and the pools */
  queue_destroy(srv->q);
  tasks_free(srv->io);
  tasks_free(srv->checks);
  tasks_free(srv->large_checks);
  budget_destroy(srv->memory);
  temporary_destroy(srv->arriving);
  catalogue_close(srv->cat);
  objects_close(srv->store);
  cache_destroy(srv->descriptions);
  callers_close(srv->callers);
  signers_close(srv->signers);
  trace_stop(); /* all threads that make spans have ended */
}
