/* Solves the Laplacian of a graph for three right-hand sides at once. */
#ifndef ORB_TRANSFER_LAPLACE_H
#define ORB_TRANSFER_LAPLACE_H

#include "transfer/graph.h"
#include "transfer/groups.h"

/* Moves x (3 per vertex) to a solution of L x = rhs. r: in, rhs − L x; out, what is left of it. Ends when the energy of
 * the error that is left, measured by r and the preconditioned r, is at most `limit` in each of the three. Conjugate
 * gradients, some hundred iterations of O(V), in parallel; the result does not depend on the number of threads. */
ORB_MUST_CHECK orb_status orb_laplace_solve(orb_context *ctx, const orb_edge_graph *graph, orb_groups *groups,
                                            double limit, double *r, double *x);

#endif
