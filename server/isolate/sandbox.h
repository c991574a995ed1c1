/* What a process that reads a mesh or runs a job cannot do: open files, connect, start programs, touch other processes,
 * take more memory or time than its limits. */
#ifndef ORB_ISOLATE_SANDBOX_H
#define ORB_ISOLATE_SANDBOX_H

#include <stdint.h>

/* Sanitizers map terabytes and use system calls of their own. */
#define SANDBOX_SANITIZED 0
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#undef SANDBOX_SANITIZED
#define SANDBOX_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#undef SANDBOX_SANITIZED
#define SANDBOX_SANITIZED 1
#endif
#endif

enum { SANDBOX_LANDLOCK = 1, SANDBOX_SECCOMP = 2, SANDBOX_ALL = 3 };

typedef struct sandbox_limits {
  int64_t memory;      /* bytes of the job's budget, and of its inputs */
  int64_t file;        /* bytes of each file, also of one in memory */
  int64_t cpu_seconds; /* of all threads */
  int threads, nice;
} sandbox_limits;

/* Compiles the filter of system calls, once, before processes are forked. 0: without one. */
int sandbox_prepare(void);
/* Confines the calling process until it ends. Returns which of SANDBOX_LANDLOCK and SANDBOX_SECCOMP hold. */
int sandbox_enter(const sandbox_limits *limits);

#endif
