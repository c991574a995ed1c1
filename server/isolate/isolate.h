/* Separate processes for all work that reads callers' bytes: the checks of uploads, jobs, and profiles of assets.
 *
 * channel.h   the frames that both sides exchange
 * sandbox.h   what such a process may not do
 * zygote.c    the small process that forks them
 * end.c       the end of one of them
 * readers.h   processes that check several small files
 *
 * The daemon starts this program again in an internal mode, as the zygote: a process with one thread and without
 * sockets, files or data of callers. For each piece of work the zygote forks a process, which confines itself, gets its
 * inputs as descriptors for reading over the channel, and sends back progress and results. It exits after one piece
 * of work, or after several small files of one tenant. Only the daemon accesses the catalogue and the store. When the
 * daemon dies, the zygote sees the end of its socket and exits, and the kernel kills the others.
 */
#ifndef ORB_ISOLATE_H
#define ORB_ISOLATE_H

#include <sys/types.h>

#include "isolate/channel.h"
#include "orbmorph/context.h"

typedef enum isolate_mode { ISOLATE_OFF, ISOLATE_ON, ISOLATE_STRICT } isolate_mode;

/* The daemon's side. Starts the zygote; 0 with the reason logged: it cannot, or strict and the kernel lacks landlock or
 * seccomp. */
int isolate_start(isolate_mode mode);
void isolate_stop(void);
int isolate_is_on(void);
/* Whether no process may work that is not confined. In a forked process, too. */
int isolate_is_strict(void);
/* A process, or the zygote for all, reports which of SANDBOX_ALL do not hold; 0: all do. The log says so, once each if
 * the work goes on. 1: isolate = strict forbids the work. */
int isolate_lacks(int lacks);

/* One process. */
typedef struct isolated {
  int channel, status, pidfd; /* −1: none */
  int said;                   /* a pipe that is its standard error; −1: none */
  orb_context *ctx;           /* of the job: its cancel flag and deadline end the process */
  int (*wanted)(void *user);  /* 0: cancel the context; NULL: never */
  void *user;
  int64_t last_ms; /* orb_clock_ms() at which waiting ends; 0: only the context ends it */
  int unasked;     /* frames received since the context was asked last */
  int unconfined;  /* it could not be confined, so isolate = strict allows it no work */
  int works;       /* private, as the next two: it has work */
  int beside;      /* others had work when this one got it */
  unsigned begun;  /* the number of its work */
} isolated;

/* Forks a process; 0 with the reason logged: task_refuse_open() tells it to the caller. Starts a new zygote if it has
 * died. Blocks for about a millisecond. */
int isolate_open(isolated *p, orb_context *ctx);
channel_result isolate_send(isolated *p, frame_type type, const struct iovec *parts, int count, int passed);
/* Frames that have arrived are received even if the context has ended, but not more than CHANNEL_UNASKED of them. */
channel_result isolate_receive(isolated *p, size_t most, frame *out);
/* Says that a process has work, as it has from isolate_open() on, or waits for more. */
void isolate_set_works(isolated *p, int works);
/* Whether no other process has had work at any time since this one got its work. */
int isolate_is_alone(const isolated *p);
/* Kills the process unless it has ended, and logs what it wrote to standard error. Returns its status as of waitpid(),
 * or one of these. UNKNOWN: also one that was killed here. ORPHAN: the zygote has ended, and all processes with it. */
enum { ISOLATE_UNKNOWN = -1, ISOLATE_ORPHAN = -2 };
int isolate_close(isolated *p);
/* Describes an end without an answer. breach: what the process sent against the protocol, for which the daemon ended it
 * ("broke the protocol: too many reports"); NULL: describes its status, which is not 0 ("was killed by signal 11
 * (Segmentation fault)"). */
void isolate_end_text(const char *breach, int status, char *out, size_t room);

/* Whether a status as of isolate_close() is SIGKILL by another than the daemon. */
int isolate_was_killed(int status);

/* Whether an end without an answer counts as a crash of the work, which had the process to itself. A breach counts.
 * SIGKILL by another than the daemon counts if no other process worked meanwhile (alone): memory was short, and the
 * work may need that much each time; otherwise the others may have taken it. An unknown end does not count: all
 * processes end so with the one that forks them, and so does one that the daemon ends because it fails itself. */
int isolate_end_counts(const char *breach, int status, int alone);

/* Whether a process that sends or takes no more frames broke the protocol, and how; NULL: it has ended, or was stopped.
 * Waits until a process that closed its channel has ended: it closes the channel to end, and not to go on unheard. */
const char *isolate_breach(const isolated *p, channel_result got);

/* The zygote's side: never returns. work: runs in each forked process, with its channel. */
enum { ISOLATE_FD = 3 };
#define ISOLATE_FLAG "--isolated-processes"
_Noreturn void isolate_zygote(void (*work)(int channel));

#endif
