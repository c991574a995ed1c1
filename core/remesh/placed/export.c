#include "remesh/placed/export.h"

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "remesh/common/supermesh.h"
#include "remesh/placed/bound.h"

/* Vertices a thread locates at a time, and vertices between two checks for cancellation. */
enum { GRAIN = 512, SLICE = 8192 };

typedef struct place_loop {
  const orb_placed_net *placed;
  const int32_t *number; /* per net vertex: its number in the supermesh */
  orb_supermesh *out;
} place_loop;

static void place_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  place_loop *loop = arg;
  const orb_placed_net *placed = loop->placed;
  for (int64_t v = begin; v < end; v++) {
    for (int32_t s = 0; s < placed->shape_count && placed->net.out[v] >= 0; s++) {
      orb_locate(placed->job->locator[s], placed->net.points + 3 * v, placed->spot[v * placed->shape_count + s].h / 3,
                 &loop->out->places[(int64_t)s * loop->out->vertex_count + loop->number[v]]);
    }
  }
}

orb_status orb_placed_export(orb_context *ctx, const orb_placed_net *placed, orb_supermesh *out) {
  int32_t *number = ORB_NEW(ctx, int32_t, placed->net.vertex_count);
  orb_status status = number ? orb_net_export(ctx, &placed->net, out, number) : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    out->places = ORB_NEW(ctx, orb_place, (int64_t)placed->shape_count * out->vertex_count);
    status = out->places ? ORB_OK : ORB_E_NO_MEMORY;
  }
  if (status == ORB_OK) {
    place_loop loop = {placed, number, out};
    status = orb_sliced_by(ctx, placed->net.vertex_count, SLICE, GRAIN, place_range, &loop);
  }
  if (status == ORB_OK) {
    status = orb_placed_bounds(ctx, placed, out->error_bound);
  }
  orb_free(ctx, number);
  return status;
}
