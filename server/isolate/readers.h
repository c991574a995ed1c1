/* Processes that check small files one after another. Starting a process costs more than checking a small file. Each
 * process serves one tenant.
 *
 * Such a process is confined like any other. As long as it lives, it holds the memory of the largest file that it may
 * get. It ends when its tenant sends no file for a moment, after READER_FILES files or READER_WORK_MS of work, and as
 * soon as others lack memory. It never gets a file of another tenant. If it dies after it has read other files, one of
 * those may be the cause, so the caller repeats the check in a process of its own.
 */
#ifndef ORB_ISOLATE_READERS_H
#define ORB_ISOLATE_READERS_H

#include "budget.h"
#include "isolate/isolate.h"

enum {
  READER_BYTES = 1 << 20, /* larger files take so long that a process of their own adds little */
  READER_FILES = 500,     /* a process adds a five-hundredth of its cost to each */
  READER_WORK_MS = 1000   /* beside the limit of a single check on processor time */
};

typedef struct reader {
  isolated process;
  int files;      /* that it has read before this one */
  int64_t memory; /* its limit, without the file */
  /* private */
  int state;
  char *tenant;
  budget_part part;
  int64_t began, work_ms; /* of its present file; of all files before */
  unsigned shortages;
} reader;

int readers_start(memory_budget *memory); /* 0: no thread; does nothing where isolation is off */
void readers_stop(void);

/* A process for a file of this tenant, or NULL: the check gets a process of its own. memory: that the check needs. */
reader *reader_take(const char *tenant, budget_part part, int64_t bytes, int64_t memory, orb_context *ctx);
/* The check has ended with an answer. */
void reader_give(reader *r);
/* Ends the process and returns its status, as isolate_close(). */
int reader_end(reader *r);

#endif
