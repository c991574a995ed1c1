/* Running one job; shared by the files of the worker. */
#ifndef ORB_WORKER_RUN_H
#define ORB_WORKER_RUN_H

#include <semaphore.h>

#include "api/mesh_codec.h"
#include "api/problem.h"
#include "api/supermesh_codec.h"
#include "isolate/task.h"
#include "net/networks.h"
#include "queue/queue.h"
#include "temporary.h"
#include "worker/progress.h"

typedef struct run_env {
  queue *q; /* NULL in a process of its own, as is the catalogue */
  catalogue *cat;
  objects *store;
  job_progress *progress; /* of the job; NULL outside a run */
  const char *tenant;     /* that requested the job; NULL in a process of its own */
  /* In place of catalogue_get(), in a process of its own. */
  store_result (*get)(void *user, resource_kind kind, const char *id, resource *out);
  void *user;
} run_env;

/* What a run needs to know of its job. */
typedef struct run_job {
  const char *key, *request;
  double embed_ms; /* that its embeddings took */
} run_job;

typedef struct run_output {
  resource row;  /* json is allocated with malloc(); NULL: the result existed already */
  int holds;     /* objects_hold() was called; let go after the row is committed */
  int gone;      /* an embedding that the job needs was deleted after planning */
  int64_t flips; /* that certificates of the result count */
} run_output;

/* Each runs a claimed job: 1 with *out filled, or 0 with the problem. A problem without a name: the context holds the
 * error. */
int run_embedding(const run_env *env, orb_context *ctx, const run_job *j, run_output *out, api_problem *problem);
int run_supermesh(const run_env *env, orb_context *ctx, const run_job *j, run_output *out, api_problem *problem);

/* A row of the catalogue. */
store_result run_get(const run_env *env, resource_kind kind, const char *id, resource *out);

typedef struct fetch_options {
  networks allowed;                /* besides public addresses */
  const char *authorities;         /* PEM file of certificate authorities; "": those of the system */
  int64_t total_ms, most;          /* limits on the time and the bytes of a download */
  int64_t disk_reserve;            /* bytes that it leaves free */
  int64_t check_ms, max_triangles; /* limits on the check */
  memory_budget *memory;           /* of checks */
  temporary *arriving;             /* counts the temporary files of downloads */
  sem_t *checks;                   /* limits how many check a mesh at once */
} fetch_options;
/* Downloads and stores the mesh of a taken job, and claims the job in between. 1 with the mesh; 0 with the problem as
 * above, or with *claimed 0: the claim could not be stored. */
int run_fetch(const run_env *env, const fetch_options *options, orb_context *ctx, job *j, char mesh[API_ID_SIZE],
              int *claimed, api_problem *problem);

/* A triangle of the file and its vertices in the file, recorded before the repair. */
typedef struct file_triangle {
  int32_t index, corners[3]; /* −1: not found */
} file_triangle;

/* The file of a shape; memory of the context. */
typedef struct run_file {
  int wants_mesh;       /* set by the caller */
  orb_mesh mesh;        /* from before the repair, if that is wanted */
  unsigned char *bytes; /* NULL unless the file is glTF or GLB */
  size_t size;
} run_file;

/* Reads an uploaded mesh and repairs it in the same way as at upload. noted may be NULL. corners (may be NULL): the
 * vertices of each triangle of the file, 3 per triangle, numbered as in the file; memory of the context. raw (may be
 * NULL) receives the file. */
int run_load_mesh(const run_env *env, orb_context *ctx, const char *id, orb_mesh *mesh, file_triangle *noted,
                  int32_t noted_count, int32_t **corners, run_file *raw, api_problem *problem);
/* The points of a stored sphere, 3 numbers per vertex; memory of the context. */
int run_load_points(const run_env *env, orb_context *ctx, const char *embedding, const orb_mesh *mesh, double **points,
                    api_problem *problem);

/* Turns a landmark of a request into a place on the mesh. *tree is created on first use. 0 with *why, or with *why NULL
 * and the error in the context. */
int run_place(orb_context *ctx, const orb_mesh *mesh, const api_place *spot, const file_triangle *noted,
              orb_nearest **tree, orb_place *out, const char **why);

#endif
