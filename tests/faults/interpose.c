/* Makes calls of a program fail from outside: a library for LD_PRELOAD that stands before malloc, write, fsync, rename,
 * the steps of SQLite and the starts of threads, whoever calls them: the program, SQLite, the HTTP library, libc.
 *
 * The calls of a kind are counted from the start of the program. The environment says what to do:
 *   ORB_FAIL=KIND:#N         the N-th call of the kind fails; KIND:#N+ that and all later ones
 *   ORB_FAIL_MARK=FILE       is made when something failed, so that a test knows that its plan was met
 *   ORB_FAIL_RECORD=FILE     writes a line "KIND SITE N" when a site, the chain of the innermost callers, is first
 *                            passed, by call N; and at the end "total KIND N" for each kind
 * Calls below tinygltf never fail, they are only counted: "KIND SITE N tinygltf". A plan that falls on one
 * takes the next.
 * Kinds: alloc (NULL, ENOMEM), write (ENOSPC, to files only), fsync (EIO), rename (EIO), open (EMFILE), thread
 * (EAGAIN), sqlite (SQLITE_IOERR from sqlite3_step or sqlite3_exec).
 */
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum kind { ALLOC, WRITE, FSYNC, RENAME, OPEN, THREAD, SQLITE, KINDS };
static const char *const names[KINDS] = {"alloc", "write", "fsync", "rename", "open", "thread", "sqlite"};

enum { DEPTH = 7, DEEP = 48, SITES = 1 << 16 };

static atomic_int state; /* 0: not begun, 1: beginning, 2: ready */
static int record = -1, fails = -1, for_ever;
static unsigned long wanted;
static const char *mark;
static atomic_uint_fast64_t sites[SITES];
static atomic_ulong passes[KINDS];
static atomic_int failing;
static __thread int inside __attribute__((tls_model("initial-exec")));

static void *next_of(const char *name) {
  inside++; /* it allocates */
  void *found = dlsym(RTLD_NEXT, name);
  inside--;
  return found;
}

static int raw_open(const char *path, int flags) {
  return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0600);
}

__attribute__((constructor)) static void begin(void) {
  void *frames[4];
  const char *plan = getenv("ORB_FAIL"), *to = getenv("ORB_FAIL_RECORD");
  inside++;
  backtrace(frames, 4); /* loads what it needs now */
  mark = getenv("ORB_FAIL_MARK");
  if (to) {
    record = raw_open(to, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC);
  }
  for (int kind = 0; plan && kind < KINDS; kind++) {
    size_t n = strlen(names[kind]);
    if (strncmp(plan, names[kind], n) == 0 && strncmp(plan + n, ":#", 2) == 0) {
      char *end;
      wanted = strtoul(plan + n + 2, &end, 10);
      for_ever = *end == '+';
      fails = kind;
    }
  }
  unsetenv("LD_PRELOAD"); /* children are none of our business */
  inside--;
  atomic_store(&state, 2);
}

/* The chain of callers, with addresses as offsets in their modules. Not inlined, nor any of its callers into theirs: it
 * counts the frames. */
__attribute__((noinline)) static uint64_t site_of(enum kind kind) {
  void *frames[DEPTH + 3];
  int count = backtrace(frames, DEPTH + 3);
  uint64_t hash = 14695981039346656037u + (uint64_t)kind;
  for (int i = 3; i < count; i++) {
    Dl_info info;
    uint64_t at = dladdr(frames[i], &info) ? (uint64_t)((char *)frames[i] - (char *)info.dli_fbase) : 0;
    hash = (hash ^ at) * 1099511628211u;
    hash ^= hash >> 29;
  }
  return hash ? hash : 1;
}

static int below_tinygltf(void) {
  void *frames[DEEP];
  Dl_info info;
  int count = backtrace(frames, DEEP), found = 0;
  for (int i = 0; i < count && !found; i++) {
    found = dladdr(frames[i], &info) && strstr(info.dli_fname, "tinygltf") != NULL;
  }
  return found;
}

static int is_new(uint64_t site) {
  for (uint64_t i = site;; i++) {
    uint_fast64_t there = 0;
    if (atomic_compare_exchange_strong(&sites[i % SITES], &there, site)) {
      return 1;
    }
    if (there == site) {
      return 0;
    }
  }
}

static void note(int fd, const char *text, size_t size) {
  long done = syscall(SYS_write, fd, text, size);
  (void)done;
}

__attribute__((noinline)) static int look(enum kind kind) {
  char line[80];
  unsigned long number = atomic_fetch_add(&passes[kind], 1) + 1;
  uint64_t site = record >= 0 ? site_of(kind) : 0;
  if (record >= 0 && is_new(site)) {
    note(record, line,
         (size_t)snprintf(line, sizeof line, "%s %016llx %lu%s\n", names[kind], (unsigned long long)site, number,
                          below_tinygltf() ? " tinygltf" : ""));
  }
  if (fails != (int)kind || number < wanted || (!for_ever && atomic_load(&failing)) || below_tinygltf()) {
    return 0;
  }
  if (atomic_exchange(&failing, 1)) {
    return for_ever;
  }
  if (mark) {
    syscall(SYS_close, raw_open(mark, O_WRONLY | O_CREAT | O_CLOEXEC));
  }
  return 1;
}

__attribute__((destructor)) static void end(void) {
  char line[80];
  for (int kind = 0; record >= 0 && kind < KINDS; kind++) {
    note(record, line, (size_t)snprintf(line, sizeof line, "total %s %lu\n", names[kind], atomic_load(&passes[kind])));
  }
}

