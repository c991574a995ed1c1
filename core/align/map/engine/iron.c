/* A part is a set of marked vertices that edges between marked vertices connect. No triangle has vertices of two parts,
 * and vertices outside are pinned, so the parts do not affect each other: each is kept or restored by itself. */
#include "align/map/engine/iron.h"

#include <math.h>
#include <string.h>

#include "align/map/engine/loosen.h"
#include "align/map/engine/rounds.h"
#include "align/map/engine/unfold.h"
#include "align/map/engine/untangle.h"
#include "base/check.h"
#include "base/memory.h"

typedef struct ironing {
  orb_map_run *c;
  orb_map_level *l;
  unsigned char *mark, *pinned; /* of the vertices of all parts, with room for as many again; what was pinned before */
  int32_t *part, *queue;        /* of each vertex, −1: none */
  int32_t parts;
  double *before, *after; /* energy of each part */
} ironing;

static void take_part(ironing *w, int32_t from) {
  const orb_map_level *l = w->l;
  int32_t count = 1;
  w->queue[0] = from;
  w->part[from] = w->parts;
  for (int32_t k = 0; k < count; k++) {
    const int32_t v = w->queue[k];
    for (int32_t i = l->start[v]; i < l->start[v + 1]; i++) {
      const int32_t q = l->spoke[i].q; /* each neighbour is the first of one spoke */
      if (w->mark[q] && w->part[q] < 0) {
        w->part[q] = w->parts;
        w->queue[count++] = q;
      }
    }
  }
  w->parts++;
}

static void take_parts(ironing *w) {
  w->parts = 0;
  memset(w->part, -1, (size_t)w->l->count * sizeof *w->part);
  for (int32_t v = 0; v < w->l->count; v++) {
    if (w->mark[v] && w->part[v] < 0) {
      take_part(w, v);
    }
  }
}

/* Pins all vertices outside of the parts, or releases them again. */
static void hold_others(ironing *w, int hold) {
  for (int32_t v = 0; v < w->l->count; v++) {
    w->l->pinned[v] = w->pinned[v] || (hold && !w->mark[v]);
  }
}

/* Restores the parts that have not gained. */
static void restore(ironing *w, const orb_map_copy *copy) {
  for (int32_t v = 0; v < w->l->count; v++) {
    const int32_t part = w->part[v];
    if (part >= 0 && !(w->after[part] < w->before[part])) {
      orb_map_copy_restore_vertex(copy, w->l, v);
    }
  }
}

static orb_status iron_parts(ironing *w, const orb_map_copy *copy) {
  const orb_map_params *p = &w->c->params;
  orb_map_level_part_energies(w->l, w->part, w->parts, w->before);
  ORB_TRY(orb_map_level_set_anew(w->c->ctx, w->l, w->mark));
  ORB_TRY(orb_map_level_locate_all(w->c->ctx, w->l, &w->c->b, 0));
  ORB_TRY(orb_map_sweeps(w->c, w->l, orb_map_hard(p), p->iron.sweeps));
  ORB_TRY(orb_map_loosen(w->c, w->l, p->level.loosen, p->iron.loosen, p->iron.loosen));
  orb_map_level_part_energies(w->l, w->part, w->parts, w->after);
  restore(w, copy);
  return ORB_OK;
}

/* A round over the parts around triangles above an energy. */
static orb_status iron_round(ironing *w, double limit, int rings) {
  orb_map_copy copy = {0};
  orb_status status;
  if (orb_map_level_mark_above(w->l, limit, w->mark) == 0) {
    return ORB_OK;
  }
  orb_map_level_grow_marks(w->l, rings, w->mark, w->mark + w->l->count);
  take_parts(w);
  hold_others(w, 1);
  ORB_GO(status, orb_map_copy_take(w->c, w->l, &copy), done);
  status = iron_parts(w, &copy);
done:
  hold_others(w, 0);
  orb_map_copy_free(w->c, &copy);
  return status;
}

orb_status orb_map_iron(orb_map_run *c, orb_map_level *l) {
  const size_t n = (size_t)l->count;
  const orb_map_params *p = &c->params;
  ironing w = {.c = c,
               .l = l,
               .mark = ORB_NEW(c->ctx, unsigned char, 2 * n),
               .pinned = ORB_NEW(c->ctx, unsigned char, n),
               .part = ORB_NEW(c->ctx, int32_t, n),
               .queue = ORB_NEW(c->ctx, int32_t, n),
               .before = ORB_NEW(c->ctx, double, n),
               .after = ORB_NEW(c->ctx, double, n)};
  orb_status status = w.mark && w.pinned && w.part && w.queue && w.before && w.after ? ORB_OK : ORB_E_NO_MEMORY;
  double last = INFINITY, energy = orb_map_level_energy(l);
  if (status == ORB_OK) {
    memcpy(w.pinned, l->pinned, n);
  }
  for (int i = 0; i < ORB_MAP_IRON_ROUNDS && status == ORB_OK; i++) {
    if (energy <= p->iron.enough || energy > (1 - p->iron.gain) * last) {
      break;
    }
    status = iron_round(&w, p->iron.round[i].crumpled, p->iron.round[i].rings);
    last = energy;
    energy = orb_map_level_energy(l);
  }
  orb_free(c->ctx, w.mark);
  orb_free(c->ctx, w.pinned);
  orb_free(c->ctx, w.part);
  orb_free(c->ctx, w.queue);
  orb_free(c->ctx, w.before);
  orb_free(c->ctx, w.after);
  return status;
}
