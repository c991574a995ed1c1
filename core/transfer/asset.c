/* orb_asset_write(): the steps listed in draft.h, in their order. */
#include "orbmorph/asset.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "mesh/holes.h"
#include "transfer/distinct.h"
#include "transfer/fit.h"
#include "transfer/holes.h"
#include "transfer/keep.h"
#include "transfer/pack.h"
#include "transfer/path.h"
#include "transfer/split.h"
#include "transfer/tangent.h"
#include "transfer/targets.h"
#include "transfer/template.h"
#include "transfer/texcoord.h"

void orb_asset_defaults(orb_asset_options *options) {
  *options = (orb_asset_options){.normals = 1, .fit = ORB_FIT_AUTO, .path_steps = 3};
}

static orb_status check_options(orb_context *ctx, const orb_supermesh *supermesh, const orb_asset_options *options) {
  if (supermesh->shape_count < 2) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "An asset needs two shapes or more.");
  }
  if (options->path == ORB_PATH_RIGID && (options->path_steps < 1 || options->path_steps > 64)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "path_steps is %d; it must be 1 to 64.", (int)options->path_steps);
  }
  return ORB_OK;
}

static void draft_free(orb_context *ctx, orb_draft *draft) {
  for (int32_t f = 0; f < draft->frame_count; f++) {
    if (draft->positions) {
      orb_free(ctx, draft->positions[f]);
    }
    if (draft->deltas && f > 0) {
      orb_free(ctx, draft->deltas[f - 1]);
    }
    if (draft->normals) {
      orb_wedges_free(ctx, &draft->normals[f]);
    }
    if (draft->colors) {
      orb_wedges_free(ctx, &draft->colors[f]);
    }
    if (draft->tangents) {
      draft->tangents[f].of_corner = f ? NULL : draft->tangents[f].of_corner; /* that of the first frame */
      orb_wedges_free(ctx, &draft->tangents[f]);
    }
  }
  for (int32_t p = 0; p < draft->part_count; p++) {
    orb_free(ctx, draft->parts[p].indices);
    if (p == 0 || !draft->shares_vertices) {
      orb_free(ctx, draft->parts[p].corners);
    }
  }
  orb_wedges_free(ctx, &draft->texcoords);
  orb_free(ctx, draft->positions);
  orb_free(ctx, draft->base);
  orb_free(ctx, draft->deltas);
  orb_free(ctx, draft->normals);
  orb_free(ctx, draft->colors);
  orb_free(ctx, draft->tangents);
  orb_free(ctx, draft->home);
  orb_free(ctx, draft->parts);
}

/* Adds in-betweens and targets to the shapes. */
static void count_frames(orb_draft *draft) {
  const orb_asset_options *options = draft->options;
  draft->between_count = options->path == ORB_PATH_RIGID ? options->path_steps * (draft->shape_count - 1) : 0;
  draft->frame_count = draft->shape_count + draft->between_count + options->target_count;
}

static orb_status allocate_frames(orb_context *ctx, orb_draft *draft) {
  size_t frames = (size_t)draft->frame_count, size = 3 * (size_t)draft->supermesh->vertex_count;
  draft->positions = ORB_NEW0(ctx, double *, frames);
  draft->deltas = ORB_NEW0(ctx, float *, frames);
  draft->base = ORB_NEW(ctx, float, size);
  draft->colors = ORB_NEW0(ctx, orb_wedges, frames);
  draft->normals = draft->options->normals ? ORB_NEW0(ctx, orb_wedges, frames) : NULL;
  if (!draft->positions || !draft->deltas || !draft->base || !draft->colors ||
      (draft->options->normals && !draft->normals)) {
    return ORB_E_NO_MEMORY;
  }
  for (size_t f = 0; f < frames; f++) {
    draft->positions[f] = ORB_NEW(ctx, double, size);
    if (!draft->positions[f] || (f > 0 && !(draft->deltas[f - 1] = ORB_NEW(ctx, float, size)))) {
      return ORB_E_NO_MEMORY;
    }
  }
  return ORB_OK;
}

