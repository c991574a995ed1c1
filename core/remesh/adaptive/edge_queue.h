/* Edges of a net that wait to be looked at, first in, first out. They are kept by their ends: half-edges change hands
 * when triangles are split. */
#ifndef ORB_REMESH_ADAPTIVE_EDGE_QUEUE_H
#define ORB_REMESH_ADAPTIVE_EDGE_QUEUE_H

#include "sphere/net.h"

/* Zero-initialise; read ends[i] for i < count. */
typedef struct orb_edge_queue {
  int32_t (*ends)[2];
  int64_t count, capacity;
} orb_edge_queue;

ORB_MUST_CHECK orb_status orb_edge_queue_push(orb_context *ctx, orb_edge_queue *queue, int32_t v, int32_t w);
/* All edges at v. */
ORB_MUST_CHECK orb_status orb_edge_queue_push_star(orb_context *ctx, orb_edge_queue *queue, const orb_net *net,
                                                   int32_t v);
void orb_edge_queue_free(orb_context *ctx, orb_edge_queue *queue);

#endif
