/* orbmorphd: command line, signals, the control socket. parts.c starts and stops the parts. */
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
#include "audit.h"
#include "backup.h"
#include "control.h"
#include "folder_lock.h"
#include "housekeeping.h"
#include "http/certificate.h"
#include "http/http.h"
#include "isolate/isolate.h"
#include "log.h"
#include "maintain.h"
#include "migrate.h"
#include "parts.h"
#include "store/place.h"
#include "systemd.h"
#include "worker/confined.h"
#include "worker/pool.h"

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

/* Executes a command from the control socket. */
static int on_command(void *user, const char *line, uid_t who, api_text *reply) {
  server *srv = user;
  char what[8] = "", verb[8] = "", told[ADMIN_TOLD];
  sscanf(line, "%7s %7s", what, verb);
  const admin_kind *kind = admin_kind_named(admin_kinds, what);
  const int lists = strcmp(verb, "list") == 0, shows = strcmp(verb, "secret") == 0;
  if (!kind) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  if (kind == &admin_key && (lists || shows)) {
    signers_store_use(srv->signers);
  }
  int status = kind->apply(srv->cat, line, reply);
  if (status == 0 && !lists && !shows) {
    status = !parts_reload_callers(srv);
  }
  if (admin_tell(kind, line, status, told)) {
    audit_log(who, told);
  }
  return status;
}

static void reload(server *srv, const command_line *line) {
  systemd_reloading();
  if (config_reload(line->options, line->argc, line->argv, on_change)) {
    set_log(line->options);
    queue_set_limit(srv->q, (int)line->options->queue_limit);
    parts_reload_callers(srv);
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
      trim_when_free(&done.trimmed);
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

static int serve(server *srv, const command_line *line, int signals, const sigset_t *set) {
  worker_pool *workers = NULL;
  int started = parts_start(srv, &workers);
  if (!started) {
    log_error("the daemon could not be started");
  } else {
    __atomic_store_n(&srv->ready, 1, __ATOMIC_RELEASE);
    if (srv->at.fd >= 0 && srv->needs_token && callers_count(srv->callers) == 0) {
      log_warn("tokens are needed but none exist: create one with orbmorphd token add");
    }
    audit_bring(srv->options->data);
    srv->control = control_listen(srv->options->data);
    announce(srv);
    pthread_sigmask(SIG_UNBLOCK, set, NULL); /* only in this thread */
    wait_for_stop(srv, line, signals);
    control_close(srv->options->data, srv->control);
  }
  parts_stop(srv, workers);
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

/* Whether work on what is stored finds it: opening a mistyped folder would make an empty catalogue there. A node that
 * shares a catalogue in PostgreSQL may have a new folder. */
static int finds_data(const admin_command *admin, config_action action, const config *options) {
  int fine = config_catalogue(options) || place_is_data(options->data) ||
             (admin->kind ? !admin_command_needs_data(admin) : action == CONFIG_RUN);
  if (!fine) {
    log_error(
        "%s is no data folder: it does not exist, cannot be read, or has no catalogue. Name that of the daemon with "
        "--data",
        options->data);
  }
  return fine;
}

/* Does what needs the lock of the data folder: a command that no running daemon took, --check-data, --gc. */
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
  if (asked < 0 && !finds_data(&admin, action, &options)) {
    return CONFIG_UNFIT;
  }
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