/* Positions and normals of the shapes; the later ones are moved onto the first. */
static orb_status make_shapes(orb_context *ctx, orb_draft *draft) {
  const orb_supermesh *supermesh = draft->supermesh;
  for (int32_t s = 0; s < draft->shape_count; s++) {
    const orb_place *places = supermesh->places + (int64_t)s * supermesh->vertex_count;
    ORB_TRY(orb_transfer_positions(ctx, &draft->shapes[s], places, supermesh->vertex_count, draft->positions[s]));
    if (draft->normals) {
      ORB_TRY(orb_wedge_normals(ctx, supermesh, &draft->shapes[s], s, &draft->normals[s]));
    }
    if (s > 0 && draft->options->fit != ORB_FIT_NONE) {
      orb_motion motion;
      ORB_TRY(orb_fit_motion(ctx, supermesh, draft->positions[0], draft->positions[s], draft->options->fit, &motion));
      if (motion.kind != ORB_FIT_NONE) {
        orb_motion_apply(&motion, draft->positions[s], supermesh->vertex_count);
      }
      if (draft->normals && motion.kind != ORB_FIT_NONE) {
        orb_motion_rotate(&motion, draft->normals[s].values, draft->normals[s].value_count);
      }
    }
    orb_progress(ctx, "write", 0.3 * (s + 1) / draft->shape_count);
  }
  return ORB_OK;
}

static orb_status white_colors(orb_context *ctx, const orb_supermesh *supermesh, orb_wedges *out) {
  out->width = 4;
  out->value_count = supermesh->vertex_count;
  out->values = ORB_NEW(ctx, float, 4 * (int64_t)supermesh->vertex_count);
  if (!out->values) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t i = 0; i < 4 * (int64_t)supermesh->vertex_count; i++) {
    out->values[i] = 1;
  }
  return ORB_OK;
}

static void clamp_colors(orb_wedges *colors) {
  for (int64_t i = 0; i < (int64_t)colors->width * colors->value_count; i++) {
    float value = colors->values[i];
    colors->values[i] = value >= 0 && value <= 1 ? value : value > 1 ? 1 : 0;
  }
}

/* Colours of the first shape if it has any; of all shapes if the options ask for that and a later one has any. White
 * stands for none. */
static orb_status make_colors(orb_context *ctx, orb_draft *draft) {
  int any = draft->shapes[0].mesh.colors != NULL;
  draft->color_count = any;
  for (int32_t s = 1; draft->options->colors && s < draft->shape_count; s++) {
    if (draft->shapes[s].mesh.colors) {
      draft->color_count = draft->frame_count;
    }
  }
  for (int32_t s = 0; s < draft->color_count && s < draft->shape_count; s++) {
    if (draft->shapes[s].mesh.colors) {
      ORB_TRY(orb_wedge_colors(ctx, draft->supermesh, &draft->shapes[s], s, &draft->colors[s]));
    } else {
      ORB_TRY(white_colors(ctx, draft->supermesh, &draft->colors[s]));
    }
    clamp_colors(&draft->colors[s]);
  }
  return ORB_OK;
}

/* Texture coordinates, and the triangles that decide materials and holes, if the first shape has any of these. */
static orb_status make_textures(orb_context *ctx, orb_draft *draft) {
  const orb_mesh *mesh = &draft->shapes[0].mesh;
  draft->has_holes = draft->options->holes == ORB_HOLES_REOPEN && draft->supermesh->has_rims && orb_has_holes(mesh);
  if (!mesh->texcoords && !(mesh->material && mesh->material_count > 1) && !draft->has_holes) {
    return ORB_OK;
  }
  draft->home = ORB_NEW(ctx, int32_t, draft->supermesh->triangle_count);
  if (!draft->home) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_home_triangles(ctx, draft->supermesh, &draft->shapes[0], 0, draft->home));
  if (draft->has_holes) {
    ORB_TRY(orb_holes_settle(ctx, draft->supermesh, mesh, draft->home));
  }
  return mesh->texcoords ? orb_wedge_texcoords(ctx, draft->supermesh, &draft->shapes[0], draft->home, &draft->texcoords)
                         : ORB_OK;
}

static orb_status round_frames(orb_context *ctx, orb_draft *draft) {
  const orb_supermesh *supermesh = draft->supermesh;
  unsigned char *keep = ORB_NEW0(ctx, unsigned char, supermesh->vertex_count);
  if (!keep) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < supermesh->landmark_count; i++) {
    if (supermesh->landmark_vertices[i] >= 0) {
      keep[supermesh->landmark_vertices[i]] = 1;
    }
  }
  orb_status status = orb_round_distinct(ctx, draft->positions, draft->frame_count, draft->shape_count,
                                         supermesh->vertex_count, keep, draft->base, draft->deltas, &draft->nudged);
  orb_free(ctx, keep);
  return status;
}

