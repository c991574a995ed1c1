#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "isolate/isolate.h"
#include "isolate/sandbox.h"
#include "log.h"
#include "orbmorph/context.h"

enum { PASSED_MOST = 3, HELLO_MS = 60000, PROCESSES = 1024 };

extern char **environ;

/* Small messages over a socket of packets: a number and up to three descriptors. */
static int tell(int fd, int number, const int *passed, int count) {
  char control[CMSG_SPACE(PASSED_MOST * sizeof(int))] = {0};
  struct iovec part = {&number, sizeof number};
  struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
  if (count) {
    message.msg_control = control;
    message.msg_controllen = CMSG_SPACE((size_t)count * sizeof(int));
    struct cmsghdr *item = CMSG_FIRSTHDR(&message);
    item->cmsg_level = SOL_SOCKET;
    item->cmsg_type = SCM_RIGHTS;
    item->cmsg_len = CMSG_LEN((size_t)count * sizeof(int));
    memcpy(CMSG_DATA(item), passed, (size_t)count * sizeof(int));
  }
  ssize_t sent;
  do {
    sent = sendmsg(fd, &message, MSG_NOSIGNAL);
  } while (sent < 0 && errno == EINTR);
  return sent == (ssize_t)sizeof number;
}

/* Returns the number of descriptors; −1: the other end is gone. */
static int hear(int fd, int *number, int passed[PASSED_MOST]) {
  char control[CMSG_SPACE(PASSED_MOST * sizeof(int))];
  struct iovec part = {number, sizeof *number};
  struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
  ssize_t got;
  do {
    got = recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
  } while (got < 0 && errno == EINTR);
  if (got != (ssize_t)sizeof *number) {
    return -1;
  }
  struct cmsghdr *item = CMSG_FIRSTHDR(&message);
  if (!item || item->cmsg_level != SOL_SOCKET || item->cmsg_type != SCM_RIGHTS) {
    return 0;
  }
  int count = (int)((item->cmsg_len - CMSG_LEN(0)) / sizeof(int));
  memcpy(passed, CMSG_DATA(item), (size_t)count * sizeof(int));
  return count;
}

/* ---- the zygote ---- */

/* Libraries of which readers and jobs call nothing: HTTP, TLS, databases, and what these need. The forked processes do
 * not have these libraries. With them, they would copy and release several times as many mappings, which took longer
 * than a small job. */
static const char *const absent[] = {"libmicrohttpd.",  "libgnutls.",  "libsqlite3.", "libpq.",        "libcurl",
                                     "libseccomp.",     "libp11-kit.", "libidn2.",    "libunistring.", "libtasn1.",
                                     "libnettle.",      "libhogweed.", "libgmp.",     "libssl.",       "libcrypto.",
                                     "libgssapi_krb5.", "libldap",     "libnghttp2.", "librtmp.",      "libssh2.",
                                     "libpsl.",         "liblber",     "libbrotli",   "libffi.",       "libkrb5",
                                     "libk5crypto.",    "libcom_err.", "libsasl2.",   "libkeyutils.",  "libresolv."};

#if SANDBOX_SANITIZED
#define FORK fork /* the runtimes of the sanitizers handle fork() */
enum { LEAVES_OUT = 0 };
#else
#define FORK _Fork /* without the handlers of those libraries */
enum { LEAVES_OUT = 1 };
#endif

/* All symbols are bound by now: the environment has LD_BIND_NOW. */
static int leave_out(struct dl_phdr_info *library, size_t size, void *unused) {
  const char *slash = strrchr(library->dlpi_name, '/'), *name = slash ? slash + 1 : library->dlpi_name;
  (void)size;
  (void)unused;
  for (size_t i = 0; i < sizeof absent / sizeof *absent; i++) {
    if (strncmp(name, absent[i], strlen(absent[i])) != 0) {
      continue;
    }
    for (int k = 0; k < library->dlpi_phnum; k++) {
      const ElfW(Phdr) *part = &library->dlpi_phdr[k];
      if (part->p_type == PT_LOAD) {
        uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), from = (library->dlpi_addr + part->p_vaddr) & ~(page - 1);
        uintptr_t to = (library->dlpi_addr + part->p_vaddr + part->p_memsz + page - 1) & ~(page - 1);
        (void)madvise((void *)from, to - from, MADV_DONTFORK);
      }
    }
  }
  return 0;
}

static struct {
  pthread_mutex_t lock;
  isolate_mode mode; /* __atomic; in a forked process that of the daemon */
  int told;          /* __atomic; what the log has said to be missing, of SANDBOX_ALL */
  int fd;            /* to the zygote; −1: none */
  pid_t pid;
} own = {.lock = PTHREAD_MUTEX_INITIALIZER, .fd = -1};

