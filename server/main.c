/* orbmorphd: command line, start, signals, stop. start() shows all parts in order. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "admin/kinds.h"
#include "backup.h"
#include "control.h"
#include "evict.h"
#include "folder_lock.h"
#include "housekeeping.h"
#include "http/certificate.h"
#include "http/http.h"
#include "isolate/readers.h"
#include "log.h"
#include "maintain.h"
#include "migrate.h"
#include "net/client.h"
#include "scrub.h"
#include "store/object_removal.h"
#include "store/place.h"
#include "systemd.h"
#include "trace/send.h"
#include "worker/confined.h"
#include "worker/pool.h"

enum { CACHE_BYTES = 64 << 20 };

static const admin_kind *const admin_kinds[] = {&admin_token, &admin_key, &admin_webhook, &admin_crash, NULL};

static void raise_descriptor_limit(void) {
  struct rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    limit.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0) {
      log_warn("the limit on open files could not be raised");
    }
  }
}

static int has_role(const config *options, const char *role) {
  return strcmp(options->role, role) == 0;
}

static void announce(const server *srv) {
  const char *text = srv->at.text;
  if (srv->at.fd < 0) {
    puts("orbmorphd works without a port");
  } else if (srv->works_only) {
    printf("orbmorphd works; metrics on %s%s\n",
           strncmp(text, "unix:", 5) == 0 ? ""
           : srv->options->tls_key[0]     ? "https://"
                                          : "http://",
           text);
  } else if (strncmp(text, "unix:", 5) == 0) {
    printf("orbmorphd listening on %s\n", text);
  } else {
    printf("orbmorphd listening on http%s://%s\n", srv->options->tls_key[0] ? "s" : "", text);
  }
  fflush(stdout);
  systemd_notify("READY=1\nSTATUS=serving\n");
}

/* Signals come through a pipe. A signalfd would miss some: threads that libraries start before main() do not block
 * signals, and the kernel may deliver to those threads. */
static int signal_pipe[2] = {-1, -1};

static void on_signal(int number) {
  int saved = errno;
  unsigned char byte = (unsigned char)number;
  ssize_t written = write(signal_pipe[1], &byte, 1);
  (void)written; /* if the pipe is full, enough signals are waiting */
  errno = saved;
}

/* Blocks the signals for later threads. Returns the read end of the pipe, or −1. */
static int take_signals(sigset_t *set) {
  struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART};
  static const int numbers[] = {SIGTERM, SIGINT, SIGHUP};
  if (pipe2(signal_pipe, O_CLOEXEC | O_NONBLOCK) != 0) {
    return -1;
  }
  sigemptyset(set);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
    sigaddset(set, numbers[i]);
    sigaction(numbers[i], &action, NULL);
  }
  pthread_sigmask(SIG_BLOCK, set, NULL);
  signal(SIGPIPE, SIG_IGN);
  return signal_pipe[0];
}

enum { TICK_MS = 1000 };

/* Kept to read the configuration again on SIGHUP. */
typedef struct command_line {
  int argc;
  char **argv;
  config *options;
} command_line;

static void set_log(const config *options) {
  static const char *const levels[] = {"debug", "info", "warn", "error"};
  int level = 0;
  while (level < 3 && strcmp(levels[level], options->log_level) != 0) {
    level++;
  }
  log_setup((log_level)level, strcmp(options->log_format, "text") != 0);
}

static void on_change(const char *name, int taken) {
  if (taken) {
    log_warn("SIGHUP: %s changed", name);
  } else {
    log_warn("SIGHUP: %s differs; the change takes effect after a restart", name);
  }
}

static int reload_callers(server *srv) {
  int fine = callers_reload(srv->callers) & signers_reload(srv->signers);
  if (fine) {
    queue_wake_once(srv->q); /* ends streams and waits whose token or key has been removed */
  } else {
    log_error("the tokens and keys could not be read again; the previous ones stay valid");
  }
  return fine;
}

/* A command from the control socket. */
static int on_command(void *user, const char *line, api_text *reply) {
  server *srv = user;
  char what[8] = "", verb[8] = "", name[64] = "";
  sscanf(line, "%7s %7s %63s", what, verb, name);
  const admin_kind *kind = admin_kind_named(admin_kinds, what);
  int lists = strcmp(verb, "list") == 0 || strcmp(verb, "secret") == 0;
  if (!kind) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  if (kind == &admin_key && lists) {
    signers_store_use(srv->signers);
  }
  int status = kind->apply(srv->cat, line, reply);
  if (status == 0 && !lists) {
    status = !reload_callers(srv);
    log_write(LOG_INFO, "\"audit\":\"command\"", "%s %s: %s", kind->name, verb, name);
  }
  return status;
}

