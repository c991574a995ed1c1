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
  orb_repair_options repair;
  const char *out, *landmarks;
  orb_embed_options embed;
  orb_merge_options merge;
  int align_given;
  const char *sizes; /* landmarks: numbers per set; the sets cycle through them */
  long sets, first, merge_every, seconds;
  uint64_t seed;
  const char *methods; /* truth: a comma-separated list; NULL: all */
  long given;          /* truth: number of landmarks for the alignment; −1: all */
  const char *bodies;  /* remesh: triangles of each generated body, comma-separated */
  const char *keep;    /* remesh: the file that stores the alignment */
  char **files;
  int file_count;
} bench_options;

int bench_embed(const bench_options *options);
int bench_merge(const bench_options *options);
int bench_landmarks(const bench_options *options);
int bench_pairs(const bench_options *options);
int bench_truth(const bench_options *options);
int bench_remesh(const bench_options *options);

/* Reads a file into a buffer from malloc(). Prints the reason and returns 0 on failure. */
int bench_slurp(const char *path, unsigned char **bytes, size_t *size);
/* Writes a buffer to a file. Prints the reason and returns 0 on failure. */
int bench_spill(const char *path, const unsigned char *bytes, size_t size);

/* "dir/cow.obj" → "cow". */
void bench_name_of(const char *path, char name[ORB_NAME_MAX]);

/* Creates a context; exits the program when out of memory. */
orb_context *bench_open(int threads, orb_cpu cpu);

/* Peak of the resident set in bytes since the last reset, or since the start where the kernel cannot reset it. */
void bench_reset_peak(void);
int64_t bench_peak(void);
/* Processor time of all threads since the program began, in seconds. */
double bench_cpu(void);

/* Prints the error of the context on standard error as `path: status: detail`. */
void bench_complain(const char *path, const orb_context *ctx);

/* Prints the text as one line and frees it. Returns 0 when out of memory or when the write fails. */
int bench_print(api_text *line);

/* A mesh that was read and repaired as the daemon does it. */
typedef struct bench_mesh {
  char name[ORB_NAME_MAX];
  orb_mesh mesh;
  int32_t raw_triangle_count;
  int32_t *raw_corners; /* 3 per triangle of the file: its vertices in the file */
  double read_seconds, check_seconds;
} bench_mesh;
int bench_load(orb_context *ctx, const char *path, orb_repair_options repair, int keep_corners, bench_mesh *out);
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
/* Creates a context whose deadline is options->seconds from now (0: none). */
orb_context *bench_open_limited(const bench_options *options);

/* Finds the place that a landmark names. Returns 0 and the reason (a string literal) in *why on failure. */
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

/* Reads and embeds options->files. The caller sets count. Prints the reason and returns 0 on failure. */
int bench_set_load(orb_context *ctx, const bench_options *options, bench_set *set);
void bench_set_free(orb_context *ctx, bench_set *set);

/* Generates a body with limbs, at least `triangles` triangles and a certified embedding. Returns 0 on failure. */
int bench_body(orb_context *ctx, int32_t triangles, uint64_t seed, orb_aligned_shape *out);

#endif
