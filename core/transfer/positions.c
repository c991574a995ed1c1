/* Positions of a shape at the places of a supermesh. */
#include "base/parallel.h"
#include "orbmorph/transfer.h"

enum { GRAIN = 8192 }; /* places a thread takes at a time */

typedef struct position_job {
  const orb_mesh *mesh;
  const orb_place *places;
  double *out;
} position_job;

static void position_body(void *arg, int64_t begin, int64_t end, int thread) {
  position_job *job = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    const orb_place *place = &job->places[v];
    const int32_t *corner = job->mesh->triangles + 3 * (int64_t)place->triangle;
    double *out = job->out + 3 * v;
    out[0] = out[1] = out[2] = 0;
    for (int k = 0; k < 3; k++) {
      if (place->at[k] == 0) {
        continue; /* a place at a vertex then gives that vertex bit for bit */
      }
      const double *p = job->mesh->positions + 3 * (int64_t)corner[k];
      for (int c = 0; c < 3; c++) {
        out[c] += place->at[k] * p[c];
      }
    }
  }
}

orb_status orb_transfer_positions(orb_context *ctx, const orb_aligned_shape *shape, const orb_place *places,
                                  int32_t count, double *out) {
  position_job job = {&shape->mesh, places, out};
  orb_parallel_for(ctx, count, GRAIN, position_body, &job);
  return orb_context_check(ctx);
}
