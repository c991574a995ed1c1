/* Repair and diagnosis.
 *
 * Problems are reported in the order in which the owner has to solve them: edges of three faces (such a surface has no
 * orientation, holes or handles to speak of), an orientation that cannot be made consistent, holes, vertices where fans
 * touch, pieces, handles, too few faces. With `safe` each repair comes just before the diagnosis that it can avert.
 *
 * A vertex where fans touch is split unless that takes the mesh apart. Two bodies that are joined at one vertex are
 * refused as not manifold there, with the sizes of both, rather than as two pieces.
 */
#include <string.h>

#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"
#include "mesh/edit.h"
#include "mesh/fill.h"
#include "mesh/handles.h"
#include "mesh/parts.h"
#include "mesh/refuse.h"
#include "mesh/split.h"
#include "mesh/weld.h"
#include "numeric/vec3.h"

static int is_safe(unsigned repair) {
  return repair != ORB_REPAIR_NONE;
}

/* Whether two faces lie over the same vertices: all three neighbours of one are the other. */
static int has_doubled_face(const orb_surface *s) {
  for (int32_t t = 0; t < s->mesh->triangle_count; t++) {
    const int32_t *twin = s->twin + 3 * (size_t)t;
    if (twin[0] >= 0 && twin[1] >= 0 && twin[2] >= 0 && twin[0] / 3 == twin[1] / 3 && twin[1] / 3 == twin[2] / 3) {
      return 1;
    }
  }
  return 0;
}

static orb_status drop_duplicates(orb_surface *s) {
  if (s->edges.crowded == 0 && !has_doubled_face(s)) {
    return ORB_OK;
  }
  int32_t count = 0;
  ORB_TRY(orb_mesh_flag_duplicates(s->ctx, s->mesh, NULL, NULL, s->reversed, NULL, &count));
  if (count == 0) {
    return ORB_OK;
  }
  orb_mesh_note(s->mesh, "duplicate-faces", orb_mesh_drop_faces(s->mesh, s->reversed));
  return orb_surface_rematch(s);
}

static orb_status drop_degenerate(orb_surface *s) {
  if (orb_mesh_flag_degenerate(s->mesh, s->reversed) == 0) {
    return ORB_OK;
  }
  orb_mesh_note(s->mesh, "degenerate-faces", orb_mesh_drop_faces(s->mesh, s->reversed));
  return orb_surface_rematch(s);
}

/* Unites the pieces that meet at crowded edges: orb_surface_pieces() crosses edges of two faces only. */
static orb_status join_crowded(orb_surface *s, int32_t *root) {
  const int32_t *triangles = s->mesh->triangles;
  int64_t crowded = 0;
  for (int32_t h = 0; h < 3 * s->mesh->triangle_count; h++) {
    crowded += s->twin[h] == ORB_CROWDED;
  }
  uint64_t *entry = ORB_NEW(s->ctx, uint64_t, crowded);
  int32_t *start = ORB_NEW0(s->ctx, int32_t, (size_t)s->mesh->vertex_count + 2);
  orb_status status = orb_refuse_sort_edges(s, ORB_CROWDED, entry, start);
  for (int64_t i = 1; i < crowded && status == ORB_OK; i++) {
    int32_t g = (int32_t)(uint32_t)entry[i - 1], h = (int32_t)(uint32_t)entry[i];
    int32_t glow = triangles[g] < triangles[orb_next(g)] ? triangles[g] : triangles[orb_next(g)];
    int32_t hlow = triangles[h] < triangles[orb_next(h)] ? triangles[h] : triangles[orb_next(h)];
    if (glow == hlow && entry[i - 1] >> 32 == entry[i] >> 32) {
      orb_forest_join(root, s->piece[g / 3], s->piece[h / 3]);
    }
  }
  orb_free(s->ctx, entry);
  orb_free(s->ctx, start);
  return status;
}

