/* Short closed walks along the edges of a closed surface that do not divide it: one for each handle. */
#ifndef ORB_MESH_CYCLES_H
#define ORB_MESH_CYCLES_H

#include "mesh/surface.h"

typedef struct orb_cycle {
  double length;
  uint64_t label;       /* of its homology class, not 0: see cycles.c */
  int32_t start, count; /* its half-edges, in order: half_edges[start] … */
} orb_cycle;

/* Cycles that share no vertex and that together leave the surface connected, shortest first. */
typedef struct orb_cycles {
  orb_cycle *cycle;
  int32_t *half_edges;
  int32_t count;
  int64_t settled; /* vertices, by the searches; one of many edges counts as several */
} orb_cycles;

/* Of as many cycles labels tell whether they leave the surface connected together: they have 64 bits. */
enum { ORB_CYCLES_LABELLED = 64 };

/* Finds cycles of at most `limit`; INFINITY: of any length, and at least one on a surface with handles, unless it runs
 * over faces that repairs made. Only edges with a face of the file are used. The surface is closed, consistent and in
 * one piece, and its vertices have one fan each. The shortest cycle of the surface, or one at most an eighth longer, is
 * among the result where its length is below a finite limit. most: how many to return; above ORB_CYCLES_LABELLED, each
 * leaves the surface connected, and orb_cycles_apart() keeps those that do so together. *allowed: how many vertices
 * searches within a finite limit may settle; they take what they settle from it. NULL: any number. ORB_E_TOO_LARGE: it
 * is used up. The caller frees the result also on failure.
 *
 * O(F log F), and a search within limit / 2 for each of O(√F · genus) seeds, but where such searches are long only for
 * one in each sixteenth of the limit, which is near linear unless all loops are just longer than the limit. With no
 * limit, a few whole searches. */
ORB_MUST_CHECK orb_status orb_cycles_find(orb_surface *surface, double limit, int32_t most, int64_t *allowed,
                                          orb_cycles *out);

/* Finds as many cycles of any length as share no vertex, shortest first, among those of generators and of searches near
 * them. Each leaves the surface connected; orb_cycles_apart() keeps those that do so together. settled: vertices that
 * the searches may settle, but 64 each. O(F log F + their total length). */
ORB_MUST_CHECK orb_status orb_cycles_generate(orb_surface *surface, int64_t settled, orb_cycles *out);

void orb_cycles_free(orb_context *ctx, orb_cycles *cycles);

#endif
