#include "remesh/placed/edge_queue.h"

#include "base/check.h"
#include "base/grow.h"

orb_status orb_edge_queue_push(orb_context *ctx, orb_edge_queue *queue, int32_t v, int32_t w) {
  if (queue->count == queue->capacity) {
    int64_t capacity = 2 * queue->capacity + 1024;
    if (!orb_regrow(ctx, &queue->ends, (size_t)capacity, sizeof *queue->ends)) {
      return ORB_E_NO_MEMORY;
    }
    queue->capacity = capacity;
  }
  queue->ends[queue->count][0] = v;
  queue->ends[queue->count++][1] = w;
  return ORB_OK;
}

orb_status orb_edge_queue_push_star(orb_context *ctx, orb_edge_queue *queue, const orb_net *net, int32_t v) {
  int32_t first = net->out[v], h = first;
  do {
    ORB_TRY(orb_edge_queue_push(ctx, queue, v, net->triangles[orb_next(h)]));
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return ORB_OK;
}

void orb_edge_queue_free(orb_context *ctx, orb_edge_queue *queue) {
  orb_free(ctx, queue->ends);
  *queue = (orb_edge_queue){0};
}
