/* The scrub: a thread that, in rounds, compares all objects with their hashes at `scrub-rate`, looks for objects
 * without a row and rows without an object, and checks the catalogue. What it finds goes to the log, and as numbers to
 * /metrics and /readyz?verbose; wrong objects are quarantined (store/verify.h). */
#ifndef ORB_SCRUB_H
#define ORB_SCRUB_H

#include <stdint.h>

#include "store/catalogue.h"

/* Of the last complete round, except the sums. */
typedef struct scrub_report {
  int64_t rounds, bytes; /* sums since the start; bytes: read from objects */
  int64_t ended;         /* Unix time in seconds; 0: no round has ended */
  int64_t objects;       /* compared with their hashes */
  int64_t missing;       /* a row names them, and they do not exist or were moved to quarantine */
  int64_t unreadable;    /* input/output errors */
  int64_t without_row;   /* objects that no row names */
  int catalogue_damaged; /* PRAGMA quick_check found damage when it was last run, at the beginning of a round */
} scrub_report;

typedef struct scrub scrub;

/* rate: bytes per second; every: ms from the start of a round to the start of the next. NULL: no thread. */
scrub *scrub_start(catalogue *cat, objects *store, int64_t rate, int64_t every);
void scrub_stop(scrub *s); /* s may be NULL */
/* s NULL: all 0. Any thread. */
void scrub_read(scrub *s, scrub_report *out);

#endif
