/* Turns a file into a stored mesh. http/meshes.c calls it for uploads, worker/run_fetch.c for downloads.
 *
 * The mesh is checked even if another tenant already owns it: neither the answer nor its time may reveal that.
 */
#ifndef ORB_INTAKE_H
#define ORB_INTAKE_H

#include "api/mesh_codec.h"
#include "budget.h"
#include "isolate/task.h"
#include "store/catalogue.h"

typedef struct intake_file {
  object_temp *temp;
  int64_t size;
  unsigned char *bytes; /* mapped, or, of a small file, allocated */
  const api_upload *upload;
  orb_format format; /* as which the file is read */
  char id[API_ID_SIZE], sha[API_ID_SIZE];
} intake_file;

/* Maps or reads a complete temporary file and computes the id of its mesh. hash: of its bytes. 0: no memory. The file
 * keeps pointers to temp and upload. */
int intake_open(intake_file *file, object_temp *temp, const api_hash *hash, int64_t size, const api_upload *upload);
void intake_close(intake_file *file); /* leaves the temporary file */

/* Limits on a check; the context has the same. */
typedef struct intake_limits {
  int64_t memory, deadline_ms, max_triangles;
  budget_part part; /* of which the memory is */
  int (*wanted)(
      void *user); /* called many times a second while a process checks: 0 ends the process; NULL: always wanted */
  void *user;
} intake_limits;

/* The result of storing a file. */
typedef struct intake_stored {
  int fresh;    /* the tenant did not own the mesh before */
  resource row; /* if this file was the first of its mesh: the row that all see; else without json. resource_free() */
} intake_stored;

/* Reads, repairs and checks the mesh, publishes the file and makes the tenant an owner. STORE_CONFLICT: the tenant's
 * quota in bytes (0: no limit) has no room, and nothing is stored. If the mesh is refused, the result is STORE_OK and
 * *problem says why. */
store_result intake_store(const intake_file *file, catalogue *cat, objects *store, orb_context *ctx,
                          const intake_limits *limits, const char *tenant, int64_t quota, intake_stored *out,
                          api_problem *problem);

/* Within a process of its own: checks the mesh in a file, which is `sent` or else in the descriptor (isolate/task.h). 1
 * with its description, or 0 with the problem. */
int intake_check_here(const task_head *task, const unsigned char *sent, int fd, orb_context *ctx, api_text *json,
                      api_problem *problem);

/* Restores the object of a known mesh from this file if it is lost or has other bytes. O(size). */
void intake_restore(const intake_file *file, objects *store);

#endif
