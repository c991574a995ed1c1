/* The context of a long call: memory budget, threads, progress, cancellation, and the error with its details.
 *
 * One context serves one job. Calls with the same context must not run at the same time, except those marked
 * "any thread". The library does not print, does not exit, and reads neither the environment nor global variables; only
 * a broken invariant inside it ends the process, with a message on standard error and abort(). Results belong to the
 * context that made them: free them with that context, before you destroy it.
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

enum { ORB_ERROR_ITEMS = 100, ORB_ERROR_LOOPS = 32768, ORB_ERROR_LOOP_VERTICES = 262144 };

/* A part of a glTF document. */
typedef struct orb_error_element {
  char where[32]; /* such as "meshes[0]" */
  char name[64];  /* its name in the document; "": none */
} orb_error_element;

/* The facts of a failure. Numbers that do not apply are −1, counts 0. Vertex numbers are those of the file. */
typedef struct orb_error {
  orb_status status;
  char detail[512];       /* a sentence: what is wrong and what to do */
  int64_t line, offset;   /* where in the bytes: 1-based line of a text, byte offset of a binary */
  int64_t boundary_loops; /* not-closed */
  int64_t genus;          /* not-genus-zero */
  int64_t edge_total;     /* offending edges; `edges` holds the first edge_count of them */
  int32_t edge_count;
  int32_t edges[ORB_ERROR_ITEMS][2];
  int64_t vertex_total; /* offending vertices, likewise */
  int32_t vertex_count;
  int32_t vertices[ORB_ERROR_ITEMS];
  int64_t component_total; /* not-connected: triangles of each piece, largest first */
  int32_t component_count;
  int64_t components[ORB_ERROR_ITEMS];
  int32_t landmark_count; /* bad-landmarks: their indices in the request */
  int32_t landmarks[ORB_ERROR_ITEMS];
  int32_t shape;         /* the offending shape, −1 if none in particular */
  int32_t transfer;      /* the offending entry of "transfer", −1 likewise */
  int64_t element_total; /* offending parts of the shape's glTF document; `elements` holds the first of them */
  int32_t element_count;
  orb_error_element elements[ORB_ERROR_ITEMS];
  /* not-genus-zero: closed walks along edges of the file. Each handle has one, until the arrays are full; genus −
   * loop_count handles have none. Loop i has the vertices loop_vertices[loop_start[i]] … loop_vertices[loop_start[i +
   * 1] − 1], each once. */
  int32_t loop_count, loop_start[ORB_ERROR_LOOPS + 1];
  double loop_length_relative[ORB_ERROR_LOOPS]; /* to the diagonal */
  int32_t loop_vertices[ORB_ERROR_LOOP_VERTICES];
  char component_names[ORB_ERROR_ITEMS][128]; /* of `components`; "": the file gives none */
  char component_nodes[ORB_ERROR_ITEMS][128]; /* of `components`: glTF nodes */
} orb_error;

/* Called with the stage ("simplify", "embed", …) and the fraction of that stage that is done, 0 to 1. Any thread of the
 * context may call it, but never two at a time; it must return quickly. */
typedef void (*orb_progress_fn)(void *user, const char *stage, double fraction);

/* Where memory comes from; both NULL: malloc() and free(). Tests use it to fail the n-th allocation. Any thread of the
 * context may call it. */
typedef struct orb_allocator {
  void *(*alloc)(void *user, size_t size);
  void (*free)(void *user, void *block);
  void *user;
} orb_allocator;

/* The widest vector instructions that loops with several versions may use; at most those of the machine. */
typedef enum orb_cpu { ORB_CPU_AUTO = 0, ORB_CPU_PLAIN, ORB_CPU_AVX2, ORB_CPU_AVX512 } orb_cpu;

/* Counts what libraries take by C++'s operator new. Core counts what it can know beforehand: not the tables of Draco's
 * entropy coder. A program that replaces operator new counts those too, such as the daemon (server/isolate/meter.cc).
 * Core calls it around each call of such a library, on the thread of that call: what operator new takes from then on
 * counts for ctx, and the budget has `counted` bytes of it already; again when the budget has more; and with NULL at
 * the end. The program charges what is beyond them (orb_memory_charge()), lets operator new throw std::bad_alloc where
 * the budget has no room, and discharges it at the end. */
typedef void (*orb_meter_fn)(orb_context *ctx, size_t counted);