__attribute__((noinline)) static int fail(enum kind kind) {
  if (atomic_load(&state) != 2 || inside || (record < 0 && fails != (int)kind)) {
    return 0;
  }
  int saved = errno;
  inside++;
  int hit = look(kind);
  inside--;
  errno = saved;
  return hit;
}

/* The allocator's own names in glibc serve until dlsym(), which allocates, has found the next one. */
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *block, size_t size);

void *malloc(size_t size) {
  static void *(*next)(size_t);
  if (!next) {
    if (inside) {
      return __libc_malloc(size);
    }
    inside++;
    next = (void *(*)(size_t))next_of("malloc");
    inside--;
  }
  return fail(ALLOC) ? (errno = ENOMEM, NULL) : next(size);
}

void *calloc(size_t count, size_t size) {
  static void *(*next)(size_t, size_t);
  if (!next) {
    if (inside) {
      return __libc_calloc(count, size);
    }
    inside++;
    next = (void *(*)(size_t, size_t))next_of("calloc");
    inside--;
  }
  return fail(ALLOC) ? (errno = ENOMEM, NULL) : next(count, size);
}

void *realloc(void *block, size_t size) {
  static void *(*next)(void *, size_t);
  if (!next) {
    if (inside) {
      return __libc_realloc(block, size);
    }
    inside++;
    next = (void *(*)(void *, size_t))next_of("realloc");
    inside--;
  }
  return fail(ALLOC) ? (errno = ENOMEM, NULL) : next(block, size);
}

int posix_memalign(void **out, size_t alignment, size_t size) {
  static int (*next)(void **, size_t, size_t);
  next = next ? next : (int (*)(void **, size_t, size_t))next_of("posix_memalign");
  return fail(ALLOC) ? ENOMEM : next(out, alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
  static void *(*next)(size_t, size_t);
  next = next ? next : (void *(*)(size_t, size_t))next_of("aligned_alloc");
  return fail(ALLOC) ? (errno = ENOMEM, NULL) : next(alignment, size);
}

/* Only files: a socket or pipe has no disk to fill. */
static int is_file(int fd) {
  struct stat info;
  return fstat(fd, &info) == 0 && S_ISREG(info.st_mode);
}

#define NEXT(type, name, ...)       \
  static type (*next)(__VA_ARGS__); \
  next = next ? next : (type(*)(__VA_ARGS__))next_of(name)

ssize_t write(int fd, const void *bytes, size_t size) {
  NEXT(ssize_t, "write", int, const void *, size_t);
  return is_file(fd) && fail(WRITE) ? (errno = ENOSPC, -1) : next(fd, bytes, size);
}

ssize_t pwrite(int fd, const void *bytes, size_t size, off_t at) {
  NEXT(ssize_t, "pwrite", int, const void *, size_t, off_t);
  return is_file(fd) && fail(WRITE) ? (errno = ENOSPC, -1) : next(fd, bytes, size, at);
}

ssize_t pwrite64(int fd, const void *bytes, size_t size, off64_t at) {
  NEXT(ssize_t, "pwrite64", int, const void *, size_t, off64_t);
  return is_file(fd) && fail(WRITE) ? (errno = ENOSPC, -1) : next(fd, bytes, size, at);
}

int ftruncate(int fd, off_t size) {
  NEXT(int, "ftruncate", int, off_t);
  return fail(WRITE) ? (errno = ENOSPC, -1) : next(fd, size);
}

int ftruncate64(int fd, off64_t size) {
  NEXT(int, "ftruncate64", int, off64_t);
  return fail(WRITE) ? (errno = ENOSPC, -1) : next(fd, size);
}

int fsync(int fd) {
  NEXT(int, "fsync", int);
  return fail(FSYNC) ? (errno = EIO, -1) : next(fd);
}

int fdatasync(int fd) {
  NEXT(int, "fdatasync", int);
  return fail(FSYNC) ? (errno = EIO, -1) : next(fd);
}

int rename(const char *from, const char *to) {
  NEXT(int, "rename", const char *, const char *);
  return fail(RENAME) ? (errno = EIO, -1) : next(from, to);
}

int open(const char *path, int flags, ...) {
  va_list args;
  va_start(args, flags);
  mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(args, mode_t) : 0;
  va_end(args);
  NEXT(int, "open", const char *, int, ...);
  return fail(OPEN) ? (errno = EMFILE, -1) : next(path, flags, mode);
}

int open64(const char *path, int flags, ...) {
  va_list args;
  va_start(args, flags);
  mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(args, mode_t) : 0;
  va_end(args);
  NEXT(int, "open64", const char *, int, ...);
  return fail(OPEN) ? (errno = EMFILE, -1) : next(path, flags, mode);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *user) {
  NEXT(int, "pthread_create", pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
  return fail(THREAD) ? EAGAIN : next(thread, attributes, run, user);
}

enum { SQLITE_ERROR_IO = 10 };

int sqlite3_step(void *statement) {
  NEXT(int, "sqlite3_step", void *);
  return fail(SQLITE) ? SQLITE_ERROR_IO : next(statement);
}

int sqlite3_exec(void *db, const char *sql, int (*row)(void *, int, char **, char **), void *user, char **error) {
  NEXT(int, "sqlite3_exec", void *, const char *, int (*)(void *, int, char **, char **), void *, char **);
  return fail(SQLITE) ? SQLITE_ERROR_IO : next(db, sql, row, user, error);
}