static struct process {
  pid_t pid; /* 0: unused */
  int status;
} processes[PROCESSES];
static int deaths[2]; /* a pipe that the handler of SIGCHLD writes to */

static void on_death(int number) {
  int saved = errno;
  ssize_t written = write(deaths[1], "", 1);
  (void)number;
  (void)written; /* if the pipe is full, the loop wakes anyway */
  errno = saved;
}

/* Reports the exit statuses of children that have ended. */
static void bury(void) {
  int status;
  for (pid_t pid; (pid = waitpid(-1, &status, WNOHANG)) > 0;) {
    for (int i = 0; i < PROCESSES; i++) {
      if (processes[i].pid == pid) {
        ssize_t written = write(processes[i].status, &status, sizeof status);
        (void)written;
        close(processes[i].status);
        processes[i].pid = 0;
      }
    }
  }
}

_Noreturn static void become_process(int channel, int said, pid_t zygote, void (*work)(int channel)) {
  int kept = fcntl(channel, F_DUPFD_CLOEXEC, 64);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (kept < 0 || getppid() != zygote || dup2(kept, ISOLATE_FD) != ISOLATE_FD) {
    _exit(1);
  }
  /* The zygote's standard error is the log, where a process could forge lines. Reports of the sanitizers go there
   * whole.
   */
  if (!SANDBOX_SANITIZED && dup2(said, STDERR_FILENO) != STDERR_FILENO) {
    _exit(1);
  }
  signal(SIGCHLD, SIG_DFL);
  (void)syscall(SYS_close_range, ISOLATE_FD + 1, ~0u, 0); /* those of other processes */
  int score = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (score >= 0) { /* if memory is short, the kernel kills this process before the daemon */
    ssize_t written = write(score, "800", 3);
    (void)written;
    close(score);
  }
  work(ISOLATE_FD);
  _exit(0);
}

static void fork_one(isolate_mode mode, int passed[PASSED_MOST], void (*work)(int channel)) {
  int slot = 0, pidfd = -1;
  pid_t zygote = getpid(), pid = -1;
  while (slot < PROCESSES && processes[slot].pid) {
    slot++;
  }
  if (slot < PROCESSES) {
    pid = FORK();
    if (pid == 0) {
      own.mode = mode;
      become_process(passed[0], passed[2], zygote, work);
    }
  }
  close(passed[0]);
  close(passed[2]);
  if (pid > 0) {
    pidfd = (int)syscall(SYS_pidfd_open, pid, 0);
    processes[slot] = (struct process){pid, passed[1]};
  } else {
    close(passed[1]);
  }
  tell(ISOLATE_FD, pid > 0 ? (int)pid : -errno, &pidfd, pidfd >= 0);
  if (pidfd >= 0) {
    close(pidfd);
  }
}

/* Finds out which confinements this kernel has, in a process that ends at once. */
static int try_sandbox(void) {
  int status = 0;
  pid_t pid = FORK();
  if (pid == 0) {
    _exit(sandbox_enter(&(sandbox_limits){.memory = 64 << 20, .file = 64 << 20, .cpu_seconds = 10, .threads = 1}));
  }
  return pid > 0 && waitpid(pid, &status, 0) == pid && WIFEXITED(status) ? WEXITSTATUS(status) : 0;
}

_Noreturn void isolate_zygote(void (*work)(int channel)) {
  static const int ignored[] = {SIGTERM, SIGINT, SIGHUP, SIGPIPE}; /* the daemon decides when its processes end */
  for (size_t i = 0; i < sizeof ignored / sizeof *ignored; i++) {
    signal(ignored[i], SIG_IGN);
  }
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, NULL);
  prctl(PR_SET_NAME, "orbmorph-fork");
  sandbox_prepare();
  if (LEAVES_OUT) {
    dl_iterate_phdr(leave_out, NULL);
  }
  int holds = try_sandbox();
  if (pipe2(deaths, O_CLOEXEC | O_NONBLOCK) != 0) {
    _exit(1);
  }
  sigaction(SIGCHLD, &(struct sigaction){.sa_handler = on_death, .sa_flags = SA_NOCLDSTOP}, NULL);
  if (!tell(ISOLATE_FD, holds, NULL, 0)) {
    _exit(0);
  }
  for (;;) {
    struct pollfd wait[2] = {{.fd = ISOLATE_FD, .events = POLLIN}, {.fd = deaths[0], .events = POLLIN}};
    if (poll(wait, 2, -1) < 0 && errno != EINTR) {
      _exit(1);
    }
    char drained[64];
    while (read(deaths[0], drained, sizeof drained) > 0) {
    }
    bury();
    if (!(wait[0].revents & (POLLIN | POLLHUP))) {
      continue;
    }
    int number, passed[PASSED_MOST];
    int count = hear(ISOLATE_FD, &number, passed);
    if (count < 0) {
      _exit(0); /* the daemon has ended */
    }
    if (count == PASSED_MOST) {
      fork_one((isolate_mode)number, passed, work);
    }
  }
}

