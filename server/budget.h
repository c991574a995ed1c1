/* The memory of all processes that read callers' bytes, accounted before each of them starts.
 *
 * Let J be job-memory. Jobs that workers run may take J together; checks of large files, fetched meshes and profiles of
 * assets J/2; checks of small files and guests J/4. All of them together take at most J and BUDGET_BESIDE (or 3/4 of J,
 * if that is less), of which BUDGET_KEPT (or J/4) is kept for small files and guests. So these wait for nothing else.
 * Jobs and large checks wait for each other only where they need more than that together. Then they take turns: one
 * that waits claims its memory, and later ones of the other part leave it free.
 */
#ifndef ORB_BUDGET_H
#define ORB_BUDGET_H

#include <stdint.h>

enum { BUDGET_SMALL_FILE = 256 << 10 }; /* the check of a smaller one takes less than a second (docs/limits.md) */
/* Bytes. KEPT: the densest small file and a small job. BESIDE: with the daemon itself and what its processes take
 * besides their work, less than 300 MB. */
enum { BUDGET_KEPT = 120 << 20, BUDGET_BESIDE = 200 << 20 };

typedef struct memory_budget memory_budget;
typedef enum budget_part { BUDGET_JOBS, BUDGET_CHECKS, BUDGET_SMALL, BUDGET_PARTS } budget_part;

/* Whether there is room for so many bytes of a part. */
typedef enum budget_room {
  BUDGET_FULL,   /* others of the part hold it */
  BUDGET_OTHERS, /* another part holds it or claims it */
  BUDGET_FREE
} budget_room;

/* A claim of one who waits. Starts as {.part = …} and must not move or end while it has bytes. */
typedef struct budget_claim {
  budget_part part;
  int64_t bytes;             /* private, as the next two */
  struct budget_claim *next; /* newer */
} budget_claim;

memory_budget *budget_create(int64_t job_memory); /* NULL: out of memory */
void budget_destroy(memory_budget *b);
/* Sets a function that is called when memory becomes free after a call found too little. Before threads start; at most
 * BUDGET_LISTENERS. */
enum { BUDGET_LISTENERS = 4 };
void budget_listen(memory_budget *b, void (*freed)(void *user), void *user);

/* The bytes that a part may give to one process. */
int64_t budget_most(const memory_budget *b, budget_part part);
/* Takes the bytes if the result is BUDGET_FREE. bytes: at most budget_most(). own: the caller's claim, which newer ones
 * do not hinder; may be NULL. */
budget_room budget_take(memory_budget *b, budget_part part, int64_t bytes, const budget_claim *own);
budget_room budget_look(memory_budget *b, budget_part part, int64_t bytes, const budget_claim *own);
/* Sets what a caller waits for: 0 when it no longer waits, or nobody could take it. A caller that lowers its claim
 * without taking memory calls budget_tell(). */
void budget_claim_bytes(memory_budget *b, budget_claim *claim, int64_t bytes);
/* The room of a part; may be below 0. Unlike the calls above, this one never counts as a shortage. */
int64_t budget_left(memory_budget *b, budget_part part);
/* Changes whenever a caller finds too little room. Processes that keep memory for later use then give it back. */
unsigned budget_shortages(memory_budget *b, budget_part part);
/* Takes the bytes as soon as there is room. 0: continues(user), called a few times a second, returned 0. */
int budget_wait(memory_budget *b, budget_part part, int64_t bytes, int (*continues)(void *user), void *user);
/* Gives back what was taken. If there was too little room for someone since the last time, calls the listeners but that
 * of the user `self`, whose lock the caller may hold. */
void budget_give(memory_budget *b, budget_part part, int64_t bytes, const void *self);
/* The same after a claim was lowered. */
void budget_tell(memory_budget *b, const void *self);

/* What the check of a file of other programs needs, and what the densest files known need (docs/limits.md); at most
 * budget_most(). */
int64_t budget_for_file(const memory_budget *b, budget_part part, int64_t bytes);
/* fills: the repair fills holes. */
int64_t budget_for_densest_file(const memory_budget *b, budget_part part, int64_t bytes, int fills);
/* What a profile of an asset of so many bytes needs, of BUDGET_CHECKS; at most half of that part. */
int64_t budget_for_profile(const memory_budget *b, int64_t bytes);

#endif
