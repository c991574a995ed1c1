/* Untangling moves more and more rings around a fold that it cannot clear, and spreads it. Most flips lie elsewhere,
 * and it clears those. So each part is judged by itself. Moved vertices of one triangle are neighbours, so a triangle
 * belongs to one part at most, and what is put back flips nothing in another part. */
#include "align/map/engine/folds.h"

#include <string.h>

#include "base/memory.h"
#include "numeric/predicates.h"

typedef struct search {
  const orb_map_level *level;
  const double *before;
  unsigned char *seen;
  int32_t *queue; /* the vertices of a part */
} search;

static int has_moved(const search *c, int32_t v) {
  return memcmp(c->before + 3 * (size_t)v, c->level->x + 3 * (size_t)v, sizeof(double[3])) != 0;
}

/* Lists the part of a moved vertex. Returns how many vertices it has. */
static int32_t list_part(search *c, int32_t from) {
  const orb_map_level *l = c->level;
  int32_t count = 1;
  c->queue[0] = from;
  c->seen[from] = 1;
  for (int32_t k = 0; k < count; k++) {
    const int32_t v = c->queue[k];
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const int32_t q = l->spoke[i].q; /* each neighbour is the first of one spoke */
      if (!c->seen[q] && has_moved(c, q)) {
        c->seen[q] = 1;
        c->queue[count++] = q;
      }
    }
  }
  return count;
}

static int star_has_flip(const orb_map_level *l, int32_t v) {
  const double *x = l->x;
  for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
    const orb_map_spoke *s = &l->spoke[i];
    if (orb_orient(x + 3 * (size_t)v, x + 3 * (size_t)s->q, x + 3 * (size_t)s->r) <= 0) {
      return 1;
    }
  }
  return 0;
}

/* Puts a part back if it has a flip. */
static void judge_part(const search *c, int32_t count, double *x) {
  int is_folded = 0;
  for (int32_t k = 0; k < count && !is_folded; k++) {
    is_folded = star_has_flip(c->level, c->queue[k]);
  }
  for (int32_t k = 0; k < count && is_folded; k++) {
    memcpy(x + 3 * (size_t)c->queue[k], c->before + 3 * (size_t)c->queue[k], sizeof(double[3]));
  }
}

orb_status orb_map_level_restore_folds(orb_context *ctx, orb_map_level *l, const double *before, int32_t *flips) {
  search c = {l, before, ORB_NEW0(ctx, unsigned char, l->count), ORB_NEW(ctx, int32_t, l->count)};
  const orb_status status = c.seen && c.queue ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; v < l->count && status == ORB_OK; v++) {
    if (!c.seen[v] && has_moved(&c, v)) {
      judge_part(&c, list_part(&c, v), l->x);
    }
  }
  *flips = orb_map_level_flips(l);
  orb_free(ctx, c.seen);
  orb_free(ctx, c.queue);
  return status;
}