static void reload(server *srv, const command_line *line) {
  systemd_reloading();
  if (config_reload(line->options, line->argc, line->argv, on_change)) {
    set_log(line->options);
    queue_set_limit(srv->q, (int)line->options->queue_limit);
    reload_callers(srv);
    if (certificate_is_loaded() && !certificate_load(line->options->tls_certificate, line->options->tls_key)) {
      log_error("SIGHUP: the previous certificate stays in use");
    }
    log_info("SIGHUP: the configuration was read again");
  } else {
    log_error("SIGHUP: the new configuration is not valid; the previous one stays in effect");
  }
  systemd_notify("READY=1\n");
}

/* systemd's watchdog is fed only if a thread of the io pool has run the previous probe. */
typedef struct probe {
  task task; /* first */
  int idle;  /* the pool has run the task; __atomic */
} probe;

static void probe_run(task *t) {
  __atomic_store_n(&((probe *)(void *)t)->idle, 1, __ATOMIC_RELEASE);
}

static void feed_watchdog(server *srv, probe *p) {
  if (__atomic_exchange_n(&p->idle, 0, __ATOMIC_ACQ_REL)) {
    systemd_notify("WATCHDOG=1\n");
    tasks_add(srv->io, &p->task);
  }
}

/* Serves until a signal to stop, then waits for running jobs. A second signal, or the end of drain-seconds, interrupts
 * them. */
static void wait_for_stop(server *srv, const command_line *line, int signals) {
  static probe probed = {.task = {.run = probe_run}, .idle = 1}; /* static: the pool may hold it after the return */
  struct pollfd wait[2] = {{.fd = signals, .events = POLLIN}, {.fd = srv->control, .events = POLLIN}};
  int64_t every = systemd_watchdog_ms(), fed = 0, kept = 0;
  int tick = every > 0 && every < TICK_MS ? (int)every : TICK_MS;
  housekeeping done = HOUSEKEEPING_START;
  for (;;) {
    unsigned char number;
    int ready = poll(wait, 2, tick);
    int64_t now = orb_clock_ms();
    if (every > 0 && now - fed >= every) {
      fed = now;
      feed_watchdog(srv, &probed);
    }
    if (now - kept >= TICK_MS) {
      kept = now;
      housekeeping_budget(srv, &done);
      signers_store_use(srv->signers);
      housekeeping_jobs(srv, &done);
    }
    if (ready > 0 && wait[1].revents) {
      control_serve(srv->control, on_command, srv);
    }
    if (ready <= 0 || !wait[0].revents || read(signals, &number, 1) != 1) {
      continue;
    }
    if (number == SIGHUP) {
      reload(srv, line);
      continue;
    }
    break;
  }
  log_info("stopping: running jobs have %lld s to end", (long long)srv->options->drain_seconds);
  systemd_notify("STOPPING=1\nSTATUS=waiting for running jobs\n");
  __atomic_store_n(&srv->stopping, 1, __ATOMIC_RELEASE);
  queue_stop(srv->q, 0);
  int64_t until = orb_clock_ms() + 1000 * srv->options->drain_seconds;
  while (queue_running(srv->q) > 0 && orb_clock_ms() < until) {
    unsigned char number;
    if (poll(wait, 1, 50) > 0 && read(signals, &number, 1) == 1 && number != SIGHUP) {
      break;
    }
  }
  queue_stop(srv->q, 1);
}

