/* What one job does; shared by the files of the worker. */
#ifndef ORB_WORKER_RUN_H
#define ORB_WORKER_RUN_H

#include "api/mesh_codec.h"
#include "api/problem.h"
#include "api/supermesh_codec.h"
#include "queue/queue.h"

typedef struct run_env {
  queue *q;
  catalogue *cat;
  objects *store;
} run_env;

typedef struct run_output {
  resource row; /* json of malloc() */
  int holds;    /* objects_hold() was called, for what was published; until the row is committed */
  int gone;     /* an embedding that the job needs was removed after it was planned */
} run_output;

/* Each runs a claimed job: 1 with *out filled, or 0 with the problem. A problem without a name means that the context
 * holds the error. */
int run_embedding(const run_env *env, orb_context *ctx, job *j, run_output *out, api_problem *problem);
int run_supermesh(const run_env *env, orb_context *ctx, job *j, run_output *out, api_problem *problem);

/* A file's triangle as its corners' vertices in the file, noted before the repair. */
typedef struct file_triangle {
  int32_t index, corners[3]; /* −1: not found */
} file_triangle;

/* Reads an uploaded mesh again and repairs it as at upload. noted may be NULL. corners (may be NULL): 3 a triangle of
 * the file, its vertices in the file; of the context. */
int run_load_mesh(const run_env *env, orb_context *ctx, const char *id, orb_mesh *mesh, file_triangle *noted,
                  int32_t noted_count, int32_t **corners, api_problem *problem);
/* The points of a stored sphere: 3 a vertex, of the context. */
int run_load_points(const run_env *env, orb_context *ctx, const char *embedding, const orb_mesh *mesh, double **points,
                    api_problem *problem);

/* Landmarks of a request as places on the meshes. */
int run_place(orb_context *ctx, const orb_mesh *mesh, const api_place *spot, const file_triangle *noted,
              orb_nearest **tree, orb_place *out, const char **why);

void run_problem_of_store(store_result result, api_problem *problem);

#endif
