/* The surroundings of each vertex of a mesh, from which it takes its first rotation. They depend on the mesh alone, so
 * registrations along several rough maps share them. */
#ifndef ORB_ELASTIC_SURROUNDINGS_H
#define ORB_ELASTIC_SURROUNDINGS_H

#include "elastic/body.h"

/* The surroundings of vertex v are list[v · most] and the next ones, size[v] of them, nearest rings first. */
typedef struct orb_surroundings {
  int32_t most;
  int32_t *size, *list;
} orb_surroundings;

/* Vertices of the surroundings in a mesh of n vertices. */
int32_t orb_surroundings_most(int32_t n);

/* The vertices around v, nearest rings first: `most` of them, if there are as many. mark: a number per vertex, zero
 * before the first call. Returns how many. */
int32_t orb_surroundings_list(const orb_body *body, int32_t v, int32_t most, int32_t *mark, int32_t *list);

/* Lists the surroundings of all vertices: n · orb_surroundings_most(n) numbers, 1 MB for a thousand vertices. Free
 * `out` in any case. O(n²). */
ORB_MUST_CHECK orb_status orb_surroundings_create(orb_context *ctx, const orb_mesh *mesh, orb_surroundings *out);
void orb_surroundings_free(orb_context *ctx, orb_surroundings *surroundings);

#endif
