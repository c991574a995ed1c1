/* orbmorphd: start, signals, stop. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "evict.h"
#include "http/http.h"
#include "log.h"
#include "maintain.h"
#include "token_command.h"
#include "worker/pool.h"

enum { CACHE_BYTES = 64 << 20 };

static void raise_descriptor_limit(void) {
  struct rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    limit.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0) {
      log_warn("the limit of open files stays at what it was");
    }
  }
}

/* Tells systemd, where there is one, over its datagram socket. */
static void notify(const char *text) {
  const char *path = getenv("NOTIFY_SOCKET");
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  if (!path || strlen(path) >= sizeof address.sun_path) {
    return;
  }
  strcpy(address.sun_path, path);
  if (path[0] == '@') {
    address.sun_path[0] = 0;
  }
  int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
  if (fd >= 0) {
    if (sendto(fd, text, strlen(text), MSG_NOSIGNAL, (struct sockaddr *)&address, size) < 0) {
      log_warn("systemd could not be notified: %s", strerror(errno));
    }
    close(fd);
  }
}

/* One process a data folder; the lock goes with the process, however it ends. */
static int lock_data(const char *data) {
  char path[PATH_MAX];
  if (mkdir(data, 0700) != 0 && errno != EEXIST) {
    log_error("the folder %s cannot be made: %s", data, strerror(errno));
    return -1;
  }
  snprintf(path, sizeof path, "%s/lock", data);
  int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  for (int tries = 0; fd >= 0 && tries < 50; tries++) { /* one that is being killed may hold it a moment longer */
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) {
      return fd;
    }
    usleep(100000);
  }
  log_error("the data folder %s is in use by another process, or cannot be locked", data);
  if (fd >= 0) {
    close(fd);
  }
  return -1;
}

static int is_loopback(const char *listen) {
  return strncmp(listen, "127.", 4) == 0 || strncmp(listen, "[::1]:", 6) == 0 ||
         strncmp(listen, "localhost:", 10) == 0 || strncmp(listen, "unix:", 5) == 0;
}

static void announce(const server *srv) {
  const char *listen = srv->options->listen;
  if (strncmp(listen, "unix:", 5) == 0) {
    printf("orbmorphd listening on %s\n", listen);
  } else {
    int host = (int)(strrchr(listen, ':') - listen);
    printf("orbmorphd listening on http%s://%.*s:%u\n", srv->options->tls_key[0] ? "s" : "", host, listen,
           (unsigned)http_port(srv));
  }
  fflush(stdout);
  notify("READY=1\n");
}

/* Signals come through a pipe: threads that libraries start before main() do not have them blocked, so a signalfd
 * would miss what is delivered to those. */
static int signal_pipe[2] = {-1, -1};

static void on_signal(int number) {
  int saved = errno;
  unsigned char byte = (unsigned char)number;
  ssize_t written = write(signal_pipe[1], &byte, 1);
  (void)written; /* full: more than enough are waiting */
  errno = saved;
}

/* Blocks them for the threads to come; where on_signal() is read, or −1. */
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

enum { EVICT_EVERY_MS = 1000, EVICT_GRACE_MS = 5000 };

/* Keeps derived objects within their budget, when a job has made more or some could not leave yet: what was just made
 * or used stays for a while, so that who waits for it can have it. */
static void keep_budget(const server *srv, int64_t *seen, int *over) {
  const int64_t budget = srv->options->derived_bytes;
  queue_numbers n;
  if (budget <= 0) {
    return;
  }
  queue_count(srv->q, &n);
  if (n.ended[ORB_JOB_SUCCEEDED] != *seen || *over) {
    const evict_env env = {.cat = srv->cat, .store = srv->store, .descriptions = srv->descriptions, .q = srv->q};
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    *seen = n.ended[ORB_JOB_SUCCEEDED];
    *over = evict_derived(&env, budget, (int64_t)now.tv_sec * 1000 - EVICT_GRACE_MS) > budget;
  }
}

/* For reading the configuration again. */
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
    log_warn("SIGHUP: %s is changed", name);
  } else {
    log_warn("SIGHUP: %s is not what it was; it needs a restart", name);
  }
}

static void reload(server *srv, const command_line *line) {
  if (!config_reload(line->options, line->argc, line->argv, on_change)) {
    log_error("SIGHUP: the configuration is not valid and stays as it was");
    return;
  }
  set_log(line->options);
  queue_set_limit(srv->q, (int)line->options->queue_limit);
  log_info("SIGHUP: the configuration was read again");
}