/* The supermesh vertex of each vertex of the file: that of the corner whose values it has. */
static orb_status list_vertices(orb_context *ctx, const orb_draft *draft, int32_t **out) {
  int64_t count = 0;
  for (int32_t p = 0; p < draft->part_count; p++) {
    count += draft->parts[p].vertex_count;
  }
  int32_t *next = *out = ORB_NEW(ctx, int32_t, count);
  if (!next) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t p = 0; p < draft->part_count; p++) {
    for (int32_t v = 0; v < draft->parts[p].vertex_count; v++) {
      *next++ = draft->supermesh->triangles[draft->parts[p].corners[v]];
    }
  }
  return ORB_OK;
}

orb_status orb_asset_write(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shapes,
                           const char *const *names, const orb_asset_options *options, orb_asset_facts *facts,
                           orb_buffer *out) {
  return orb_asset_write_mapped(ctx, supermesh, shapes, names, options, facts, out, NULL);
}

orb_status orb_asset_write_mapped(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shapes,
                                  const char *const *names, const orb_asset_options *options, orb_asset_facts *facts,
                                  orb_buffer *out, int32_t **vertices) {
  ORB_TRY(check_options(ctx, supermesh, options));
  orb_asset_facts unused;
  orb_draft draft = {.supermesh = supermesh,
                     .shapes = shapes,
                     .options = options,
                     .shape_count = supermesh->shape_count,
                     .frame_count = supermesh->shape_count};
  orb_status status;
  count_frames(&draft);
  orb_progress(ctx, "write", 0);
  ORB_GO(status, allocate_frames(ctx, &draft), done);
  ORB_GO(status, make_shapes(ctx, &draft), done);
  ORB_GO(status, make_colors(ctx, &draft), done);
  ORB_GO(status, make_textures(ctx, &draft), done);
  ORB_GO(status, orb_draft_path(ctx, &draft), done);
  ORB_GO(status, orb_draft_targets(ctx, &draft), done);
  ORB_GO(status, orb_draft_tangents(ctx, &draft), done);
  ORB_GO(status, round_frames(ctx, &draft), done);
  ORB_GO(status, orb_draft_split(ctx, &draft), done);
  ORB_GO(status, orb_draft_write(ctx, &draft, names, facts ? facts : &unused, out), done);
  if (vertices) {
    ORB_GO(status, list_vertices(ctx, &draft, vertices), done);
  }
  orb_progress(ctx, "write", 1);
done:
  draft_free(ctx, &draft);
  return status;
}

/* The supermesh vertex of each vertex of the asset; −1: it lies on no closed surface. */
static orb_status list_template_vertices(orb_context *ctx, const orb_draft *draft, const orb_template *made,
                                         int32_t **out) {
  int64_t count = 0, corners = 3 * (int64_t)made->mesh.triangle_count;
  for (int32_t p = 0; p < draft->part_count; p++) {
    count += draft->parts[p].vertex_count;
  }
  int32_t *next = *out = ORB_NEW(ctx, int32_t, count);
  for (int32_t p = 0; next && p < draft->part_count; p++) {
    for (int32_t v = 0; v < draft->parts[p].vertex_count; v++) {
      *next++ = made->on_supermesh[draft->parts[p].corners[v] - corners];
    }
  }
  return *out ? ORB_OK : ORB_E_NO_MEMORY;
}

/* The frames of a template: positions only, as the attributes are the file's and not the supermesh's. *bare: the
 * options for that, which the draft refers to until the caller sets its own. */
static orb_status make_bare_frames(orb_context *ctx, orb_draft *draft, orb_asset_options *bare) {
  const orb_asset_options *options = draft->options;
  ORB_TRY(check_options(ctx, draft->supermesh, options));
  *bare = *options;
  bare->normals = bare->colors = 0;
  draft->options = bare;
  count_frames(draft);
  orb_progress(ctx, "write", 0);
  ORB_TRY(allocate_frames(ctx, draft));
  ORB_TRY(make_shapes(ctx, draft));
  ORB_TRY(orb_draft_path(ctx, draft));
  ORB_TRY(orb_draft_targets(ctx, draft));
  draft->options = options;
  return ORB_OK;
}