typedef struct orb_context_options {
  size_t memory_limit;      /* bytes allocated at one time; 0: no limit */
  int threads;              /* including the caller's, at most 64; 0: one for each processor */
  int64_t deadline_ms;      /* once orb_clock_ms() is past it, calls return ORB_E_TIMEOUT; 0: none */
  int64_t max_triangles;    /* refuse larger meshes; 0: 5 million */
  orb_progress_fn progress; /* NULL: none */
  void *progress_user;
  orb_allocator allocator;
  orb_meter_fn meter; /* NULL: nothing counts these */
  orb_cpu cpu;        /* for measurements and tests; the last bits of results may differ from value to value */
} orb_context_options;

/* Makes a context; options NULL: all defaults. Threads start with the first parallel loop. ORB_E_NO_MEMORY. */
ORB_API ORB_MUST_CHECK orb_status orb_context_create(const orb_context_options *options, orb_context **out);

/* Joins the threads and frees the context. NULL is fine. Ends the process with a message if a block of the context has
 * not been freed. */
ORB_API void orb_context_destroy(orb_context *ctx);

/* Makes running and later calls return ORB_E_CANCELLED, within 100 ms. Any thread. */
ORB_API void orb_context_cancel(orb_context *ctx);

/* ORB_OK, ORB_E_CANCELLED or ORB_E_TIMEOUT, with the error set. Cheap: long loops call it often. Any thread. */
ORB_API ORB_MUST_CHECK orb_status orb_context_check(orb_context *ctx);

/* The error of the last call that failed. Valid until the next failing call. */
ORB_API const orb_error *orb_context_error(const orb_context *ctx);

/* Memory of the context, charged to its budget. Callers need it for the arrays of a mesh that they build themselves:
 * orb_mesh_free(), orb_mesh_repair() and others free and replace those arrays. Blocks are 64-byte aligned,
 * uninitialised, and freed by orb_free() alone. count × size is checked for overflow and against the budget; on failure
 * the result is NULL and the error ORB_E_NO_MEMORY. A count of 0 gives a valid block. Any thread. */
ORB_API void *orb_alloc(orb_context *ctx, size_t count, size_t size);
ORB_API void orb_free(orb_context *ctx, void *block); /* NULL is fine */
/* Counts memory in the budget that the caller holds by other means, such as a file in memory: ORB_OK or
 * ORB_E_NO_MEMORY. The caller discharges it before it destroys the context. Any thread. */
ORB_API ORB_MUST_CHECK orb_status orb_memory_charge(orb_context *ctx, size_t bytes);
ORB_API void orb_memory_discharge(orb_context *ctx, size_t bytes);
ORB_API size_t orb_memory_used(const orb_context *ctx);
/* The largest use so far, in bytes: a budget for the same work must allow it. */
ORB_API size_t orb_memory_peak(const orb_context *ctx);

/* For a program that computes and ends, such as one process for each job: malloc() keeps up to 64 MiB of freed memory,
 * which the system would otherwise take back and hand out again page by page, many times in an alignment. Contexts with
 * a memory_limit count what is kept: it goes back where the limit has no room for it. Changes settings of the whole
 * process, so the library never calls it; to be called before the program starts threads. Without the C library of GNU
 * it does nothing.
 * With ORB_HEAP_TUNABLES in ORB_HEAP_VARIABLE of the environment that such a program starts with, the heap also asks
 * for huge pages. Only a program that starts reads the variable. docs/library.md says what both bring. */
ORB_API void orb_keep_heap(void);
#define ORB_HEAP_VARIABLE "GLIBC_TUNABLES"
#define ORB_HEAP_TUNABLES "glibc.malloc.hugetlb=1"

/* The number of threads that loops run on, including the caller's. */
ORB_API int orb_threads(const orb_context *ctx);

/* The vector instructions in use: never ORB_CPU_AUTO. */
ORB_API orb_cpu orb_context_cpu(const orb_context *ctx);

/* A monotonic clock, in milliseconds and in seconds. */
ORB_API int64_t orb_clock_ms(void);
ORB_API double orb_clock(void);

/* A growing buffer of bytes with a hard maximum, to which writers such as orb_asset_write() append. Callers can append
 * bytes of their own, for example a file that they read in parts, under the same budget. Zero-initialise all but `max`.
 */
typedef struct orb_buffer {
  unsigned char *data;
  size_t size, capacity;
  size_t max; /* 0: 4 GiB − 1 */
} orb_buffer;
ORB_API ORB_MUST_CHECK orb_status orb_buffer_append(orb_context *ctx, orb_buffer *buffer, const void *bytes,
                                                    size_t size);
ORB_API void orb_buffer_free(orb_context *ctx, orb_buffer *buffer);

#ifdef __cplusplus
}
#endif
#endif