/* Waits for a signal to stop; a second one, or the end of the time for draining, stops at once. */
static void wait_for_stop(server *srv, const command_line *line, int signals) {
  struct pollfd wait = {.fd = signals, .events = POLLIN};
  int64_t seen = -1;
  for (int over = 0;;) {
    unsigned char number;
    int ready = poll(&wait, 1, EVICT_EVERY_MS);
    if (ready == 0) {
      keep_budget(srv, &seen, &over);
    }
    if (ready <= 0 || read(signals, &number, 1) != 1) {
      continue;
    }
    if (number == SIGHUP) {
      reload(srv, line);
      continue;
    }
    break;
  }
  log_info("stopping: running jobs have %lld s", (long long)srv->options->drain_seconds);
  notify("STOPPING=1\n");
  __atomic_store_n(&srv->stopping, 1, __ATOMIC_RELEASE);
  queue_stop(srv->q, 0);
  int64_t until = orb_clock_ms() + 1000 * srv->options->drain_seconds;
  while (queue_running(srv->q) > 0 && orb_clock_ms() < until) {
    if (poll(&wait, 1, 50) > 0) {
      break;
    }
  }
  queue_stop(srv->q, 1);
}

static int serve(server *srv, const command_line *line, int signals, const sigset_t *set) {
  const config *o = srv->options;
  srv->needs_token = strcmp(o->auth, "on") == 0 || (strcmp(o->auth, "off") != 0 && !is_loopback(o->listen));
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
  queue_options queued = {.workers = (int)o->workers,
                          .cores = cores > 0 ? (int)cores : 1,
                          .limit = (int)o->queue_limit,
                          .memory = 2 * o->job_memory};
  worker_options limits = {.workers = (int)o->workers,
                           .job_memory = o->job_memory,
                           .job_ms = 1000 * o->job_seconds,
                           .max_triangles = o->max_triangles};
  worker_pool *workers = NULL;
  int result = 1;
  if (queued.cores < queued.workers) {
    queued.cores = queued.workers;
  }
  if (objects_open(o->data, &srv->store) != STORE_OK || catalogue_open(o->data, &srv->cat) != STORE_OK ||
      !(srv->tokens = catalogue_tokens(srv->cat, &srv->token_count)) || !(srv->q = queue_create(&queued, srv->cat)) ||
      queue_recover(srv->q) != STORE_OK || !(srv->descriptions = cache_create(CACHE_BYTES)) ||
      !(srv->io = tasks_start((int)o->io_threads)) || !(srv->checks = tasks_start((int)o->workers)) ||
      !(workers = worker_pool_start(&limits, srv->q, srv->cat, srv->store)) || !http_start(srv)) {
    log_error("the service could not be started");
  } else {
    __atomic_store_n(&srv->ready, 1, __ATOMIC_RELEASE);
    if (srv->needs_token && srv->token_count == 0) {
      log_warn("tokens are needed and there are none: make one with orbmorphd token add");
    }
    announce(srv);
    pthread_sigmask(SIG_UNBLOCK, set, NULL); /* in this thread, which alone waits for them */
    wait_for_stop(srv, line, signals);
    result = 0;
  }
  __atomic_store_n(&srv->stopping, 1, __ATOMIC_RELEASE);
  if (srv->q) {
    queue_stop(srv->q, 1);
    worker_pool_join(workers);
    queue_wake_all(srv->q);
  }
  if (srv->daemon) {
    MHD_quiesce_daemon(srv->daemon);
  }
  tasks_stop(srv->checks); /* resumes what they had */
  tasks_stop(srv->io);
  http_stop(srv);
  queue_destroy(srv->q);
  catalogue_close(srv->cat);
  objects_close(srv->store);
  cache_destroy(srv->descriptions);
  free(srv->tokens);
  return result;
}

static int run(const command_line *line) {
  const config *options = line->options;
  server srv = {.options = options};
  sigset_t set;
  struct timespec now;
  int signals = take_signals(&set);
  clock_gettime(CLOCK_REALTIME, &now);
  srv.started = now.tv_sec;
  pthread_mutex_init(&srv.mesh_lock, NULL);
  raise_descriptor_limit();
  int lock = signals < 0 ? -1 : lock_data(options->data);
  int result = lock < 0 ? 1 : serve(&srv, line, signals, &set);
  if (lock >= 0) {
    close(lock);
  }
  return result;
}

int main(int argc, char **argv) {
  static config options;
  static token_command tokens;
  int is_token = argc > 1 && strcmp(argv[1], "token") == 0;
  if (is_token && !token_command_read(&tokens, &argc, argv)) {
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
      if (!is_token) {
        return run(&(command_line){argc, argv, &options});
      }
      break;
    default:
      break;
  }
  int lock = lock_data(options.data);
  if (lock < 0) {
    return 1;
  }
  int result = is_token                      ? token_command_run(&tokens, &options)
               : action == CONFIG_CHECK_DATA ? maintain_check(&options)
               : action == CONFIG_GC         ? maintain_gc(&options)
                                             : 2;
  close(lock);
  return result;
}