orb_status orb_asset_write_template(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shapes,
                                    const orb_mesh *file, const char *const *names, const orb_asset_options *options,
                                    orb_asset_facts *facts, orb_buffer *out, int32_t **vertices) {
  orb_asset_facts unused;
  orb_asset_options bare;
  orb_draft draft = {.supermesh = supermesh,
                     .shapes = shapes,
                     .options = options,
                     .shape_count = supermesh->shape_count,
                     .frame_count = supermesh->shape_count};
  orb_draft copy = {0};
  orb_template made = {0};
  orb_status status;
  ORB_GO(status, make_bare_frames(ctx, &draft, &bare), done);
  ORB_GO(status, orb_template_draft(ctx, &draft, file, &made, &copy), done);
  ORB_GO(status, orb_draft_write(ctx, &copy, names, facts ? facts : &unused, out), done);
  if (vertices) {
    ORB_GO(status, list_template_vertices(ctx, &copy, &made, vertices), done);
  }
  orb_progress(ctx, "write", 1);
done:
  draft_free(ctx, &copy);
  draft_free(ctx, &draft);
  orb_template_free(ctx, &made);
  return status;
}

orb_status orb_asset_write_document(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shapes,
                                    const orb_document *document, const char *const *names,
                                    const orb_asset_options *options, orb_asset_facts *facts, orb_buffer *out,
                                    int32_t **vertices, orb_dropped **list, int32_t *count) {
  orb_asset_facts unused;
  orb_asset_options bare;
  orb_draft draft = {.supermesh = supermesh,
                     .shapes = shapes,
                     .options = options,
                     .shape_count = supermesh->shape_count,
                     .frame_count = supermesh->shape_count};
  orb_status status;
  *list = NULL;
  *count = 0;
  ORB_GO(status, make_bare_frames(ctx, &draft, &bare), done);
  ORB_GO(status, orb_draft_keep(ctx, &draft, document, names, facts ? facts : &unused, out, vertices, list, count),
         done);
  orb_progress(ctx, "write", 1);
done:
  draft_free(ctx, &draft);
  return status;
}

/* Column-major, as in glTF. */
static void motion_matrix(const orb_motion *motion, double out[16]) {
  for (int c = 0; c < 3; c++) {
    for (int r = 0; r < 3; r++) {
      out[4 * c + r] = motion->scale * motion->rotation[r][c];
    }
    out[4 * c + 3] = 0;
    out[12 + c] = motion->shift[c];
  }
  out[15] = 1;
}

static orb_fit_report report_of(const orb_motion *motion, double diagonal) {
  return (orb_fit_report){.kind = motion->kind,
                          .scale = motion->scale,
                          .rotation_degrees = orb_motion_degrees(motion),
                          .translation_relative = motion->moves > 0 ? motion->moves / diagonal : 0,
                          .up_degrees = acos(fmax(-1, fmin(1, motion->rotation[1][1]))) * 180 / M_PI};
}

orb_status orb_asset_transforms(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shapes,
                                orb_fit fit, double *out, orb_fit_report *reports) {
  int32_t vertices = supermesh->vertex_count;
  double *fixed = ORB_NEW(ctx, double, 3 * (int64_t)vertices), *moved = ORB_NEW(ctx, double, 3 * (int64_t)vertices);
  orb_status status = fixed && moved ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t s = 0; status == ORB_OK && s < supermesh->shape_count; s++) {
    orb_motion motion = {.rotation = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .scale = 1};
    if (fit != ORB_FIT_NONE) {
      const orb_place *places = supermesh->places + (int64_t)s * vertices;
      ORB_GO(status, orb_transfer_positions(ctx, &shapes[s], places, vertices, s ? moved : fixed), end);
      if (s > 0) {
        ORB_GO(status, orb_fit_motion(ctx, supermesh, fixed, moved, fit, &motion), end);
      }
    }
    motion_matrix(&motion, out + 16 * (int64_t)s);
    if (reports) {
      double diagonal = fit != ORB_FIT_NONE ? orb_fit_diagonal(fixed, vertices) : 0;
      reports[s] = report_of(&motion, diagonal);
    }
  }
end:
  orb_free(ctx, fixed);
  orb_free(ctx, moved);
  return status;
}