/* Another node may have changed what this one has in memory. */
static void on_shared_change(void *user, const char *what) {
  server *srv = user;
  if (what[0] == 't') {
    reload_callers(srv);
  } else if (what[0] == 'u') {
    callers_recount(srv->callers, what + 1);
  } else if (what[0] == '*') {
    cache_drop_all(srv->descriptions);
    reload_callers(srv);
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

/* Starts all parts in order; 0 if one of them failed. */
static int start(server *srv, worker_pool **workers) {
  const config *o = srv->options;
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
  srv->memory = budget_create(o->job_memory);
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
  return listens && srv->memory && open_stores(srv) && check_catalogue(srv) &&
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

/* Stops all parts that were started. */
static void stop(server *srv, worker_pool *workers) {
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
  catalogue_close(srv->cat);
  objects_close(srv->store);
  cache_destroy(srv->descriptions);
  callers_close(srv->callers);
  signers_close(srv->signers);
  trace_stop(); /* all threads that make spans have ended */
}

static int serve(server *srv, const command_line *line, int signals, const sigset_t *set) {
  worker_pool *workers = NULL;
  int started = start(srv, &workers);
  if (!started) {
    log_error("the daemon could not be started");
  } else {
    __atomic_store_n(&srv->ready, 1, __ATOMIC_RELEASE);
    if (srv->at.fd >= 0 && srv->needs_token && callers_count(srv->callers) == 0) {
      log_warn("tokens are needed but none exist: create one with orbmorphd token add");
    }
    srv->control = control_listen(srv->options->data);
    announce(srv);
    pthread_sigmask(SIG_UNBLOCK, set, NULL); /* only in this thread */
    wait_for_stop(srv, line, signals);
    control_close(srv->options->data, srv->control);
  }
  stop(srv, workers);
  return srv->unfit ? CONFIG_UNFIT : !started;
}

static int run(const command_line *line) {
  const config *options = line->options;
  server srv = {.options = options, .at = {.fd = -1}};
  sigset_t set;
  int signals = take_signals(&set);
  srv.started_ms = orb_clock_ms();
  raise_descriptor_limit();
  int lock = signals < 0 ? -1 : folder_lock_data(options->data);
  if (signals >= 0 && lock < 0) {
    folder_lock_say(options->data, lock);
  }
  isolate_mode mode = strcmp(options->isolate, "off") == 0      ? ISOLATE_OFF
                      : strcmp(options->isolate, "strict") == 0 ? ISOLATE_STRICT
                                                                : ISOLATE_ON;
  int result = lock < 0 || !isolate_start(mode) ? 1 : serve(&srv, line, signals, &set);
  isolate_stop();
  if (lock >= 0) {
    close(lock);
  }
  return result;
}

/* What needs the lock of the data folder: a command that no running daemon took, --check-data, --gc. */
static int work_alone(const admin_command *admin, config_action action, const config *options) {
  return admin->kind                   ? admin_command_run(admin, options)
         : action == CONFIG_CHECK_DATA ? maintain_check(options)
         : action == CONFIG_GC         ? maintain_gc(options)
                                       : 2;
}

int main(int argc, char **argv) {
  static config options;
  static admin_command admin;
  if (argc == 2 && strcmp(argv[1], ISOLATE_FLAG) == 0) {
    return sodium_init() < 0 ? 1 : (isolate_zygote(confined_work), 0);
  }
  const admin_kind *kind = argc > 1 ? admin_kind_named(admin_kinds, argv[1]) : NULL;
  backup_command backup = {0};
  migrate_command migrate;
  if ((kind && !admin_command_read(&admin, kind, &argc, argv)) || !backup_command_read(&backup, &argc, argv) ||
      !migrate_command_read(&migrate, &argc, argv)) {
    return 2;
  }
  config_action action = config_read(&options, argc, argv);
  set_log(&options);
  if (sodium_init() < 0) {
    fputs("orbmorphd: libsodium cannot be initialised\n", stderr);
    return 1;
  }
  switch (action) {
    case CONFIG_PRINTED:
      return 0;
    case CONFIG_BAD:
      return 2;
    case CONFIG_CHECKED:
      puts("the configuration is valid");
      return 0;
    case CONFIG_RUN:
      if (backup.run) {
        return backup.run(backup.folder, &options);
      }
      if (migrate.data) {
        return migrate_run(&migrate, &options);
      }
      if (!admin.kind) {
        return run(&(command_line){argc, argv, &options});
      }
      break;
    default:
      break;
  }
  int asked = admin_command_ask(&admin, &options);
  int lock = asked < 0 ? folder_lock_data(options.data) : -1;
  if (lock < 0 && asked < 0) { /* the daemon may have just been starting */
    asked = admin_command_ask(&admin, &options);
    if (asked < 0) {
      folder_lock_say(options.data, lock);
      return 1;
    }
  }
  if (asked >= 0) {
    return asked;
  }
  int result = work_alone(&admin, action, &options);
  close(lock);
  return result;
}