/* Keeps one piece: the largest, or the one that the options name. */
static orb_status keep_piece(orb_surface *s, const orb_repair_options *options) {
  ORB_TRY(orb_surface_pieces(s));
  if (s->piece_count < 2 && !(options->repair & ORB_REPAIR_PART)) {
    return ORB_OK;
  }
  int32_t *root = ORB_NEW(s->ctx, int32_t, s->piece_count);
  orb_parts parts = {0};
  orb_status status = root ? ORB_OK : ORB_E_NO_MEMORY;
  orb_forest_plant(root, status == ORB_OK ? s->piece_count : 0);
  if (status == ORB_OK && s->edges.crowded > 0) {
    status = join_crowded(s, root);
  }
  for (int32_t t = 0; t < s->mesh->triangle_count && status == ORB_OK; t++) {
    s->piece[t] = orb_forest_root(root, s->piece[t]);
  }
  if (status == ORB_OK) {
    status = orb_parts_list(s, &parts);
  }
  if (status == ORB_OK) {
    int32_t kept = options->repair & ORB_REPAIR_PART ? orb_parts_find(s, &parts, options) : 0;
    status = kept < 0 ? orb_refuse_part(s, &parts, options) : ORB_OK;
    if (status == ORB_OK && parts.count > 1) {
      for (int32_t t = 0; t < s->mesh->triangle_count; t++) {
        s->reversed[t] = s->piece[t] != parts.part[kept].piece;
      }
      (void)orb_mesh_drop_faces(s->mesh, s->reversed);
      orb_mesh_note(s->mesh, options->repair & ORB_REPAIR_PART ? "part" : "largest_component", parts.count - 1);
      status = orb_surface_rematch(s);
    }
  }
  orb_free(s->ctx, root);
  orb_free(s->ctx, parts.part);
  return status;
}

static void reverse_flagged(orb_mesh *mesh, const unsigned char *flag, unsigned char value) {
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    if (flag[t] == value) {
      orb_mesh_reverse_face(mesh, t);
    }
  }
}

/* Orients the faces consistently. *reversed: flags of the faces that it reversed, for face_outward(); NULL: none. */
static orb_status make_consistent(orb_surface *s, unsigned repair, unsigned char **reversed) {
  ORB_TRY(orb_surface_pieces(s));
  if (s->conflict >= 0 || (s->edges.same_way > 0 && !is_safe(repair))) {
    return orb_refuse_facing(s);
  }
  if (s->edges.same_way == 0) {
    return ORB_OK;
  }
  *reversed = ORB_NEW(s->ctx, unsigned char, s->mesh->triangle_count);
  if (!*reversed) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(*reversed, s->reversed, (size_t)s->mesh->triangle_count);
  reverse_flagged(s->mesh, *reversed, 1);
  return orb_surface_rematch(s);
}

/* Where what fills holes has at least this share of the area, the mesh is a sheet: its two sides are as good, so it
 * faces as its file does. The volume of a flat one is only rounding, and a bowl may be seen from inside. */
static const double SHEET = 0.25;

static int is_sheet(const orb_mesh *mesh, int32_t old, double area) {
  double fills = 0;
  for (int32_t t = old; t < mesh->triangle_count; t++) {
    const int32_t *v = mesh->triangles + 3 * (size_t)t;
    if (mesh->source_triangle[t] == ORB_MADE_FILL) {
      fills += orb_triangle_area_at(mesh->positions, v);
    }
  }
  return fills >= SHEET * area;
}

/* Faces the mesh outward, by its signed volume, unless it is a sheet. reversed: from make_consistent(), or NULL. old:
 * the faces it covers; the others fill holes. */
static void face_outward(orb_mesh *mesh, const unsigned char *reversed, int32_t old) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  int inside_out = extent.volume < 0 && !is_sheet(mesh, old, extent.area);
  if (inside_out) {
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
      orb_mesh_reverse_face(mesh, t);
    }
  }
  if (!reversed) {
    orb_mesh_note(mesh, "turn-inside-out", inside_out ? mesh->triangle_count : 0);
    return;
  }
  int64_t count = 0;
  for (int32_t t = 0; t < old; t++) {
    count += reversed[t] != inside_out;
  }
  orb_mesh_note(mesh, "reorient", count);
}

/* made: what the new triangles are. */
static orb_status close_surface(orb_surface *s, unsigned repair, int32_t made) {
  if (s->edges.open == 0) {
    return ORB_OK;
  }
  if (!(repair & ORB_REPAIR_FILL_HOLES)) {
    return orb_refuse_open(s);
  }
  orb_fans fans;
  ORB_TRY(orb_surface_fans(s, 1, &fans)); /* so that each boundary vertex lies on one loop, once */
  orb_mesh_note(s->mesh, "split-vertices", fans.pinched);
  int64_t loops;
  const int32_t old = s->mesh->triangle_count;
  ORB_TRY(orb_surface_fill(s, made == ORB_MADE_FILL ? ORB_FILL_FAIR : ORB_FILL_FLAT, &loops));
  for (int32_t t = old; t < s->mesh->triangle_count; t++) {
    s->mesh->source_triangle[t] = made;
  }
  orb_mesh_note(s->mesh, "fill_holes", loops);
  return orb_surface_pieces(s);
}

