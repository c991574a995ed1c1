/* Makes calls of a program fail from outside: a library for LD_PRELOAD that intercepts malloc, write, fsync, rename,
 * open, SQLite calls and thread starts by any caller: the program, SQLite, the HTTP library, libc.
 *
 * ORB_FAIL_BOARD names a file of the size of struct board, which the test and the program map: the test writes which
 * call must fail and reads whether it did, as often as it likes while the program runs. ORB_FAIL_SITES names the list
 * of sites (8 * SITES bytes), which several programs may share. Kinds: alloc (NULL, ENOMEM), write (ENOSPC, to files
 * only), fsync (EIO), rename (EIO), folder (EIO from mkdir and unlink), open (EMFILE, of files and folders), thread
 * (EAGAIN), sqlite (SQLITE_IOERR from a step, an exec, a prepare). The library prints on stderr where a call failed.
 */
#include <dirent.h>
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
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum kind { ALLOC, WRITE, FSYNC, RENAME, FOLDER, OPEN, THREAD, SQLITE };
enum { DEPTH = 7, SHOWN = 16, SITES = 1 << 16 };
enum mode { OFF, ONCE, FOR_EVER };

/* Shared by the test and the program. A site is the chain of the innermost callers, as offsets in their modules, so it
 * is the same after a restart. */
struct board {
  atomic_uint mode; /* written last */
  uint32_t kind;
  uint32_t wanted;    /* the call that fails, counted from 1; 0: the first one at a site not in the list */
  atomic_uint met;    /* the call has failed; in mode ever, so do all later calls of the kind */
  atomic_uint passed; /* calls of the kind since the test set this to 0 */
};

static struct board *board;
static atomic_uint_fast64_t *sites; /* where a call has failed, open addressing; 0: free */
static __thread int inside __attribute__((tls_model("initial-exec")));

static void *next_of(const char *name) {
  inside++; /* dlsym() allocates */
  void *found = dlsym(RTLD_NEXT, name);
  inside--;
  return found;
}

static void *map_file(const char *file, size_t size) {
  long fd = file ? syscall(SYS_openat, AT_FDCWD, file, O_RDWR | O_CLOEXEC, 0) : -1;
  long at = fd < 0 ? -1 : syscall(SYS_mmap, NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, (int)fd, 0);
  if (fd >= 0) {
    syscall(SYS_close, (int)fd);
  }
  return at == -1 ? NULL : (void *)at;
}

__attribute__((constructor)) static void begin(void) {
  void *frames[4];
  inside++;
  backtrace(frames, 4);   /* loads its symbols now */
  unsetenv("LD_PRELOAD"); /* children run without faults */
  sites = map_file(getenv("ORB_FAIL_SITES"), SITES * sizeof *sites);
  board = sites ? map_file(getenv("ORB_FAIL_BOARD"), sizeof *board) : NULL;
  inside--;
}

/* Counts frames, so neither this function nor its callers may be inlined. */
__attribute__((noinline)) static uint64_t site_of(void) {
  void *frames[DEPTH + 3];
  int count = backtrace(frames, DEPTH + 3);
  uint64_t hash = 14695981039346656037u;
  for (int i = 3; i < count; i++) {
    struct dl_find_object module;
    int known = _dl_find_object(frames[i], &module) == 0;
    uint64_t at = known ? (uint64_t)((char *)frames[i] - (char *)module.dlfo_map_start) : 0;
    hash = (hash ^ at) * 1099511628211u;
    hash ^= hash >> 29;
  }
  return hash ? hash : 1;
}

/* The slot of the site in the list, or the free slot where it belongs. */
static atomic_uint_fast64_t *place_of(uint64_t site) {
  for (uint64_t i = site;; i++) {
    uint_fast64_t there = atomic_load(&sites[i % SITES]);
    if (there == 0 || there == site) {
      return &sites[i % SITES];
    }
  }
}

static void tell(void) {
  static const char text[] = "a call fails, called from:\n";
  void *frames[SHOWN];
  long done = syscall(SYS_write, 2, text, sizeof text - 1);
  (void)done;
  backtrace_symbols_fd(frames, backtrace(frames, SHOWN), 2);
}

__attribute__((noinline)) static int look(enum mode mode) {
  unsigned number = atomic_fetch_add(&board->passed, 1) + 1;
  if (atomic_load(&board->met)) {
    return mode == FOR_EVER;
  }
  uint64_t site = board->wanted ? 0 : site_of();
  atomic_uint_fast64_t *place = site ? place_of(site) : NULL;
  if (site ? atomic_load(place) == site : number < board->wanted) {
    return 0;
  }
  if (atomic_exchange(&board->met, 1)) {
    return mode == FOR_EVER;
  }
  if (site) {
    atomic_store(place, site);
  }
  tell();
  return 1;
}

__attribute__((noinline)) static int fail(enum kind kind) {
  if (!board || inside) {
    return 0;
  }
  enum mode mode = atomic_load(&board->mode);
  if (mode == OFF || board->kind != kind) {
    return 0;
  }
  int saved = errno;
  inside++;
  int hit = look(mode);
  inside--;
  errno = saved;
  return hit;
}