/* ---- the daemon ---- */

enum { TUNABLES_MOST = 1024 }; /* bytes of the variable with its name; an administrator's longer text stays as it is */

/* Writes the variable by which the heap asks for huge pages, after what an administrator has set. 0: that names them
 * already, or is too long. */
static int add_tunables(char text[TUNABLES_MOST]) {
  const char *set = getenv(ORB_HEAP_VARIABLE);
  if (set && strstr(set, "glibc.malloc.hugetlb")) {
    return 0;
  }
  return snprintf(text, TUNABLES_MOST, "%s=%s%s%s", ORB_HEAP_VARIABLE, set ? set : "", set && set[0] ? ":" : "",
                  ORB_HEAP_TUNABLES) < TUNABLES_MOST;
}

static pid_t spawn(int fd) {
  char *arguments[] = {(char *)(uintptr_t) "orbmorphd", (char *)(uintptr_t)ISOLATE_FLAG, NULL};
  posix_spawn_file_actions_t actions;
  pid_t pid = -1;
  size_t count = 0;
  while (environ[count]) {
    count++;
  }
  char **variables = calloc(count + 3, sizeof *variables), tunables[TUNABLES_MOST];
  if (!variables) {
    return -1;
  }
  memcpy(variables, environ, count * sizeof *variables);
  variables[count] = (char *)(uintptr_t) "LD_BIND_NOW=1";
  if (add_tunables(tunables)) {
    size_t i = 0;
    while (i <= count && strncmp(variables[i], ORB_HEAP_VARIABLE "=", sizeof ORB_HEAP_VARIABLE) != 0) {
      i++;
    }
    variables[i] = tunables;
  }
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, fd, ISOLATE_FD);
  int code = posix_spawn(&pid, "/proc/self/exe", &actions, NULL, arguments, variables);
  posix_spawn_file_actions_destroy(&actions);
  free(variables);
  if (code != 0) {
    log_error("the process that forks isolated processes cannot be started: %s", strerror(code));
    return -1;
  }
  return pid;
}

static void end_zygote(void) {
  if (own.fd >= 0) {
    close(own.fd);
    own.fd = -1;
    waitpid(own.pid, NULL, 0);
  }
}

/* Under the lock. */
static int start_zygote(int *holds) {
  int ends[2], passed[PASSED_MOST];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
    return 0;
  }
  int theirs = fcntl(ends[1], F_DUPFD_CLOEXEC, 16); /* not ISOLATE_FD itself: adddup2() would leave it close-on-exec */
  close(ends[1]);
  own.pid = theirs >= 0 ? spawn(theirs) : -1;
  if (theirs >= 0) {
    close(theirs);
  }
  own.fd = ends[0];
  struct pollfd hello = {.fd = own.fd, .events = POLLIN};
  if (own.pid > 0 && poll(&hello, 1, HELLO_MS) > 0 && hear(own.fd, holds, passed) >= 0) {
    return 1;
  }
  if (own.pid > 0) {
    kill(own.pid, SIGKILL);
    end_zygote();
  } else {
    close(own.fd);
    own.fd = -1;
  }
  return 0;
}

/* Says what does not hold: once each, unless work fails for it. */
static void tell_missing(int lacks, int fails, const char *consequence) {
  const int told = __atomic_fetch_or(&own.told, lacks, __ATOMIC_RELAXED);
  if (fails || (lacks & ~told)) {
    log_write(fails ? LOG_ERROR : LOG_WARN, NULL,
              "%s missing here: the processes of jobs are limited, but less confined%s",
              lacks == SANDBOX_ALL       ? "landlock and seccomp"
              : lacks & SANDBOX_LANDLOCK ? "landlock"
                                         : "seccomp",
              fails ? consequence : "");
  }
}

int isolate_start(isolate_mode mode) {
  int holds = 0;
  if (mode == ISOLATE_OFF) {
    return 1;
  }
  pthread_mutex_lock(&own.lock);
  int fine = start_zygote(&holds);
  __atomic_store_n(&own.mode, fine ? mode : ISOLATE_OFF, __ATOMIC_RELAXED);
  pthread_mutex_unlock(&own.lock);
  if (!fine) {
    log_error("meshes and jobs cannot have processes of their own; isolate = off runs them within the daemon");
    return 0;
  }
  if (holds != SANDBOX_ALL) {
    tell_missing(SANDBOX_ALL & ~holds, mode == ISOLATE_STRICT, "; isolate = strict does not start without");
    if (mode == ISOLATE_STRICT) {
      isolate_stop();
      return 0;
    }
  }
  return 1;
}

