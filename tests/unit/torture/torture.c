#include "torture/torture.h"

#include <cjson/cJSON.h>
#include <dirent.h>
#include <errno.h>
#include <pthread.h>
#include <sqlite3.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>

static atomic_int armed, met;
static atomic_long passed;
static torture_kind armed_kind;
static long armed_number;
static int armed_for_ever;
static sqlite3_mem_methods plain;

int torture_fails(torture_kind kind);
int torture_fails(torture_kind kind) {
  if (!atomic_load(&armed) || armed_kind != kind) {
    return 0;
  }
  long number = atomic_fetch_add(&passed, 1) + 1;
  if (number == armed_number || (armed_for_ever && number > armed_number)) {
    atomic_store(&met, 1);
    return 1;
  }
  return 0;
}

void torture_arm(torture_kind kind, long number, int for_ever) {
  armed_kind = kind;
  armed_number = number;
  armed_for_ever = for_ever;
  atomic_store(&passed, 0);
  atomic_store(&met, 0);
  atomic_store(&armed, 1);
}

int torture_disarm(void) {
  atomic_store(&armed, 0);
  return atomic_load(&met);
}

long torture_count(void) {
  return atomic_load(&passed);
}

long torture(torture_run run, void *user, torture_kind kind, int for_ever, long first, long last, int step) {
  long number = first;
  while (number <= last && run(user, kind, number, for_ever)) {
    number += step;
  }
  return (number - first) / step;
}

static void *sqlite_malloc(int size) {
  return torture_fails(TORTURE_ALLOC) ? NULL : plain.xMalloc(size);
}
static void *sqlite_realloc(void *block, int size) {
  return torture_fails(TORTURE_ALLOC) ? NULL : plain.xRealloc(block, size);
}
static void *json_malloc(size_t size) {
  return malloc(size);
}

void torture_begin(void) {
  cJSON_InitHooks(&(cJSON_Hooks){json_malloc, free});
  if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &plain) != SQLITE_OK) {
    abort();
  }
  sqlite3_mem_methods ours = plain;
  ours.xMalloc = sqlite_malloc;
  ours.xRealloc = sqlite_realloc;
  if (sqlite3_config(SQLITE_CONFIG_MALLOC, &ours) != SQLITE_OK ||
      sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 0, 0) != SQLITE_OK) {
    abort();
  }
}

/* The linker redirects the calls to these functions and names the originals __real_…: -Wl,--wrap. */
#define WRAP(type, name, kind, failed, arguments, names)       \
  type __real_##name arguments;                                \
  type __wrap_##name arguments;                                \
  type __wrap_##name arguments {                               \
    return torture_fails(kind) ? failed : __real_##name names; \
  }
#define FAILED(code, value) (errno = (code), (value))

WRAP(void *, malloc, TORTURE_ALLOC, FAILED(ENOMEM, NULL), (size_t size), (size))
WRAP(void *, calloc, TORTURE_ALLOC, FAILED(ENOMEM, NULL), (size_t count, size_t size), (count, size))
WRAP(void *, realloc, TORTURE_ALLOC, FAILED(ENOMEM, NULL), (void *block, size_t size), (block, size))
WRAP(char *, strdup, TORTURE_ALLOC, FAILED(ENOMEM, NULL), (const char *text), (text))
WRAP(void *, mmap64, TORTURE_ALLOC, FAILED(ENOMEM, MAP_FAILED),
     (void *at, size_t size, int protection, int flags, int fd, off_t from), (at, size, protection, flags, fd, from))
WRAP(int, sqlite3_step, TORTURE_SQLITE, SQLITE_IOERR, (sqlite3_stmt * statement), (statement))
WRAP(int, sqlite3_exec, TORTURE_SQLITE, SQLITE_IOERR,
     (sqlite3 * db, const char *sql, int (*row)(void *, int, char **, char **), void *user, char **error),
     (db, sql, row, user, error))
WRAP(int, sqlite3_prepare_v3, TORTURE_SQLITE, (*out = NULL, SQLITE_IOERR),
     (sqlite3 * db, const char *sql, int size, unsigned flags, sqlite3_stmt **out, const char **rest),
     (db, sql, size, flags, out, rest))
WRAP(int, mkostemp64, TORTURE_FILE, FAILED(EIO, -1), (char *path, int flags), (path, flags))
WRAP(DIR *, opendir, TORTURE_FILE, FAILED(EIO, NULL), (const char *path), (path))
WRAP(int, mkdir, TORTURE_FILE, FAILED(EIO, -1), (const char *path, mode_t mode), (path, mode))
WRAP(ssize_t, write, TORTURE_FILE, FAILED(EIO, -1), (int fd, const void *bytes, size_t size), (fd, bytes, size))
WRAP(int, fsync, TORTURE_FILE, FAILED(EIO, -1), (int fd), (fd))
WRAP(int, rename, TORTURE_FILE, FAILED(EIO, -1), (const char *from, const char *to), (from, to))
WRAP(int, unlink, TORTURE_FILE, FAILED(EIO, -1), (const char *path), (path))
WRAP(int, pthread_create, TORTURE_THREAD, EAGAIN,
     (pthread_t * thread, const pthread_attr_t *attributes, void *(*run)(void *), void *user),
     (thread, attributes, run, user))

int __real_open64(const char *path, int flags, ...);
int __wrap_open64(const char *path, int flags, ...);
int __wrap_open64(const char *path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  unsigned mode = va_arg(arguments, unsigned);
  va_end(arguments);
  return torture_fails(TORTURE_FILE) ? FAILED(EIO, -1) : __real_open64(path, flags, mode);
}

void *__real_mremap(void *at, size_t old, size_t size, int flags, ...);
void *__wrap_mremap(void *at, size_t old, size_t size, int flags, ...);
void *__wrap_mremap(void *at, size_t old, size_t size, int flags, ...) {
  return torture_fails(TORTURE_ALLOC) ? FAILED(ENOMEM, MAP_FAILED) : __real_mremap(at, old, size, flags);
}
