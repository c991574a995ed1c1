#include "carry/source.h"

#include "base/check.h"
#include "base/memory.h"
#include "transfer/texcoord.h"

orb_status orb_carry_source_open(orb_context *ctx, orb_carry_source *source) {
  const orb_mesh *given = source->given;
  if (!source->file->bytes) {
    return ORB_OK;
  }
  source->used = ORB_NEW0(ctx, unsigned char, given->file_vertex_count);
  if (!source->used) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < given->file_vertex_count; v++) {
    source->used[v] = (unsigned char)(given->vertex_of_source[v] >= 0);
  }
  return orb_corner_blends_create(ctx, given, source->shape, source->file->corners, &source->blends);
}

orb_status orb_carry_source_home(orb_context *ctx, orb_carry_source *source) {
  if (source->home) {
    return ORB_OK;
  }
  source->home = ORB_NEW(ctx, int32_t, source->supermesh->triangle_count);
  return source->home ? orb_home_triangles(ctx, source->supermesh, source->shape, source->number, source->home)
                      : ORB_E_NO_MEMORY;
}

void orb_carry_source_close(orb_context *ctx, orb_carry_source *source) {
  orb_free(ctx, source->home);
  orb_free(ctx, source->used);
  orb_free(ctx, source->blends);
}

orb_given_file orb_carry_given(const orb_carry_source *source) {
  return (orb_given_file){source->file->bytes, source->file->size, source->given->file_vertex_count, source->used};
}

void orb_carry_blend(const orb_carry_source *source, int32_t vertex, orb_blend *out) {
  const orb_supermesh *supermesh = source->supermesh;
  const orb_place *place = &supermesh->places[(int64_t)source->number * supermesh->vertex_count + vertex];
  out->count = 0;
  for (int k = 0; k < 3; k++) {
    const orb_corner_blend *blend = &source->blends[3 * (int64_t)place->triangle + k];
    for (int i = 0; i < 3; i++) {
      double weight = place->at[k] * blend->weight[i];
      if (weight > 0) {
        out->vertex[out->count] = blend->vertex[i];
        out->weight[out->count++] = weight;
      }
    }
  }
}