/* dlsym() allocates, so glibc's internal names serve until it has found the next function. */
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

#define NEXT(type, name, ...)       \
  static type (*next)(__VA_ARGS__); \
  next = next ? next : (type(*)(__VA_ARGS__))next_of(name)

/* Large blocks of the core. */
void *mmap(void *at, size_t size, int protection, int flags, int fd, off_t offset) {
  NEXT(void *, "mmap", void *, size_t, int, int, int, off_t);
  return (flags & MAP_ANONYMOUS) && fail(ALLOC) ? (errno = ENOMEM, MAP_FAILED)
                                                : next(at, size, protection, flags, fd, offset);
}

void *mmap64(void *at, size_t size, int protection, int flags, int fd, off64_t offset) {
  NEXT(void *, "mmap64", void *, size_t, int, int, int, off64_t);
  return (flags & MAP_ANONYMOUS) && fail(ALLOC) ? (errno = ENOMEM, MAP_FAILED)
                                                : next(at, size, protection, flags, fd, offset);
}

void *mremap(void *at, size_t old, size_t size, int flags, ...) {
  NEXT(void *, "mremap", void *, size_t, size_t, int, ...);
  return fail(ALLOC) ? (errno = ENOMEM, MAP_FAILED) : next(at, old, size, flags);
}

/* Only files: a socket or pipe has no disk to fill. */
static int is_file(int fd) {
  struct stat info;
  return fstat(fd, &info) == 0 && S_ISREG(info.st_mode);
}

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

int mkostemp64(char *path, int flags) {
  NEXT(int, "mkostemp64", char *, int);
  return fail(OPEN) ? (errno = EMFILE, -1) : next(path, flags);
}

FILE *fopen64(const char *path, const char *mode) {
  NEXT(FILE *, "fopen64", const char *, const char *);
  return fail(OPEN) ? (errno = EMFILE, NULL) : next(path, mode);
}

DIR *opendir(const char *path) {
  NEXT(DIR *, "opendir", const char *);
  return fail(OPEN) ? (errno = EMFILE, NULL) : next(path);
}

int mkdir(const char *path, mode_t mode) {
  NEXT(int, "mkdir", const char *, mode_t);
  return fail(FOLDER) ? (errno = EIO, -1) : next(path, mode);
}

int unlink(const char *path) {
  NEXT(int, "unlink", const char *);
  return fail(FOLDER) ? (errno = EIO, -1) : next(path);
}

int unlinkat(int folder, const char *path, int flags) {
  NEXT(int, "unlinkat", int, const char *, int);
  return fail(FOLDER) ? (errno = EIO, -1) : next(folder, path, flags);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *user) {
  NEXT(int, "pthread_create", pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
  return fail(THREAD) ? EAGAIN : next(thread, attributes, run, user);
}

/* AddressSanitizer asks where a new thread has its stack, and ends the process if there is no memory for the answer. */
int pthread_getattr_np(pthread_t thread, pthread_attr_t *attributes) {
  NEXT(int, "pthread_getattr_np", pthread_t, pthread_attr_t *);
  inside++;
  int status = next(thread, attributes);
  inside--;
  return status;
}

enum { SQLITE_ERROR_IO = 10 };

/* Calls within SQLite do not count: sqlite3_exec() takes its result from the statement, which saw no fault.
 */
static int is_own(void *caller, void *function) {
  struct dl_find_object from, to;
  return _dl_find_object(caller, &from) == 0 && _dl_find_object(function, &to) == 0 &&
         from.dlfo_map_start == to.dlfo_map_start;
}

#define SQLITE_FAILS() (!is_own(__builtin_return_address(0), (void *)next) && fail(SQLITE))

int sqlite3_step(void *statement) {
  NEXT(int, "sqlite3_step", void *);
  return SQLITE_FAILS() ? SQLITE_ERROR_IO : next(statement);
}

int sqlite3_exec(void *db, const char *sql, int (*row)(void *, int, char **, char **), void *user, char **error) {
  NEXT(int, "sqlite3_exec", void *, const char *, int (*)(void *, int, char **, char **), void *, char **);
  return SQLITE_FAILS() ? SQLITE_ERROR_IO : next(db, sql, row, user, error);
}

int sqlite3_prepare_v2(void *db, const char *sql, int size, void **statement, const char **rest) {
  NEXT(int, "sqlite3_prepare_v2", void *, const char *, int, void **, const char **);
  return SQLITE_FAILS() ? (*statement = NULL, SQLITE_ERROR_IO) : next(db, sql, size, statement, rest);
}

int sqlite3_prepare_v3(void *db, const char *sql, int size, unsigned flags, void **statement, const char **rest) {
  NEXT(int, "sqlite3_prepare_v3", void *, const char *, int, unsigned, void **, const char **);
  return SQLITE_FAILS() ? (*statement = NULL, SQLITE_ERROR_IO) : next(db, sql, size, flags, statement, rest);
}
