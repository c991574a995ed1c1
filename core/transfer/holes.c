#include "transfer/holes.h"

#include <math.h>
#include <stdio.h>

#include "base/check.h"
#include "base/memory.h"
#include "mesh/dropped.h"
#include "mesh/holes.h"
#include "numeric/vec3.h"

/* Area of a group of slivers, as a share of the surface. The coordinates of an asset are rounded by 6e-8, so a group
 * with less is no higher than rounding. */
static const double SLIVER = 1e-8;

/* A triangle of this height on the unit sphere is flat but for rounding: its corners lie on one arc. */
static const double FLAT = 1e-10;

enum { FLAT_MOST = 64 }; /* flat triangles beside each other; a guard */

typedef struct grouping {
  const orb_supermesh *supermesh;
  const orb_mesh *mesh;
  int32_t *home, *twin, *group; /* group: triangles of one, in the order in which they were found */
  unsigned char *seen;
} grouping;

static int fills(const grouping *g, int32_t t) {
  return g->mesh->source_triangle[g->home[t]] == ORB_MADE_FILL;
}

/* On the first shape. */
static double area_of(const grouping *g, int32_t t) {
  const int32_t *v = g->supermesh->triangles + 3 * (int64_t)t;
  double p[3][3];
  for (int k = 0; k < 3; k++) {
    orb_place_position(g->mesh, &g->supermesh->places[v[k]], p[k]);
  }
  return orb_triangle_area(p[0], p[1], p[2]);
}

/* The half-edge of t opposite to the corner between the two others, if t is flat; −1. */
static int32_t across_flat(const orb_supermesh *m, int32_t t) {
  const double *p[3];
  double most = 0;
  int longest = 0;
  for (int k = 0; k < 3; k++) {
    p[k] = m->points + 3 * (int64_t)m->triangles[3 * (int64_t)t + k];
  }
  for (int k = 0; k < 3; k++) {
    const double length2 = orb_distance2(p[k], p[(k + 1) % 3]);
    longest = length2 > most ? k : longest;
    most = fmax(most, length2);
  }
  return orb_det(p[0], p[1], p[2]) < FLAT * sqrt(most) ? 3 * t + longest : -1;
}

/* Of three vertices on one stretch of a rim, the outer two are joined by a chord, and the rim runs along the other two
 * edges of their triangle: it lies on the side of the triangle across the chord. Its centre does not say so, and where
 * another shape has a corner there, the triangle is not flat on that shape. */
static void settle_flat(const grouping *g) {
  for (int32_t t = 0; t < g->supermesh->triangle_count; t++) {
    int32_t at = t, h = across_flat(g->supermesh, t);
    for (int i = 0; i < FLAT_MOST && h >= 0; i++) {
      at = g->twin[h] / 3;
      h = across_flat(g->supermesh, at);
    }
    g->home[t] = h < 0 ? g->home[at] : g->home[t];
  }
}

/* Gathers the triangles that edges join to t on its side of the rims. Returns how many; *area: theirs; *beside: the
 * home of a triangle across a rim. */
static int32_t gather(grouping *g, int32_t t, double *area, int32_t *beside) {
  int32_t count = 1;
  g->group[0] = t;
  g->seen[t] = 1;
  *area = 0;
  *beside = g->home[t];
  for (int32_t i = 0; i < count; i++) {
    *area += area_of(g, g->group[i]);
    for (int k = 0; k < 3; k++) {
      const int32_t other = g->twin[3 * (int64_t)g->group[i] + k] / 3;
      if (fills(g, other) != fills(g, t)) {
        *beside = g->home[other];
      } else if (!g->seen[other]) {
        g->seen[other] = 1;
        g->group[count++] = other;
      }
    }
  }
  return count;
}

orb_status orb_holes_settle(orb_context *ctx, const orb_supermesh *supermesh, const orb_mesh *mesh, int32_t *home) {
  const int32_t count = supermesh->triangle_count;
  grouping g = {.supermesh = supermesh,
                .mesh = mesh,
                .home = home,
                .twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)count),
                .group = ORB_NEW(ctx, int32_t, count),
                .seen = ORB_NEW0(ctx, unsigned char, count)};
  orb_status status = g.twin && g.group && g.seen ? ORB_OK : ORB_E_NO_MEMORY;
  double all = 0;
  if (status != ORB_OK) {
    goto end;
  }
  ORB_GO(status, orb_mesh_twins(ctx, supermesh->triangles, count, supermesh->vertex_count, g.twin), end);
  settle_flat(&g);
  for (int32_t t = 0; t < count; t++) {
    all += area_of(&g, t);
  }
  for (int32_t t = 0; t < count; t++) {
    double area;
    int32_t beside, size = g.seen[t] ? 0 : gather(&g, t, &area, &beside);
    for (int32_t i = 0; i < size && area < SLIVER * all; i++) {
      home[g.group[i]] = beside;
    }
  }
