/* Torture: the first, second, third … call of a kind fails, each in a separate run, until a run meets no failure.
 *
 * Programs named test_…torture… are linked so that their calls, and those of the project's libraries in them, pass
 * through torture.c; SQLite's allocations do, too, without its per-connection reserve. */
#ifndef TORTURE_H
#define TORTURE_H

typedef enum torture_kind {
  TORTURE_ALLOC,  /* malloc, calloc, realloc, strdup, mmap, mremap, operator new, cJSON's and SQLite's */
  TORTURE_SQLITE, /* sqlite3_step, sqlite3_exec, sqlite3_prepare_v3: SQLITE_IOERR */
  TORTURE_FILE,   /* open, mkostemp, opendir, mkdir, write, fsync, rename, unlink: EIO */
  TORTURE_THREAD, /* pthread_create: EAGAIN */
} torture_kind;

/* Before anything else, once: SQLite takes its allocator only then. */
void torture_begin(void);

/* A run works between torture_arm() and torture_disarm() and then checks the result. */
void torture_arm(torture_kind kind, long number, int for_ever);
int torture_disarm(void); /* returns whether a call failed */
long torture_count(void); /* calls of the kind since torture_arm() */

/* run(user, kind, number, for_ever) returns the result of torture_disarm(). The runs fail the calls `first`, `first` +
 * `step` … up to `last` at most, and end when one meets no failure. Returns the number of runs with a failure. */
typedef int (*torture_run)(void *user, torture_kind kind, long number, int for_ever);
long torture(torture_run run, void *user, torture_kind kind, int for_ever, long first, long last, int step);

#endif
