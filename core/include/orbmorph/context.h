/* The context of a long call: memory budget, threads, progress, cancellation, and the error with its details.
 *
 * One context serves one job. Calls with the same context must not run at the same time, except those marked
 * "any thread". The library never prints, never exits, and reads neither the environment nor a global. Results belong
 * to the context that made them: free them with it, before it.
 */
#ifndef ORBMORPH_CONTEXT_H
#define ORBMORPH_CONTEXT_H

#include <stddef.h>
#include <stdint.h>

#include "orbmorph/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct orb_context orb_context;

enum { ORB_ERROR_ITEMS = 100 };

/* What is known of a failure. Numbers that do not apply are −1, counts 0. Vertex numbers are those of the file. */
typedef struct orb_error {
  orb_status status;
  char detail[512];       /* plain words that say what is wrong and what to do */
  int64_t line, offset;   /* where in the bytes: 1-based line of a text, byte offset of a binary */
  int64_t boundary_loops; /* not-closed */
  int64_t genus;          /* not-genus-zero */
  int64_t edge_total;     /* how many edges are at fault, of which `edges` holds the first edge_count */
  int32_t edge_count;
  int32_t edges[ORB_ERROR_ITEMS][2];
  int64_t vertex_total; /* vertices at fault, likewise */
  int32_t vertex_count;
  int32_t vertices[ORB_ERROR_ITEMS];
  int64_t component_total; /* not-connected: triangles of each piece, largest first */
  int32_t component_count;
  int64_t components[ORB_ERROR_ITEMS];
  int32_t landmark_count; /* bad-landmarks: which ones, by index in the request */
  int32_t landmarks[ORB_ERROR_ITEMS];
  int32_t shape; /* the shape at fault, −1 if none in particular */
} orb_error;

/* Called with the stage ("simplify", "embed", …) and the fraction of that stage that is done, 0 to 1. May be called
 * from any thread of the context, never from two at a time; must return at once. */
typedef void (*orb_progress_fn)(void *user, const char *stage, double fraction);

/* Where memory comes from; both NULL: malloc and free. For tests that fail the n-th allocation. Any thread. */
typedef struct orb_allocator {
  void *(*alloc)(void *user, size_t size);
  void (*free)(void *user, void *block);
  void *user;
} orb_allocator;

/* The widest vector instructions that the loops which have several versions may use; at most what the machine has. */
typedef enum orb_cpu { ORB_CPU_AUTO = 0, ORB_CPU_PLAIN, ORB_CPU_AVX2, ORB_CPU_AVX512 } orb_cpu;

typedef struct orb_context_options {
  size_t memory_limit;      /* bytes that live at once; 0: no limit */
  int threads;              /* threads to use in all; 0: as many as the machine has (at most 64) */
  int64_t deadline_ms;      /* orb_clock_ms() after which calls end with ORB_E_TIMEOUT; 0: none */
  int64_t max_triangles;    /* refuse larger meshes; 0: 5 million */
  orb_progress_fn progress; /* NULL: none */
  void *progress_user;
  orb_allocator allocator;
  orb_cpu cpu; /* for measurements and tests; results may differ in the last bits */
} orb_context_options;

/* Makes a context; options NULL: all defaults. Threads start with the first parallel loop. ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_context_create(const orb_context_options *options, orb_context **out);

/* Ends it: joins its threads. NULL is fine. All that it allocated must have been freed: asserted. */
void orb_context_destroy(orb_context *ctx);

/* Asks running calls to end soon (ORB_E_CANCELLED), within 100 ms. Any thread. Stays set. */
void orb_context_cancel(orb_context *ctx);

/* ORB_OK, ORB_E_CANCELLED or ORB_E_TIMEOUT, with the error set; cheap, to be asked often. Any thread. */
ORB_MUST_CHECK orb_status orb_context_check(orb_context *ctx);

/* The error of the last call that failed. Valid until the next failing call. */
const orb_error *orb_context_error(const orb_context *ctx);

/* Sets the error with a fresh record (all facts empty) and returns status. Any thread: the first one of a parallel
 * loop wins until orb_error_clear(). */
orb_status orb_fail(orb_context *ctx, orb_status status, const char *format, ...) ORB_PRINTF(3, 4);

/* The record, to add facts to it after orb_fail(). */
orb_error *orb_context_error_edit(orb_context *ctx);
void orb_error_clear(orb_context *ctx);

/* Reports progress; any thread, may drop calls. */
void orb_progress(orb_context *ctx, const char *stage, double fraction);

/* From now on only this stage is reported: what works for one calls functions that have stages of their own. NULL: any.
 * The text is not copied and must last until it is replaced. Returns what held before, to be set again at the end. Not
 * within a parallel loop. */
const char *orb_progress_only(orb_context *ctx, const char *stage);

/* Memory. Blocks are 64-byte aligned. count × size is checked for overflow and against the budget; NULL when it
 * cannot be had, with the error set to ORB_E_NO_MEMORY. A count of 0 gives a valid block. Any thread. */
void *orb_alloc(orb_context *ctx, size_t count, size_t size);
void *orb_calloc(orb_context *ctx, size_t count, size_t size);
/* Grows or shrinks a block of orb_alloc (or NULL); on failure NULL, the old block stays. */
void *orb_realloc(orb_context *ctx, void *block, size_t count, size_t size);
void orb_free(orb_context *ctx, void *block); /* NULL is fine */
size_t orb_memory_used(const orb_context *ctx);
size_t orb_memory_peak(const orb_context *ctx);

/* Typed allocation: ORB_NEW(ctx, double, 3 * n). */
#define ORB_NEW(ctx, type, count) ((type *)orb_alloc((ctx), (size_t)(count), sizeof(type)))
#define ORB_NEW0(ctx, type, count) ((type *)orb_calloc((ctx), (size_t)(count), sizeof(type)))

/* Threads. */
int orb_threads(const orb_context *ctx);

/* The version that is used: never ORB_CPU_AUTO. */
orb_cpu orb_context_cpu(const orb_context *ctx);

/* The body of a parallel loop: work on [begin, end) as thread number `thread` (0 ≤ thread < orb_threads()). */
typedef void (*orb_loop_fn)(void *arg, int64_t begin, int64_t end, int thread);

/* Runs body over [0, count) in chunks of `grain` (≥ 1), in parallel; returns when all is done. Chunks begin at
 * multiples of grain whatever the number of threads, so a sum of per-chunk sums taken in order does not depend on it.
 * Which thread takes which chunk is not fixed. Not to be nested. One chunk or one thread: runs in the caller. */
void orb_parallel_for(orb_context *ctx, int64_t count, int64_t grain, orb_loop_fn body, void *arg);

/* Milliseconds of a monotonic clock, and the same in seconds. */
int64_t orb_clock_ms(void);
double orb_clock(void);

/* A growing buffer of bytes with a hard maximum. Zero-initialise all but `max`. */
typedef struct orb_buffer {
  unsigned char *data;
  size_t size, capacity;
  size_t max; /* 0: 4 GiB − 1 */
} orb_buffer;
ORB_MUST_CHECK orb_status orb_buffer_append(orb_context *ctx, orb_buffer *buffer, const void *bytes, size_t size);
ORB_MUST_CHECK orb_status orb_buffer_printf(orb_context *ctx, orb_buffer *buffer, const char *format, ...)
    ORB_PRINTF(3, 4);
void orb_buffer_free(orb_context *ctx, orb_buffer *buffer);

#ifdef __cplusplus
}
#endif
#endif
