/* The end of a process of its own. */
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "isolate/isolate.h"
#include "log.h"

/* A process closes its channel when it exits, and has ended well within a millisecond of that. One that still runs
 * after this many is killed. LEAVING_MS: a busy processor delays no end so long, so a process that closed its channel
 * and still runs has closed it itself. STATUS_MS: within it the zygote reports its status. */
enum { ENDING_MS = 20, LEAVING_MS = 2000, STATUS_MS = 2000 };

/* Bytes of what a process wrote to standard error that go to the log, from the first on: a message of abort() or of a
 * failed assertion has some 200. */
enum { SAID_MOST = 1000 };

/* Logs what a process wrote to standard error as a part of a line. */
static void log_said(int said) {
  char text[SAID_MOST];
  api_text fields = {0};
  ssize_t size = read(said, text, SAID_MOST);
  if (size <= 0) {
    return;
  }
  api_json_member_output(&fields, "wrote", text, (size_t)size);
  if (!fields.failed) {
    log_write(LOG_WARN, fields.data, "a process of a job or a check wrote to its standard error");
  }
  api_text_free(&fields);
}

/* The zygote alone holds the other end of the pipe. */
static int reported_status(int fd) {
  struct pollfd reported = {.fd = fd, .events = POLLIN};
  int status;
  if (poll(&reported, 1, STATUS_MS) <= 0) {
    return ISOLATE_UNKNOWN;
  }
  const ssize_t size = read(fd, &status, sizeof status);
  return size == sizeof status ? status : size == 0 ? ISOLATE_ORPHAN : ISOLATE_UNKNOWN;
}

static int working;    /* __atomic; processes with work */
static unsigned begun; /* __atomic; works so far */

void isolate_set_works(isolated *p, int works) {
  if (works && !p->works) {
    p->beside = __atomic_fetch_add(&working, 1, __ATOMIC_SEQ_CST) > 0;
    p->begun = __atomic_add_fetch(&begun, 1, __ATOMIC_SEQ_CST);
  } else if (!works && p->works) {
    __atomic_sub_fetch(&working, 1, __ATOMIC_SEQ_CST);
  }
  p->works = works;
}

int isolate_is_alone(const isolated *p) {
  return !p->beside && __atomic_load_n(&begun, __ATOMIC_SEQ_CST) == p->begun;
}

const char *isolate_breach(const isolated *p, channel_result got) {
  struct pollfd end = {.fd = p->pidfd, .events = POLLIN};
  if (got == CHANNEL_CLOSED && p->pidfd >= 0 && poll(&end, 1, LEAVING_MS) == 0) {
    return "it closed its channel and went on";
  }
  return got == CHANNEL_BAD ? "bytes that are no frame, or too large a one" : NULL;
}

int isolate_close(isolated *p) {
  int status = ISOLATE_UNKNOWN;
  isolate_set_works(p, 0);
  if (p->channel >= 0) {
    close(p->channel);
  }
  if (p->status >= 0) {
    /* It has ended, or ends within moments of its last frame; else it is killed, which says nothing of it. Its status
     * comes later where the processor is busy: another process reports that. */
    struct pollfd end = {.fd = p->pidfd, .events = POLLIN};
    const int runs = p->pidfd >= 0 && poll(&end, 1, ENDING_MS) <= 0;
    if (runs) {
      (void)syscall(SYS_pidfd_send_signal, p->pidfd, SIGKILL, NULL, 0);
    }
    status = p->pidfd >= 0 ? reported_status(p->status) : ISOLATE_UNKNOWN;
    status = runs && isolate_was_killed(status) ? ISOLATE_UNKNOWN : status;
    close(p->status);
  }
  if (p->pidfd >= 0) {
    close(p->pidfd);
  }
  if (p->said >= 0) {
    log_said(p->said);
    close(p->said);
  }
  *p = (isolated){.channel = -1, .status = -1, .pidfd = -1, .said = -1};
  return status;
}

int isolate_was_killed(int status) {
  return status >= 0 && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
}

int isolate_end_counts(const char *breach, int status, int alone) {
  return breach || (status >= 0 && (alone || !isolate_was_killed(status)));
}

void isolate_end_text(const char *breach, int status, char *out, size_t room) {
  if (breach) {
    snprintf(out, room, "broke the protocol: %s", breach);
  } else if (status == ISOLATE_ORPHAN) {
    snprintf(out, room, "ended with the process that forks them all");
  } else if (status >= 0 && WIFSIGNALED(status)) {
    snprintf(out, room, "was killed by signal %d (%s)", WTERMSIG(status), strsignal(WTERMSIG(status)));
  } else if (status >= 0 && WIFEXITED(status)) {
    snprintf(out, room, "exited with status %d", WEXITSTATUS(status));
  } else {
    snprintf(out, room, "ended for an unknown reason");
  }
}
