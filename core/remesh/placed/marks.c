#include "remesh/placed/marks.h"

uint64_t orb_mark_of_surroundings(const orb_net *net, int32_t v) {
  uint64_t sum = 0;
  int32_t first = net->out[v], h = first;
  do {
    int32_t w = net->triangles[orb_next(h)], begin = net->out[w], e = begin;
    sum += orb_mark_of_point(orb_net_point(net, w)) * 3;
    do {
      sum += orb_mark_of_point(orb_net_point(net, net->triangles[orb_next(e)]));
      e = net->twin[orb_prev(e)];
    } while (e != begin);
    h = net->twin[orb_prev(h)];
  } while (h != first);
  return sum;
}
