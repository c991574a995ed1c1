/* Feeds bytes as a compressed glTF document that is kept and gets a target, so that it is decompressed. The written
 * document must be read again with the same surface, colours, texture coordinates, skin and old targets, number by
 * number. The first byte chooses which vertices move. Inputs are GLB; mutations keep its lengths right, so that they
 * reach the decoders. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cost.h"
#include "format/gltf_given.h"
#include "format/gltf_keep.h"
#include "orbmorph/format.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed);
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);

/* Names the line: the compiler merges all calls of abort(). */
#define must(holds) ((holds) ? (void)0 : end(__LINE__))

static void end(int line) {
  fprintf(stderr, "fuzz_unpack.c:%d\n", line);
  abort();
}

static int same(const void *a, const void *b, size_t size) {
  return size == 0 || memcmp(a, b, size) == 0;
}

static void check_surface(const orb_mesh *before, const orb_mesh *after) {
  must(before->vertex_count == after->vertex_count && before->triangle_count == after->triangle_count);
  for (size_t i = 0; i < 3 * (size_t)before->vertex_count; i++) {
    must(before->positions[i] == after->positions[i]); /* 0 and -0 are the same */
  }
  must(same(before->triangles, after->triangles, 3 * (size_t)before->triangle_count * sizeof(int32_t)));
}

static void check_sets(orb_context *ctx, const orb_given_file *before, const orb_given_file *after,
                       const char *prefix) {
  orb_given_sets old, new;
  if (orb_given_sets_read(ctx, before, prefix, &old) == ORB_OK) {
    must(orb_given_sets_read(ctx, after, prefix, &new) == ORB_OK && new.count == old.count);
    for (int32_t s = 0; s < old.count; s++) {
      must(new.number[s] == old.number[s]);
      for (size_t i = 0; i < (size_t)old.width * (size_t)before->vertex_count; i++) {
        must(new.values[s][i] == old.values[s][i]);
      }
    }
    orb_given_sets_free(ctx, &new);
  }
  orb_given_sets_free(ctx, &old);
}

static void check_skin(orb_context *ctx, const orb_given_file *before, const orb_given_file *after) {
  orb_given_skin old, new;
  if (orb_given_skin_read(ctx, before, &old) == ORB_OK) {
    must(orb_given_skin_read(ctx, after, &new) == ORB_OK && new.skin == old.skin);
    if (old.skin >= 0) {
      size_t count = (size_t)old.influences * (size_t)before->vertex_count;
      must(new.influences == old.influences &&same(new.joints, old.joints, count * sizeof *old.joints));
      must(same(new.weights, old.weights, count * sizeof *old.weights));
    }
    orb_given_skin_free(ctx, &new);
  }
  orb_given_skin_free(ctx, &old);
}

