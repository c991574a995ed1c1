/* A coarse correction for conjugate gradients on a graph Laplacian: vertices are lumped into a few hundred groups,
 * whose small system is solved exactly. It carries information over long distances, which a diagonal preconditioner
 * passes from vertex to vertex only (two-level additive Schwarz without overlap). */
#ifndef ORB_TRANSFER_GROUPS_H
#define ORB_TRANSFER_GROUPS_H

#include "orbmorph/context.h"

typedef struct orb_groups {
  int32_t vertex_count, group_count;
  int32_t *group; /* per vertex */
  double *factor; /* Cholesky factor, group_count², row-major, lower */
  double *sums;   /* 3·group_count: the result of orb_groups_solve() */
} orb_groups;

/* Neighbours of v are neighbor[first[v]] …, with symmetric positive weights. */
ORB_MUST_CHECK orb_status orb_groups_create(orb_context *ctx, const int32_t *first, const int32_t *neighbor,
                                            const double *weight, int32_t vertex_count, orb_groups *out);
void orb_groups_free(orb_context *ctx, orb_groups *groups);

/* Solves the groups' system for r (3 per vertex): the correction of group g is groups->sums[3g] … sums[3g + 2]. */
void orb_groups_solve(orb_groups *groups, const double *r);

#endif