static orb_status check_one_sphere(orb_surface *s, const orb_repair_options *options) {
  unsigned repair = options->repair;
  orb_fans fans;
  ORB_TRY(orb_surface_fans(s, 0, &fans));
  int is_joined = s->piece_count > 1 && s->piece_count - fans.joins == 1; /* bodies, at vertices only */
  if (fans.pinched > 0 && (!is_safe(repair) || (is_joined && !(repair & ORB_REPAIR_SPLIT)))) {
    return orb_refuse_pinched(s, &fans);
  }
  if (fans.pinched > 0) {
    ORB_TRY(orb_surface_fans(s, 1, &fans));
    orb_mesh_note(s->mesh, "split-vertices", fans.pinched);
  }
  if (s->piece_count > 1) {
    return orb_refuse_pieces(s);
  }
  int64_t euler = fans.fans - s->edges.edges + s->mesh->triangle_count;
  if (euler != 2) {
    int64_t genus = 1 - euler / 2;
    double limit = repair & ORB_REPAIR_CLOSE_HANDLES ? options->handle_size : 0;
    if (limit > 0) {
      ORB_TRY(orb_surface_close_handles(s, limit, &genus));
    }
    return genus > 0 ? orb_refuse_handles(s, genus, limit) : ORB_OK;
  }
  return ORB_OK;
}

/* Splits crowded edges. The holes that this opens in a closed surface are filled: *repair then allows that. */
static orb_status split_crowded(orb_surface *s, unsigned *repair, int32_t *made) {
  int was_closed = s->edges.open == 0;
  int64_t count;
  ORB_TRY(orb_surface_split(s, &count));
  orb_mesh_note(s->mesh, "split_nonmanifold", count);
  *repair |= was_closed ? ORB_REPAIR_FILL_HOLES : 0;
  *made = was_closed ? ORB_MADE_COVER : ORB_MADE_FILL;
  return ORB_OK;
}

static orb_status repair_surface(orb_surface *s, const orb_repair_options *options, unsigned char **reversed,
                                 int32_t *old) {
  unsigned repair = options->repair;
  orb_mesh *mesh = s->mesh;
  int64_t unused = 0;
  int32_t made = ORB_MADE_FILL;
  int opened_by_dropping = 0;
  if (is_safe(repair)) {
    ORB_TRY(drop_degenerate(s));
    opened_by_dropping = s->edges.open == 0;
    ORB_TRY(drop_duplicates(s));
    opened_by_dropping &= mesh->triangle_count < 4;
    if (mesh->triangle_count > 0 && !opened_by_dropping && s->edges.open > 0) {
      ORB_TRY(orb_mesh_weld(s->ctx, mesh, s->twin, &s->edges));
      ORB_TRY(drop_duplicates(s));
    }
  }
  if (mesh->triangle_count == 0 || opened_by_dropping) {
    return orb_refuse_few(s);
  }
  if (repair & ORB_REPAIR_SPLIT && s->edges.crowded > 0) {
    ORB_TRY(split_crowded(s, &repair, &made));
  }
  if (repair & (ORB_REPAIR_LARGEST_COMPONENT | ORB_REPAIR_PART)) {
    ORB_TRY(keep_piece(s, options));
  }
  if (s->edges.crowded > 0) {
    return orb_refuse_crowded(s, repair & ORB_REPAIR_SPLIT);
  }
  ORB_TRY(make_consistent(s, repair, reversed));
  *old = mesh->triangle_count;
  ORB_TRY(close_surface(s, repair, made));
  ORB_TRY(check_one_sphere(s, options));
  if (mesh->triangle_count < 4) {
    return orb_refuse_few(s);
  }
  ORB_TRY(orb_mesh_compact(s->ctx, mesh, &unused));
  orb_mesh_note(mesh, "unused-vertices", unused);
  return ORB_OK;
}

orb_status orb_mesh_repair(orb_context *ctx, orb_mesh *mesh, unsigned repair) {
  return orb_mesh_repair_with(ctx, mesh, &(orb_repair_options){.repair = repair});
}

orb_status orb_mesh_repair_with(orb_context *ctx, orb_mesh *mesh, const orb_repair_options *options) {
  orb_repair_options own = *options;
  own.handle_size = own.handle_size > 0 ? own.handle_size : ORB_HANDLE_SIZE;
  orb_surface surface = {0};
  unsigned char *reversed = NULL;
  int32_t old = 0;
  orb_status status = orb_context_check(ctx);
  if (status == ORB_OK) {
    status = orb_surface_open(ctx, mesh, &surface);
  }
  if (status == ORB_OK) {
    status = repair_surface(&surface, &own, &reversed, &old);
  }
  if (status == ORB_OK) {
    status = orb_refuse_size(ctx, mesh);
  }
  if (status == ORB_OK) {
    face_outward(mesh, reversed, old);
  }
  orb_free(ctx, reversed);
  surface.ctx = ctx;
  orb_surface_close(&surface);
  return status;
}