end:
  orb_free(ctx, g.twin);
  orb_free(ctx, g.group);
  orb_free(ctx, g.seen);
  return status;
}

/* Is hole `hole` of a side, 0: the first shape, matched with one of shape s? */
static int is_matched(const orb_alignment *a, int32_t s, int side, int32_t hole) {
  for (int32_t i = 0; i < a->rim_count; i++) {
    if (a->rims[i].shape == s && a->rims[i].hole[side] == hole) {
      return 1;
    }
  }
  return 0;
}

/* Where both the first shape and shape s have holes: those without a counterpart. */
static orb_status drop_unmatched(orb_context *ctx, const orb_alignment *a, int32_t s, orb_dropped **list,
                                 int32_t *count) {
  static const struct {
    const char *of, *what, *why;
  } texts[2] = {
      {" of shapes[0]", "surface", "No hole of this shape corresponds to it, so the asset omits the surface there."},
      {"", "holes", "No hole of the first shape corresponds to it, so it stays filled."}};
  orb_hole_list holes[2] = {0};
  orb_status status;
  char where[64];
  ORB_GO(status, orb_holes_find(ctx, &a->shapes[0].mesh, &holes[0]), done);
  ORB_GO(status, orb_holes_find(ctx, &a->shapes[s].mesh, &holes[1]), done);
  for (int side = 0; side < 2; side++) {
    for (int32_t i = 0; i < holes[side].count; i++) {
      if (!is_matched(a, s, side, i)) {
        (void)snprintf(where, sizeof where, "shapes[%d], hole %d%s", s, i + 1, texts[side].of);
        ORB_GO(status, orb_dropped_add(ctx, list, count, texts[side].what, where, texts[side].why), done);
      }
    }
  }
done:
  orb_holes_free(ctx, &holes[0]);
  orb_holes_free(ctx, &holes[1]);
  return status;
}

orb_status orb_dropped_holes(orb_context *ctx, const orb_supermesh *supermesh, const orb_alignment *alignment,
                             const orb_asset_options *options, int is_file, int32_t *open, orb_dropped **list,
                             int32_t *count) {
  const orb_aligned_shape *shapes = alignment->shapes;
  const int first = orb_has_holes(&shapes[0].mesh);
  const int is_open = first && (is_file || (options->holes == ORB_HOLES_REOPEN && supermesh->has_rims));
  *open = 0;
  if (is_open) {
    orb_hole_list holes;
    ORB_TRY(orb_holes_find(ctx, &shapes[0].mesh, &holes));
    *open = holes.count;
    orb_holes_free(ctx, &holes);
  }
  if (first && !is_open && options->holes == ORB_HOLES_REOPEN) {
    ORB_TRY(orb_dropped_add(ctx, list, count, "holes", "shapes[0]",
                            "Their rims could not be made edges, so they stay filled; the methods overlay and template "
                            "always reopen them."));
  }
  if (is_open && options->holes == ORB_HOLES_FILLED) {
    ORB_TRY(orb_dropped_add(ctx, list, count, "fills", "shapes[0]",
                            "A template has exactly the triangles of its file, so its holes stay open."));
  }
  for (int32_t s = 1; s < supermesh->shape_count; s++) {
    char where[32];
    (void)snprintf(where, sizeof where, "shapes[%d]", s);
    const int has = orb_has_holes(&shapes[s].mesh);
    if (has && !is_open) {
      ORB_TRY(orb_dropped_add(ctx, list, count, "holes", where,
                              "Only holes of the first shape can be open, so those of this shape stay filled."));
    } else if (!has && is_open) {
      ORB_TRY(
          orb_dropped_add(ctx, list, count, "surface", where,
                          "The first shape has holes and this shape has none, so the asset omits the surface there."));
    } else if (has && is_open) {
      ORB_TRY(drop_unmatched(ctx, alignment, s, list, count));
    }
  }
  return ORB_OK;
}
