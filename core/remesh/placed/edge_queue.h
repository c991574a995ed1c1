/* A queue of net edges, first in, first out. It keeps their ends, because splits give half-edges new numbers. */
#ifndef ORB_REMESH_PLACED_EDGE_QUEUE_H
#define ORB_REMESH_PLACED_EDGE_QUEUE_H

#include "sphere/net.h"

/* Initialise with zeros; read ends[i] for i < count. */
typedef struct orb_edge_queue {
  int32_t (*ends)[2];
  int64_t count, capacity;
} orb_edge_queue;

ORB_MUST_CHECK orb_status orb_edge_queue_push(orb_context *ctx, orb_edge_queue *queue, int32_t v, int32_t w);
/* Pushes all edges at v. */
ORB_MUST_CHECK orb_status orb_edge_queue_push_star(orb_context *ctx, orb_edge_queue *queue, const orb_net *net,
                                                   int32_t v);
void orb_edge_queue_free(orb_context *ctx, orb_edge_queue *queue);

#endif
