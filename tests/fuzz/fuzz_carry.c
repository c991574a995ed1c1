/* Feeds bytes as a glTF document from which sets, skin and targets are carried over; and, as a GLB, as an asset that
 * receives a set, a variant or its own skin. The written document must be read again as the same surface. A PNG or JPEG
 * is decoded. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "cost.h"
#include "format/gltf_add.h"
#include "format/gltf_given.h"
#include "format/image.h"
#include "orbmorph/format.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void *must(void *block) {
  if (!block) {
    abort();
  }
  return block;
}

static void add(orb_context *ctx, const uint8_t *bytes, size_t size, const orb_mesh *mesh, const orb_given_skin *skin) {
  size_t count = (size_t)mesh->vertex_count;
  int32_t *on = must(calloc(count + 1, sizeof *on));
  float *values = must(calloc(4 * count + 1, sizeof *values));
  uint16_t *joints = must(calloc(4 * count + 1, sizeof *joints));
  orb_added_set sets[] = {{.width = 4, .values = values}, {.width = 2, .values = values}};
  const orb_added_image image = {.material = -1, .png = bytes, .size = 8};
  orb_added_variant variants[] = {{.name = "one", .image_count = 1, .images = &image}};
  orb_additions more = {.vertex_count = mesh->vertex_count,
                        .on_surface = on,
                        .set_count = 2,
                        .sets = sets,
                        .variant_count = 1,
                        .variants = variants,
                        .own_name = "own"};
  for (size_t i = 0; i < 4 * count; i += 4) {
    values[i] = 1;
  }
  if (skin->skin >= 0) {
    more.skin = (orb_added_skin){.bytes = bytes,
                                 .size = size,
                                 .skin = skin->skin,
                                 .joint_count = skin->joint_count,
                                 .joints = joints,
                                 .weights = values};
    more.skin.surface = (orb_skin_surface){.count = mesh->vertex_count,
                                           .before = mesh->positions,
                                           .after = mesh->positions,
                                           .area = mesh->positions, /* any numbers */
                                           .joints = (const uint16_t(*)[4])joints,
                                           .weights = (const float(*)[4])values};
    memcpy(more.skin.place, skin->place, sizeof more.skin.place);
    for (int k = 0; k < 4; k++) {
      more.skin.moved[5 * k] = 1;
    }
  }
  orb_buffer out = {0};
  orb_mesh again;
  if (orb_gltf_add(ctx, bytes, size, &more, &out) == ORB_OK) {
    if (orb_mesh_read(ctx, out.data, out.size, ORB_FORMAT_GLB, &again, NULL) != ORB_OK ||
        again.vertex_count != mesh->vertex_count || again.triangle_count != mesh->triangle_count) {
      abort();
    }
    orb_mesh_free(ctx, &again);
  }
  orb_buffer_free(ctx, &out);
  free(on);
  free(values);
  free(joints);
}

static void take(orb_context *ctx, const uint8_t *bytes, size_t size, const orb_mesh *mesh) {
  unsigned char *used = must(calloc((size_t)mesh->vertex_count + 1, 1));
  memset(used, 1, (size_t)mesh->vertex_count);
  const orb_given_file file = {bytes, size, mesh->vertex_count, used};
  static const char *const prefixes[] = {"COLOR_", "TEXCOORD_"};
  orb_given_sets sets;
  orb_given_skin skin;
  orb_given_targets targets;
  orb_given_charts charts;
  for (int i = 0; i < 2; i++) {
    (void)!orb_given_sets_read(ctx, &file, prefixes[i], &sets);
    orb_given_sets_free(ctx, &sets);
  }
  (void)!orb_given_targets_read(ctx, &file, &targets);
  orb_given_targets_free(ctx, &targets);
  (void)!orb_given_charts_read(ctx, bytes, size, &charts);
  orb_given_charts_free(ctx, &charts);
  if (orb_given_skin_read(ctx, &file, &skin) == ORB_OK && memcmp(bytes, "glTF", 4) == 0) {
    add(ctx, bytes, size, mesh, &skin);
  }
  orb_given_skin_free(ctx, &skin);
  free(used);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  orb_context_options options = {.threads = 1, .memory_limit = 256u << 20};
  orb_context *ctx;
  orb_mesh mesh;
  orb_pixels pixels;
  if (size < 4 || orb_context_create(&options, &ctx) != ORB_OK) {
    return 0;
  }
  const double began = fuzz_begin();
  orb_format format = memcmp(data, "glTF", 4) == 0 ? ORB_FORMAT_GLB : ORB_FORMAT_GLTF;
  if (data[0] == 0x89 || data[0] == 0xff) {
    if (orb_image_decode(ctx, data, size, &pixels) == ORB_OK) {
      orb_free(ctx, pixels.rgba);
    }
  } else if (orb_mesh_read(ctx, data, size, format, &mesh, NULL) == ORB_OK) {
    take(ctx, data, size, &mesh);
    orb_mesh_free(ctx, &mesh);
    fuzz_check_document(ctx, began, size, "carrying");
  }
  if (orb_memory_used(ctx) > 0) {
    abort();
  }
  orb_context_destroy(ctx);
  return 0;
}
