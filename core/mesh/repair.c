/* Repair and diagnosis.
 *
 * The order in which a mesh is found wanting is that of what its owner must mend first: edges of three faces (nothing
 * else can be told of such a surface), a facing that cannot be made consistent, holes, vertices where fans touch,
 * pieces, handles, too few faces. Under `safe` each of the mends comes just before the diagnosis that it may spare.
 *
 * A vertex where fans touch is split unless that would take the mesh apart: two bodies that hang together at one
 * vertex are refused as not manifold there, with the sizes of both, and not called two pieces.
 */
#include <string.h>

#include "base/check.h"
#include "mesh/edit.h"
#include "mesh/refuse.h"
#include "mesh/weld.h"

static int is_safe(unsigned repair) {
  return repair != ORB_REPAIR_NONE;
}

/* All three neighbours of some face are one face: the two lie over the same vertices. */
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
  ORB_TRY(orb_mesh_flag_duplicates(s->ctx, s->mesh, NULL, NULL, s->turned, NULL, &count));
  if (count == 0) {
    return ORB_OK;
  }
  orb_mesh_note(s->mesh, "duplicate-faces", orb_mesh_drop_faces(s->mesh, s->turned));
  return orb_surface_rematch(s);
}

static orb_status drop_degenerate(orb_surface *s) {
  if (orb_mesh_flag_degenerate(s->mesh, s->turned) == 0) {
    return ORB_OK;
  }
  orb_mesh_note(s->mesh, "degenerate-faces", orb_mesh_drop_faces(s->mesh, s->turned));
  return orb_surface_rematch(s);
}

/* Pieces over all edges, crowded ones too: a union over the faces of each vertex pair is not needed, because the
 * largest piece is kept before anything is known of crowded edges; faces around one are one piece. */
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
      int32_t a = s->piece[g / 3], b = s->piece[h / 3];
      while (root[a] != a) {
        a = root[a] = root[root[a]];
      }
      while (root[b] != b) {
        b = root[b] = root[root[b]];
      }
      root[a < b ? b : a] = a < b ? a : b;
    }
  }
  orb_free(s->ctx, entry);
  orb_free(s->ctx, start);
  return status;
}

static orb_status keep_largest(orb_surface *s) {
  ORB_TRY(orb_surface_pieces(s));
  if (s->piece_count < 2) {
    return ORB_OK;
  }
  int32_t *root = ORB_NEW(s->ctx, int32_t, s->piece_count);
  int32_t *size = ORB_NEW0(s->ctx, int32_t, s->piece_count);
  orb_status status = root && size ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < s->piece_count && status == ORB_OK; i++) {
    root[i] = i;
  }
  if (status == ORB_OK && s->edges.crowded > 0) {
    status = join_crowded(s, root);
  }
  if (status == ORB_OK) {
    int32_t best = 0, dropped = 0;
    for (int32_t i = 0; i < s->piece_count; i++) {
      while (root[i] != root[root[i]]) {
        root[i] = root[root[i]];
      }
    }
    for (int32_t t = 0; t < s->mesh->triangle_count; t++) {
      size[root[s->piece[t]]]++;
    }
    for (int32_t i = 0; i < s->piece_count; i++) {
      best = size[i] > size[best] ? i : best;
      dropped += size[i] > 0;
    }
    for (int32_t t = 0; t < s->mesh->triangle_count; t++) {
      s->turned[t] = root[s->piece[t]] != best;
    }
    if (dropped > 1) {
      (void)orb_mesh_drop_faces(s->mesh, s->turned);
      orb_mesh_note(s->mesh, "largest_component", dropped - 1);
      status = orb_surface_rematch(s);
    }
  }
  orb_free(s->ctx, root);
  orb_free(s->ctx, size);
  return status;
}

static void flip_flagged(orb_mesh *mesh, const unsigned char *flag, unsigned char value) {
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    if (flag[t] == value) {
      orb_mesh_turn_face(mesh, t);
    }
  }
}

