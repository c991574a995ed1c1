#include "transfer/keep.h"

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "format/gltf_keep.h"
#include "mesh/normals.h"
#include "transfer/materials.h"
#include "transfer/names.h"
#include "transfer/pack.h"
#include "transfer/template.h"

/* What the targets are made from; memory of the context. */
typedef struct keeper {
  int32_t *on_surface, *key_frames;
  double *key_times, **normals;
  orb_target_name *texts;
  const char **names;
} keeper;

static void free_keeper(orb_context *ctx, const orb_draft *draft, keeper *k) {
  for (int32_t f = 0; k->normals && f < draft->frame_count; f++) {
    orb_free(ctx, k->normals[f]);
  }
  orb_free(ctx, k->normals);
  orb_free(ctx, k->on_surface);
  orb_free(ctx, k->key_frames);
  orb_free(ctx, k->key_times);
  orb_free(ctx, k->texts);
  orb_free(ctx, k->names);
}

/* The smooth normals of each frame, which tell how those of the document rotate. */
static orb_status make_normals(orb_context *ctx, const orb_draft *draft, keeper *k) {
  const orb_supermesh *mesh = draft->supermesh;
  k->normals = ORB_NEW0(ctx, double *, draft->frame_count);
  orb_status status = k->normals ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t f = 0; status == ORB_OK && f < draft->frame_count; f++) {
    k->normals[f] = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
    status = k->normals[f] ? orb_smooth_normals(ctx, draft->positions[f], mesh->vertex_count, mesh->triangles,
                                                mesh->triangle_count, k->normals[f])
                           : ORB_E_NO_MEMORY;
  }
  return status;
}

static orb_status describe(orb_context *ctx, const orb_draft *draft, const orb_document *document,
                           const char *const *names, keeper *k, orb_gltf_shapes *out) {
  int32_t count = document->mesh->file_vertex_count;
  int32_t keys = draft->options->animation == ORB_ANIMATION_PINGPONG ? orb_draft_keys(draft, NULL, NULL) : 0;
  k->on_surface = ORB_NEW(ctx, int32_t, count);
  k->key_frames = ORB_NEW(ctx, int32_t, keys);
  k->key_times = ORB_NEW(ctx, double, keys);
  k->texts = ORB_NEW0(ctx, orb_target_name, draft->frame_count);
  k->names = ORB_NEW(ctx, const char *, draft->frame_count);
  if (!k->on_surface || !k->key_frames || !k->key_times || !k->texts || !k->names) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < count; v++) {
    k->on_surface[v] = orb_template_vertex(draft, document->mesh, v);
  }
  if (keys > 0) {
    orb_draft_keys(draft, k->key_frames, k->key_times);
  }
  ORB_TRY(orb_draft_names(ctx, draft, names, k->texts, k->names));
  if (draft->options->normals) {
    ORB_TRY(make_normals(ctx, draft, k));
  }
  *out = (orb_gltf_shapes){.target_count = draft->frame_count - 1,
                           .file_vertex_count = count,
                           .names = k->names + 1,
                           .on_surface = k->on_surface,
                           .positions = (const double *const *)draft->positions,
                           .normals = (const double *const *)k->normals,
                           .key_count = keys,
                           .key_frames = k->key_frames,
                           .key_times = k->key_times,
                           .parts = document->parts};
  return ORB_OK;
}

/* An error is about the first shape: the document is that shape's. */
static orb_status blame_first(orb_context *ctx, orb_status status) {
  if (status == ORB_E_BAD_OPTION || status == ORB_E_MALFORMED_MESH) {
    orb_context_error_edit(ctx)->shape = 0;
  }
  return status;
}

orb_status orb_document_try(orb_context *ctx, const orb_mesh *repaired, const orb_document *document) {
  const orb_mesh *file = document->mesh;
  int32_t *on_surface = ORB_NEW(ctx, int32_t, file->file_vertex_count);
  orb_gltf_shapes none = {
      .file_vertex_count = file->file_vertex_count, .on_surface = on_surface, .parts = document->parts};
  orb_gltf_kept kept = {0};
  orb_buffer out = {0};
  if (!on_surface) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < file->file_vertex_count; v++) {
    on_surface[v] = orb_repaired_vertex(repaired, file, v);
  }
  orb_status status = blame_first(ctx, orb_gltf_keep(ctx, document->bytes, document->size, &none, &kept, &out));
  orb_buffer_free(ctx, &out);
  orb_free(ctx, kept.dropped);
  orb_free(ctx, on_surface);
  return status;
}

orb_status orb_draft_keep(orb_context *ctx, const orb_draft *draft, const orb_document *document,
                          const char *const *names, orb_asset_facts *facts, orb_buffer *out, int32_t **vertices,
                          orb_dropped **list, int32_t *count) {
  keeper k = {0};
  orb_gltf_shapes shapes;
  orb_gltf_kept kept = {0};
  orb_status status = describe(ctx, draft, document, names, &k, &shapes);
  if (status == ORB_OK) {
    status = blame_first(ctx, orb_gltf_keep(ctx, document->bytes, document->size, &shapes, &kept, out));
    *list = kept.dropped;
    *count = kept.dropped_count;
  }
  if (status == ORB_OK) {
    *facts = (orb_asset_facts){.vertex_count = kept.vertex_count,
                               .triangle_count = document->mesh->triangle_count,
                               .primitive_count = kept.primitive_count,
                               .target_count = shapes.target_count,
                               .morphed_attributes = kept.attributes * shapes.target_count};
    status = orb_dropped_later(ctx, draft->shapes, draft->shape_count, list, count);
  }
  if (status == ORB_OK && vertices) { /* their numbers come first, so the list may be longer than the caller knows */
    *vertices = k.on_surface;
    k.on_surface = NULL;
  }
  free_keeper(ctx, draft, &k);
  return status;
}
