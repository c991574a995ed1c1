#include "isolate/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <malloc.h>
#include <seccomp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "log.h"

enum {
  SLACK = 256 << 20,       /* beside the budget: the program, its libraries, results in memory */
  THREAD_BYTES = 10 << 20, /* the stack of a thread, and what malloc() keeps for it */
  ARENAS = 4,              /* of malloc(), each of which reserves ARENA_BYTES */
  ARENA_BYTES = 64 << 20,
  DATA_SLACK = 64 << 20, /* of memory that can be written, where address space that is only reserved does not count */
  DESCRIPTORS = 128
};

/* All that a reader and a job need: memory, threads, the clock, the channel, and files that are open. Any other call
 * fails with EPERM, so that what libraries merely try, such as reading /sys, does not end the process. Not fcntl() and
 * ioctl(): with them a process chooses a signal, and who of the same user gets it once a descriptor is ready. */
static const int allowed[] = {
    SCMP_SYS(newfstatat),   SCMP_SYS(clock_gettime),     SCMP_SYS(read),      SCMP_SYS(write),
    SCMP_SYS(readv),        SCMP_SYS(nanosleep),         SCMP_SYS(writev),    SCMP_SYS(pwrite64),
    SCMP_SYS(pread64),      SCMP_SYS(sched_yield),       SCMP_SYS(lseek),     SCMP_SYS(fstat),
    SCMP_SYS(sendmsg),      SCMP_SYS(set_tid_address),   SCMP_SYS(close),     SCMP_SYS(poll),
    SCMP_SYS(recvmsg),      SCMP_SYS(set_robust_list),   SCMP_SYS(munmap),    SCMP_SYS(dup),
    SCMP_SYS(mremap),       SCMP_SYS(sched_getaffinity), SCMP_SYS(brk),       SCMP_SYS(futex),
    SCMP_SYS(gettimeofday), SCMP_SYS(clock_nanosleep),   SCMP_SYS(ppoll),     SCMP_SYS(rseq),
    SCMP_SYS(getpid),       SCMP_SYS(rt_sigprocmask),    SCMP_SYS(gettid),    SCMP_SYS(madvise),
    SCMP_SYS(rt_sigaction), SCMP_SYS(restart_syscall),   SCMP_SYS(getrandom), SCMP_SYS(sigaltstack),
    SCMP_SYS(rt_sigreturn), SCMP_SYS(getrusage),         SCMP_SYS(exit),      SCMP_SYS(exit_group)};

static struct sock_fprog filter;

/* Reads what libseccomp writes into memory. */
static int export(scmp_filter_ctx rules) {
  int fd = memfd_create("filter", MFD_CLOEXEC), fine = 0;
  if (fd >= 0 && seccomp_export_bpf(rules, fd) == 0) {
    off_t size = lseek(fd, 0, SEEK_END);
    void *code = size > 0 ? malloc((size_t)size) : NULL;
    if (code && pread(fd, code, (size_t)size, 0) == size) {
      filter = (struct sock_fprog){.len = (unsigned short)((size_t)size / sizeof(struct sock_filter)), .filter = code};
      fine = 1;
    }
  }
  if (fd >= 0) {
    close(fd);
  }
  return fine;
}

int sandbox_prepare(void) {
  if (SANDBOX_SANITIZED) {
    return 0;
  }
  scmp_filter_ctx rules = seccomp_init(SCMP_ACT_ERRNO(EPERM));
  int fine = rules != NULL;
  for (size_t i = 0; fine && i < sizeof allowed / sizeof *allowed; i++) {
    fine = seccomp_rule_add(rules, SCMP_ACT_ALLOW, allowed[i], 0) == 0;
  }
  /* Only memory that runs no code, and that RLIMIT_DATA counts: it does not count what is shared, grows like a stack,
   * or was written to and can be read only. For the same reason no file in memory can be created: RLIMIT_FSIZE limits
   * each by itself. */
  fine = fine &&
         seccomp_rule_add(rules, SCMP_ACT_ALLOW, SCMP_SYS(mmap), 2, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0),
                          SCMP_A3(SCMP_CMP_MASKED_EQ, MAP_TYPE | MAP_GROWSDOWN, MAP_PRIVATE)) == 0 &&
         seccomp_rule_add(rules, SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1,
                          SCMP_A2(SCMP_CMP_EQ, PROT_READ | PROT_WRITE, 0)) == 0;
  /* Threads, but no processes. The flags of clone3() lie in memory, which a filter cannot read: ENOSYS makes the C
   * library use clone(). */
  fine = fine &&
         seccomp_rule_add(rules, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                          SCMP_A0(SCMP_CMP_MASKED_EQ, 0x10000 /* CLONE_THREAD */, 0x10000)) == 0 &&
         seccomp_rule_add(rules, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0) == 0 && export(rules);
  seccomp_release(rules);
  return fine;
}

/* No file can be opened by name, and no TCP connection made, whatever else fails. */
static int enter_landlock(void) {
  long version = syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 1) {
    return 0;
  }
  struct {
    uint64_t files, net, scoped;
  } rules = {.files = version >= 5   ? 0xffff
                      : version >= 3 ? 0x7fff
                      : version >= 2 ? 0x3fff
                                     : 0x1fff,
             .net = version >= 4 ? 3 : 0,
             .scoped = version >= 6 ? 3 : 0};
  size_t size = version >= 6 ? 24 : version >= 4 ? 16 : 8;
  int fd = (int)syscall(SYS_landlock_create_ruleset, &rules, size, 0);
  int fine = fd >= 0 && syscall(SYS_landlock_restrict_self, fd, 0) == 0;
  if (fd >= 0) {
    close(fd);
  }
  return fine;
}

static void limit(int what, uint64_t value) {
  struct rlimit to = {.rlim_cur = value, .rlim_max = value};
  (void)setrlimit((__rlimit_resource_t)what, &to); /* lowering it cannot fail */
}

int sandbox_enter(const sandbox_limits *limits) {
  int holds = 0;
  (void)setpriority(PRIO_PROCESS, 0, limits->nice);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_NOFILE, DESCRIPTORS);
  limit(RLIMIT_CPU, (uint64_t)limits->cpu_seconds);
  limit(RLIMIT_FSIZE, (uint64_t)limits->file);
  if (!SANDBOX_SANITIZED) {
    (void)mallopt(M_ARENA_MAX, ARENAS);
    limit(RLIMIT_AS,
          (uint64_t)limits->memory + SLACK + (uint64_t)limits->threads * THREAD_BYTES + (uint64_t)ARENAS * ARENA_BYTES);
    /* Twice the budget: libraries allocate by themselves what a block of the budget stands for. Far less than the
     * address space where the budget is small, and most processes have a small one. */
    limit(RLIMIT_DATA, 2 * (uint64_t)limits->memory + DATA_SLACK + (uint64_t)limits->threads * THREAD_BYTES);
  }
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
    return 0;
  }
  holds |= enter_landlock() ? SANDBOX_LANDLOCK : 0;
  if (filter.len && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter, 0, 0) == 0) {
    holds |= SANDBOX_SECCOMP;
  }
  return holds;
}
