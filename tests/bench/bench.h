/* orbmorph-bench: measures the library in-process and prints one JSON object a line. */
#ifndef ORB_TESTS_BENCH_H
#define ORB_TESTS_BENCH_H

#include "api/supermesh_codec.h"
#include "api/text.h"
#include "orbmorph/merge.h"

/* Exit statuses. */
enum { BENCH_DONE = 0, BENCH_REFUSED = 1, BENCH_USAGE = 2 };

typedef struct bench_options {
  int threads, repeat;
  orb_cpu cpu;
  unsigned repair;
  const char *out, *landmarks;
  orb_embed_options embed;
  orb_merge_options merge;
  int align_given;
  const char *sizes; /* landmarks: how many in a set, by turns */
  long sets, first, merge_every, seconds;
  uint64_t seed;
  const char *methods; /* truth: a list with commas; NULL: all */
  long given;          /* truth: landmarks that the alignment gets; −1: all */
  const char *bodies;  /* remesh: sizes of generated bodies, with commas */
  const char *keep;    /* remesh: a file for the alignment */
  char **files;
  int file_count;
} bench_options;

int bench_embed(const bench_options *options);
int bench_merge(const bench_options *options);
int bench_landmarks(const bench_options *options);
int bench_pairs(const bench_options *options);
int bench_truth(const bench_options *options);
int bench_remesh(const bench_options *options);

/* A file in memory, of malloc(); 0 with a message on standard error. */
int bench_slurp(const char *path, unsigned char **bytes, size_t *size);
/* Writes a buffer; 0 with a message. */
int bench_spill(const char *path, const unsigned char *bytes, size_t size);

/* "dir/cow.obj" → "cow". */
void bench_name_of(const char *path, char name[ORB_NAME_MAX]);

/* A context with so many threads; ends the program when there is no memory. */
orb_context *bench_open(int threads, orb_cpu cpu);

/* Peak of the resident set since the last reset. Where the kernel cannot reset it: since the program began. */
void bench_reset_peak(void);
int64_t bench_peak(void);
/* Processor time of all threads so far, in seconds. */
double bench_cpu(void);

/* Prints why on standard error, `path: detail`. */
void bench_complain(const char *path, const orb_context *ctx);

/* Ends a line: prints the text and frees it. 0 out of memory. */
int bench_print(api_text *line);

/* A mesh as the daemon takes it: read, then repaired. */
typedef struct bench_mesh {
  char name[ORB_NAME_MAX];
  orb_mesh mesh;
  int32_t raw_triangle_count;
  int32_t *raw_corners; /* 3 a triangle of the file: its vertices in the file */
  double read_seconds, check_seconds;
} bench_mesh;
int bench_load(orb_context *ctx, const char *path, unsigned repair, int keep_corners, bench_mesh *out);
void bench_unload(orb_context *ctx, bench_mesh *mesh);

/* Many meshes, each read and embedded once. */
typedef struct bench_fleet {
  orb_context *ctx;
  int count;
  bench_mesh *mesh;
  orb_embedding *embedding;
} bench_fleet;
int bench_fleet_load(const bench_options *options, bench_fleet *out);
void bench_fleet_free(bench_fleet *fleet);
/* A context that gives up after options->seconds (0: never). */
orb_context *bench_open_limited(const bench_options *options);

/* The place that a caller names; 0 and why (a literal). */
int bench_place(orb_context *ctx, const bench_mesh *mesh, const api_place *spot, orb_nearest **tree, orb_place *out,
                const char **why);

/* The shapes of one merge, embedded. */
typedef struct bench_set {
  int32_t count;
  bench_mesh mesh[API_SHAPES_MAX];
  orb_embedding embedding[API_SHAPES_MAX];
  orb_align_shape shape[API_SHAPES_MAX];
  const char *name[API_SHAPES_MAX];
  api_landmark_list list;
  orb_landmark *landmarks;
  orb_place *places;
  double read, embed;
} bench_set;

/* Reads and embeds options->files; 0 with a message. count is set by the caller. */
int bench_set_load(orb_context *ctx, const bench_options *options, bench_set *set);
void bench_set_free(orb_context *ctx, bench_set *set);

/* A body with limbs, of at least so many triangles, with a certified embedding; 0 on failure. */
int bench_body(orb_context *ctx, int32_t triangles, uint64_t seed, orb_aligned_shape *out);

#endif
