/* What a process that reads a mesh or runs a job cannot do: open files, connect, start programs, touch other processes,
 * take more memory or time than its limits. */
#ifndef ORB_ISOLATE_SANDBOX_H
#define ORB_ISOLATE_SANDBOX_H

#include <stdint.h>

enum { SANDBOX_LANDLOCK = 1, SANDBOX_SECCOMP = 2, SANDBOX_ALL = 3 };

typedef struct sandbox_limits {
  int64_t memory;      /* bytes of the job's budget */
  int64_t cpu_seconds; /* of all threads */
  int threads, nice;
} sandbox_limits;

/* Compiles the filter of system calls, once, before processes are forked. 0: without one. */
int sandbox_prepare(void);
/* Confines the calling process for good. Returns which of SANDBOX_LANDLOCK and SANDBOX_SECCOMP hold. */
int sandbox_enter(const sandbox_limits *limits);

#endif
