/* The memory of all processes that read callers' bytes, accounted before each of them starts.
 *
 * Let J be job-memory. Jobs that workers run may take J together. Beside them, checks of large files, fetched meshes
 * and profiles of assets may take J/2 together, and checks of small files and guests J/4. So none of these waits for
 * one before it in this list. Each process is limited to what was taken for it, and all of them together to 7/4 of J.
 */
#ifndef ORB_BUDGET_H
#define ORB_BUDGET_H

#include <stdint.h>

enum { BUDGET_SMALL_FILE = 256 << 10 }; /* the check of a smaller one takes less than a second (docs/limits.md) */

typedef struct memory_budget memory_budget;
typedef enum budget_part { BUDGET_JOBS, BUDGET_CHECKS, BUDGET_SMALL, BUDGET_PARTS } budget_part;

memory_budget *budget_create(int64_t job_memory); /* NULL: out of memory */
void budget_destroy(memory_budget *b);
/* Sets a function that is called when memory becomes free after a call found too little. Before threads start; at most
 * BUDGET_LISTENERS. */
enum { BUDGET_LISTENERS = 4 };
void budget_listen(memory_budget *b, void (*freed)(void *user), void *user);

/* The bytes that a part may give to one process. */
int64_t budget_most(const memory_budget *b, budget_part part);
/* 1: taken. 0: there is no room now. bytes: at most budget_most(). */
int budget_take(memory_budget *b, budget_part part, int64_t bytes);
int budget_has_room(memory_budget *b, budget_part part, int64_t bytes);
/* The room of a part, below 0 if it lent more than it has. Unlike the calls above, this one never counts as a shortage.
 */
int64_t budget_left(memory_budget *b, budget_part part);
/* Changes whenever a caller finds too little room. Processes that keep memory for later use then give it back. */
unsigned budget_shortages(memory_budget *b, budget_part part);
void budget_wait(memory_budget *b, budget_part part, int64_t bytes); /* takes them as soon as there is room */
/* Gives back what was taken. If there was too little room for someone since the last time, calls the listeners but that
 * of the user `self`, whose lock the caller may hold. */
void budget_give(memory_budget *b, budget_part part, int64_t bytes, const void *self);

/* What the check of a file of other programs needs, and what the densest files known need (docs/limits.md); at most
 * budget_most(). */
int64_t budget_for_file(const memory_budget *b, budget_part part, int64_t bytes);
/* fills: the repair fills holes. */
int64_t budget_for_densest_file(const memory_budget *b, budget_part part, int64_t bytes, int fills);

#endif