static void keep(orb_context *ctx, const uint8_t *bytes, size_t size, unsigned choice, const orb_mesh *mesh) {
  size_t count = (size_t)mesh->vertex_count;
  static const char *const names[] = {"one"};
  int32_t *on = malloc(count * sizeof *on);
  unsigned char *used = malloc(count);
  must(on && used);
  for (size_t v = 0; v < count; v++) {
    on[v] = choice % 3 == 0 || v % 7 < choice % 7 ? (int32_t)v : -1;
    used[v] = on[v] >= 0;
  }
  const double *positions[] = {mesh->positions, mesh->positions};
  orb_gltf_shapes shapes = {.target_count = 1,
                            .file_vertex_count = mesh->vertex_count,
                            .names = names,
                            .on_surface = on,
                            .positions = positions};
  orb_gltf_kept kept;
  orb_buffer out = {0};
  orb_mesh again;
  if (orb_gltf_keep(ctx, bytes, size, &shapes, &kept, &out) == ORB_OK) {
    must(orb_mesh_read(ctx, out.data, out.size, ORB_FORMAT_GLB, &again, NULL) == ORB_OK);
    check_surface(mesh, &again);
    orb_mesh_free(ctx, &again);
    const orb_given_file before = {bytes, size, mesh->vertex_count, used};
    const orb_given_file after = {out.data, out.size, mesh->vertex_count, used};
    check_sets(ctx, &before, &after, "COLOR_");
    check_sets(ctx, &before, &after, "TEXCOORD_");
    check_skin(ctx, &before, &after);
  }
  orb_buffer_free(ctx, &out);
  orb_free(ctx, kept.dropped);
  free(on);
  free(used);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  orb_context_options options = {.threads = 1, .memory_limit = 256u << 20};
  orb_context *ctx;
  orb_mesh mesh;
  if (size < 1 || orb_context_create(&options, &ctx) != ORB_OK) {
    return 0;
  }
  const double began = fuzz_begin();
  if (orb_mesh_read(ctx, data + 1, size - 1, ORB_FORMAT_GLB, &mesh, NULL) == ORB_OK) {
    keep(ctx, data + 1, size - 1, data[0], &mesh);
    orb_mesh_free(ctx, &mesh);
  }
  must(orb_memory_used(ctx) == 0);
  fuzz_check_document(ctx, began, size, "unpacking");
  orb_context_destroy(ctx);
  return 0;
}

static uint32_t u32_at(const uint8_t *p) {
  return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static void put_u32(uint8_t *p, size_t value) {
  for (int i = 0; i < 4; i++) {
    p[i] = (uint8_t)(value >> (8 * i));
  }
}

enum { HEAD = 12, CHUNK = 8 }; /* bytes before the chunks of a GLB, and before the bytes of a chunk */

/* One number of the text becomes another of one digit or two. Returns the new size, at most size + 1. */
static size_t change_number(uint8_t *text, size_t size, unsigned seed) {
  size_t at = size ? seed % size : 0, end, digits = seed >> 8 & 1 ? 2 : 1;
  while (at < size && !(text[at] >= '0' && text[at] <= '9')) {
    at++;
  }
  for (end = at; end < size && text[end] >= '0' && text[end] <= '9';) {
    end++;
  }
  if (at == end) {
    return size;
  }
  digits = digits > end - at + 1 ? 1 : digits;
  memmove(text + at + digits, text + end, size - end);
  for (size_t i = 0; i < digits; i++) {
    text[at + i] = (uint8_t)('0' + (seed >> (12 + 4 * i)) % 10);
  }
  return size - (end - at) + digits;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed) {
  const size_t before = 1 + HEAD + CHUNK; /* the choice, and the bytes before the JSON */
  const size_t json = size > before ? u32_at(data + 1 + HEAD) : 0;
  const unsigned part = seed % 8;
  if (part == 0 || json == 0 || size < before + CHUNK || json > size - before - CHUNK) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  uint8_t *rest = data + before + json;
  const size_t rest_size = size - before - json;
  if (part < 4 && rest_size > CHUNK) { /* the bytes; a shorter chunk is filled up */
    const size_t bytes = rest_size - CHUNK, now = LLVMFuzzerMutate(rest + CHUNK, bytes, bytes);
    memset(rest + CHUNK + now, 0, bytes - now);
    return size;
  }
  uint8_t *text = malloc(max_size + 1);
  must(text != NULL);
  memcpy(text, data + before, json);
  const size_t room = max_size > before + rest_size ? max_size - before - rest_size : 0;
  size_t now =
      part < 7 ? change_number(text, json, seed >> 3) : LLVMFuzzerMutate(text, json, room > json ? room : json);
  const size_t padded = (now + 3) / 4 * 4;
  if (padded <= room) {
    memmove(data + before + padded, rest, rest_size);
    memcpy(data + before, text, now);
    memset(data + before + now, ' ', padded - now);
    put_u32(data + 1 + HEAD, padded);
    size = before + padded + rest_size;
    put_u32(data + 1 + 8, size - 1);
  }
  free(text);
  return size;
}