/* Makes the facing consistent. mended: something had to be turned; the flags stay for face_outward(). */
static orb_status make_consistent(orb_surface *s, unsigned repair, unsigned char **turned) {
  ORB_TRY(orb_surface_pieces(s));
  if (s->conflict >= 0 || (s->edges.same_way > 0 && !is_safe(repair))) {
    return orb_refuse_facing(s);
  }
  if (s->edges.same_way == 0) {
    return ORB_OK;
  }
  *turned = ORB_NEW(s->ctx, unsigned char, s->mesh->triangle_count);
  if (!*turned) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(*turned, s->turned, (size_t)s->mesh->triangle_count);
  flip_flagged(s->mesh, *turned, 1);
  return orb_surface_rematch(s);
}

/* Last of all: outward by the signed volume. turned: what make_consistent() turned, or NULL. old: faces it knew. */
static void face_outward(orb_mesh *mesh, const unsigned char *turned, int32_t old) {
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  int inside_out = extent.volume < 0;
  if (inside_out) {
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
      orb_mesh_turn_face(mesh, t);
    }
  }
  if (!turned) {
    orb_mesh_note(mesh, "turn-inside-out", inside_out ? mesh->triangle_count : 0);
    return;
  }
  int64_t count = 0;
  for (int32_t t = 0; t < old; t++) {
    count += turned[t] != inside_out;
  }
  orb_mesh_note(mesh, "reorient", count);
}

static orb_status close_surface(orb_surface *s, unsigned repair) {
  if (s->edges.open == 0) {
    return ORB_OK;
  }
  if (!(repair & ORB_REPAIR_FILL_HOLES)) {
    return orb_refuse_open(s);
  }
  orb_fans fans;
  ORB_TRY(orb_surface_fans(s, 1, &fans)); /* so that each boundary vertex is on one loop, once */
  orb_mesh_note(s->mesh, "split-vertices", fans.pinched);
  ORB_TRY(orb_surface_fill(s));
  return orb_surface_pieces(s);
}

static orb_status check_one_sphere(orb_surface *s, unsigned repair) {
  orb_fans fans;
  ORB_TRY(orb_surface_fans(s, 0, &fans));
  if (fans.pinched > 0 && (!is_safe(repair) || (s->piece_count > 1 && s->piece_count - fans.joins == 1))) {
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
    return orb_refuse_handles(s, 1 - euler / 2);
  }
  return ORB_OK;
}

static orb_status mend(orb_surface *s, unsigned repair, unsigned char **turned, int32_t *old) {
  orb_mesh *mesh = s->mesh;
  int64_t unused = 0;
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
  if (repair & ORB_REPAIR_LARGEST_COMPONENT) {
    ORB_TRY(keep_largest(s));
  }
  if (s->edges.crowded > 0) {
    return orb_refuse_crowded(s);
  }
  ORB_TRY(make_consistent(s, repair, turned));
  *old = mesh->triangle_count;
  ORB_TRY(close_surface(s, repair));
  ORB_TRY(check_one_sphere(s, repair));
  if (mesh->triangle_count < 4) {
    return orb_refuse_few(s);
  }
  ORB_TRY(orb_mesh_compact(s->ctx, mesh, &unused));
  orb_mesh_note(mesh, "unused-vertices", unused);
  return ORB_OK;
}

orb_status orb_mesh_repair(orb_context *ctx, orb_mesh *mesh, unsigned repair) {
  orb_surface surface = {0};
  unsigned char *turned = NULL;
  int32_t old = 0;
  orb_status status = orb_context_check(ctx);
  if (status == ORB_OK) {
    status = orb_surface_open(ctx, mesh, &surface);
  }
  if (status == ORB_OK) {
    status = mend(&surface, repair, &turned, &old);
  }
  if (status == ORB_OK) {
    status = orb_refuse_size(ctx, mesh);
  }
  if (status == ORB_OK) {
    face_outward(mesh, turned, old);
  }
  orb_free(ctx, turned);
  surface.ctx = ctx;
  orb_surface_close(&surface);
  return status;
}
