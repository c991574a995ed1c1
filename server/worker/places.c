#include "worker/places.h"

#include <string.h>

enum { VERSION = 1, BATCH = 1024, ENTRY_BYTES = 28 };

static unsigned char *put32(unsigned char *at, uint32_t value) {
  for (int i = 0; i < 4; i++) {
    *at++ = (unsigned char)(value >> (8 * i));
  }
  return at;
}

static unsigned char *put_double(unsigned char *at, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  at = put32(at, (uint32_t)bits);
  return put32(at, (uint32_t)(bits >> 32));
}

static orb_status write_shape(orb_context *ctx, const orb_mesh *mesh, const int32_t *corners,
                              const orb_merge_result *merged, int32_t s, orb_buffer *out) {
  const orb_supermesh *supermesh = &merged->supermesh;
  const orb_place *places = supermesh->places + (size_t)s * (size_t)supermesh->vertex_count;
  unsigned char bytes[BATCH * ENTRY_BYTES], *at = bytes;
  for (int32_t v = 0; v < supermesh->vertex_count; v++) {
    orb_place repaired, file;
    orb_place_before(mesh, &merged->alignment.shapes[s], &places[v], &repaired);
    orb_place_in_file(mesh, corners, &repaired, &file);
    at = put32(at, (uint32_t)file.triangle);
    for (int k = 0; k < 3; k++) {
      at = put_double(at, file.at[k]);
    }
    if (at == bytes + sizeof bytes || v + 1 == supermesh->vertex_count) {
      orb_status status = orb_context_check(ctx);
      status = status == ORB_OK ? orb_buffer_append(ctx, out, bytes, (size_t)(at - bytes)) : status;
      if (status != ORB_OK) {
        return status;
      }
      at = bytes;
    }
  }
  return ORB_OK;
}

/* Writes which supermesh vertex each vertex of the asset represents. */
static orb_status write_asset_map(orb_context *ctx, const orb_merge_result *merged, orb_buffer *out) {
  unsigned char bytes[4 * BATCH], *at = bytes + 12;
  int32_t count = merged->asset_facts.vertex_count;
  memcpy(bytes, "GLBVERTS", 8);
  put32(bytes + 8, (uint32_t)count);
  for (int32_t v = 0; v < count; v++) {
    if (at == bytes + sizeof bytes) {
      orb_status status = orb_buffer_append(ctx, out, bytes, sizeof bytes);
      if (status != ORB_OK) {
        return status;
      }
      at = bytes;
    }
    at = put32(at, (uint32_t)merged->asset_vertices[v]);
  }
  return orb_buffer_append(ctx, out, bytes, (size_t)(at - bytes));
}

orb_status places_write(orb_context *ctx, const orb_mesh *meshes, int32_t *const *corners,
                        const orb_merge_result *merged, orb_buffer *out) {
  unsigned char head[20], *at = head + 8;
  memcpy(head, "ORBPLACE", 8);
  at = put32(at, VERSION);
  at = put32(at, (uint32_t)merged->supermesh.shape_count);
  put32(at, (uint32_t)merged->supermesh.vertex_count);
  orb_status status = orb_buffer_append(ctx, out, head, sizeof head);
  for (int32_t s = 0; s < merged->supermesh.shape_count && status == ORB_OK; s++) {
    status = write_shape(ctx, &meshes[s], corners[s], merged, s, out);
  }
  return status == ORB_OK ? write_asset_map(ctx, merged, out) : status;
}