int isolate_lacks(int lacks) {
  const int is_strict = isolate_is_strict();
  if (lacks & SANDBOX_ALL) {
    tell_missing(lacks & SANDBOX_ALL, is_strict, "; isolate = strict does no work without");
  }
  return is_strict && (lacks & SANDBOX_ALL);
}

void isolate_stop(void) {
  pthread_mutex_lock(&own.lock);
  end_zygote();
  __atomic_store_n(&own.mode, ISOLATE_OFF, __ATOMIC_RELAXED);
  pthread_mutex_unlock(&own.lock);
}

int isolate_is_on(void) {
  return __atomic_load_n(&own.mode, __ATOMIC_RELAXED) != ISOLATE_OFF;
}

int isolate_is_strict(void) {
  return __atomic_load_n(&own.mode, __ATOMIC_RELAXED) == ISOLATE_STRICT;
}

/* Under the lock. A new zygote may lack what the first one had, such as memory for the filter of system calls. */
static int start_again(isolated *p) {
  int holds = 0;
  if (!start_zygote(&holds)) {
    return 0;
  }
  p->unconfined = isolate_lacks(SANDBOX_ALL & ~holds);
  if (p->unconfined) {
    end_zygote();
  }
  return !p->unconfined;
}

static int fork_process(isolated *p, const int passed[PASSED_MOST]) {
  int number = 0, got[PASSED_MOST];
  for (int tries = 0; tries < 2; tries++) {
    if (own.fd < 0 && !start_again(p)) {
      return 0;
    }
    int count = tell(own.fd, (int)own.mode, passed, PASSED_MOST) ? hear(own.fd, &number, got) : -1;
    if (count >= 0) {
      p->pidfd = count > 0 ? got[0] : -1;
      return number > 0 && count > 0;
    }
    log_warn("the process that forks isolated processes has died and is started again");
    kill(own.pid, SIGKILL);
    end_zygote();
  }
  return 0;
}

/* Makes the pairs of descriptors, of which the daemon keeps one each. 0: nothing is open. */
static int open_pairs(isolated *p, int passed[PASSED_MOST]) {
  int pairs[PASSED_MOST][2];
  int made = socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pairs[0]) == 0;
  made += made == 1 && pipe2(pairs[1], O_CLOEXEC) == 0;
  made += made == 2 && pipe2(pairs[2], O_CLOEXEC | O_NONBLOCK) == 0; /* the process loses what does not fit */
  for (int i = 0; i < made; i++) {
    if (made < PASSED_MOST) {
      close(pairs[i][0]);
      close(pairs[i][1]);
    }
    passed[i] = pairs[i][1];
  }
  if (made < PASSED_MOST) {
    return 0;
  }
  p->channel = pairs[0][0];
  p->status = pairs[1][0];
  p->said = pairs[2][0];
  return 1;
}

int isolate_open(isolated *p, orb_context *ctx) {
  int passed[PASSED_MOST];
  *p = (isolated){.channel = -1, .status = -1, .pidfd = -1, .said = -1, .ctx = ctx};
  if (!open_pairs(p, passed)) {
    return 0;
  }
  isolate_set_works(p, 1);
  pthread_mutex_lock(&own.lock);
  int fine = fork_process(p, passed);
  pthread_mutex_unlock(&own.lock);
  for (int i = 0; i < PASSED_MOST; i++) {
    close(passed[i]);
  }
  if (!fine) {
    const int unconfined = p->unconfined;
    if (!unconfined) { /* else that has been said */
      log_error("no process could be forked for a job");
    }
    isolate_close(p);
    p->unconfined = unconfined;
  }
  return fine;
}

static int continues(void *user) {
  isolated *p = user;
  p->unasked = 0;
  if (p->wanted && !p->wanted(p->user)) {
    orb_context_cancel(p->ctx);
  }
  return orb_context_check(p->ctx) == ORB_OK && (!p->last_ms || orb_clock_ms() < p->last_ms);
}

channel_result isolate_send(isolated *p, frame_type type, const struct iovec *parts, int count, int passed) {
  return channel_send(p->channel, type, parts, count, passed, continues, p);
}

channel_result isolate_receive(isolated *p, size_t most, frame *out) {
  if (++p->unasked > CHANNEL_UNASKED && !continues(p)) {
    *out = (frame){.fd = -1};
    return CHANNEL_STOPPED;
  }
  return channel_receive(p->channel, most, out, continues, p);
}
