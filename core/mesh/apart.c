/* Which of many cycles leave the surface connected.
 *
 * All cycles together divide the surface into regions. Each cycle has a region on its left and one on its right, so the
 * regions are the nodes and the cycles the edges of a graph. The surface without some of the cycles is connected if and
 * only if the other cycles connect that graph. A spanning tree is the least that connects it: the cycles of a tree are
 * dropped, and the tree takes the longest cycles (Kruskal 1956).
 */
#include "mesh/apart.h"

#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"

orb_status orb_cycles_apart(orb_surface *s, orb_cycles *cycles) {
  int32_t faces = s->mesh->triangle_count, regions = faces, kept = 0;
  int32_t *root = ORB_NEW(s->ctx, int32_t, faces);
  unsigned char *on = ORB_NEW0(s->ctx, unsigned char, 3 * (size_t)faces),
                *drop = ORB_NEW0(s->ctx, unsigned char, cycles->count);
  orb_status status = root && on && drop ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < cycles->count && status == ORB_OK; i++) {
    for (int32_t k = 0; k < cycles->cycle[i].count; k++) {
      int32_t h = cycles->half_edges[cycles->cycle[i].start + k];
      on[h] = on[s->twin[h]] = 1;
    }
  }
  orb_forest_plant(root, status == ORB_OK ? faces : 0);
  for (int32_t h = 0; h < 3 * faces && status == ORB_OK; h++) {
    if (h < s->twin[h] && !on[h]) {
      regions -= orb_forest_join(root, h / 3, s->twin[h] / 3);
    }
  }
  for (int32_t i = cycles->count; i-- > 0 && status == ORB_OK;) {
    int32_t h = cycles->half_edges[cycles->cycle[i].start];
    drop[i] = (unsigned char)orb_forest_join(root, h / 3, s->twin[h] / 3);
    regions -= drop[i];
  }
  for (int32_t i = 0; i < cycles->count && status == ORB_OK; i++) {
    if (!drop[i]) {
      cycles->cycle[kept++] = cycles->cycle[i];
    }
  }
  if (status == ORB_OK) {
    ORB_ASSERT(regions == 1);
    cycles->count = kept;
  }
  orb_free(s->ctx, root);
  orb_free(s->ctx, on);
  orb_free(s->ctx, drop);
  return status;
}
