#include "store/spheres.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "api/ids.h"
#include "orbmorph/format.h"

enum { HASH_BYTES = 32, TAIL_BYTES = HASH_BYTES + 4 + 8, SHAPES_MOST = 16 };
static const char mark[] = "ORBSPHER", mark_joined[] = "ORBSPHPL";

static void put(unsigned char *at, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; i++) {
    at[i] = (unsigned char)(value >> (8 * i));
  }
}

static uint64_t get(const unsigned char *at, int bytes) {
  uint64_t value = 0;
  for (int i = 0; i < bytes; i++) {
    value |= (uint64_t)at[i] << (8 * i);
  }
  return value;
}

typedef struct sink {
  object_temp temp;
  crypto_hash_sha256_state hash;
  uint64_t size;
} sink;

static store_result pour(sink *to, const void *bytes, size_t size) {
  crypto_hash_sha256_update(&to->hash, bytes, size);
  to->size += size;
  return objects_append(&to->temp, bytes, size);
}

static store_result pour_sphere(sink *to, orb_context *ctx, const orb_aligned_shape *shape, orb_status *status) {
  orb_buffer ply = {0};
  *status = orb_sphere_ply_write(ctx, &shape->mesh, shape->points, &ply);
  store_result result = *status == ORB_OK ? pour(to, ply.data, ply.size) : STORE_ERROR;
  orb_buffer_free(ctx, &ply);
  return result;
}

static store_result pour_tail(sink *to, const uint64_t *starts, int32_t shapes, int joined) {
  unsigned char table[8 * (SHAPES_MOST + 2)], tail[TAIL_BYTES];
  const int32_t parts = shapes + joined;
  for (int32_t s = 0; s <= parts; s++) {
    put(table + 8 * s, starts[s], 8);
  }
  store_result result = pour(to, table, 8 * (size_t)(parts + 1));
  if (result != STORE_OK) {
    return result;
  }
  crypto_hash_sha256_final(&to->hash, tail);
  put(tail + HASH_BYTES, (uint64_t)shapes, 4);
  memcpy(tail + HASH_BYTES + 4, joined ? mark_joined : mark, 8);
  to->size += sizeof tail;
  return objects_append(&to->temp, tail, sizeof tail);
}

store_result spheres_put(objects *store, orb_context *ctx, const char *id, const orb_alignment *alignment,
                         const orb_buffer *places, int64_t *bytes, orb_status *status) {
  sink to = {.size = 0};
  uint64_t starts[SHAPES_MOST + 2] = {0};
  *status = ORB_OK;
  if (alignment->shape_count > SHAPES_MOST) {
    return STORE_ERROR;
  }
  store_result result = objects_begin(store, &to.temp);
  if (result != STORE_OK) {
    return result;
  }
  crypto_hash_sha256_init(&to.hash);
  for (int32_t s = 0; s < alignment->shape_count && result == STORE_OK; s++) {
    result = pour_sphere(&to, ctx, &alignment->shapes[s], status);
    starts[s + 1] = to.size;
  }
  if (places && result == STORE_OK) {
    result = pour(&to, places->data, places->size);
    starts[alignment->shape_count + 1] = to.size;
  }
  result = result == STORE_OK ? pour_tail(&to, starts, alignment->shape_count, places != NULL) : result;
  result = result == STORE_OK ? objects_publish(store, &to.temp, OBJECT_SPHERES, id) : result;
  objects_abandon(&to.temp);
  *bytes = (int64_t)to.size;
  return result;
}

/* Whether a file ends in a mark. *joined: it has the places. */
static int is_marked(const unsigned char tail[TAIL_BYTES], int *joined) {
  *joined = memcmp(tail + HASH_BYTES + 4, mark_joined, 8) == 0;
  return *joined || memcmp(tail + HASH_BYTES + 4, mark, 8) == 0;
}

static int read_at(int fd, void *out, size_t size, uint64_t at) {
  ssize_t n = pread(fd, out, size, (off_t)at);
  return n == (ssize_t)size;
}

store_result spheres_find(const objects *store, const char *id, int shape, uint64_t *start, uint64_t *length) {
  int fd, joined;
  uint64_t size;
  unsigned char tail[TAIL_BYTES], entry[16];
  store_result result = objects_read(store, OBJECT_SPHERES, id, &fd, &size);
  if (result != STORE_OK) {
    return result;
  }
  result = STORE_ERROR;
  if (size > TAIL_BYTES && read_at(fd, tail, sizeof tail, size - TAIL_BYTES) && is_marked(tail, &joined)) {
    const uint64_t shapes = get(tail + HASH_BYTES, 4), parts = shapes + (uint64_t)joined;
    const uint64_t table = size - TAIL_BYTES - 8 * (parts + 1);
    const uint64_t part = shape == SPHERES_PLACES ? shapes : (uint64_t)shape;
    if (shape == SPHERES_PLACES ? !joined : shape < 0 || part >= shapes) {
      result = STORE_NOT_FOUND;
    } else if (shapes <= SHAPES_MOST && table < size && read_at(fd, entry, 16, table + 8 * part)) {
      uint64_t end = get(entry + 8, 8);
      *start = get(entry, 8);
      *length = end - *start;
      result = *start < end && end <= table ? STORE_OK : STORE_ERROR;
    }
  }
  close(fd);
  return result;
}

/* Hashes the first bytes of a file in parts, so that the memory does not depend on its size. */
static int hash_first(int fd, uint64_t size, unsigned char hash[HASH_BYTES]) {
  enum { BLOCK = 1 << 18 };
  unsigned char *block = malloc(BLOCK);
  crypto_hash_sha256_state state;
  int fine = block != NULL;
  crypto_hash_sha256_init(&state);
  for (uint64_t at = 0; fine && at < size; at += BLOCK) {
    size_t part = size - at < BLOCK ? (size_t)(size - at) : BLOCK;
    fine = read_at(fd, block, part, at);
    crypto_hash_sha256_update(&state, block, fine ? part : 0);
  }
  crypto_hash_sha256_final(&state, hash);
  free(block);
  return fine;
}

store_result spheres_check_file(int fd, uint64_t size) {
  unsigned char tail[TAIL_BYTES], hash[HASH_BYTES];
  int joined;
  if (size <= TAIL_BYTES) {
    return STORE_CONFLICT;
  }
  if (!read_at(fd, tail, sizeof tail, size - TAIL_BYTES) || !hash_first(fd, size - TAIL_BYTES, hash)) {
    return STORE_ERROR;
  }
  return is_marked(tail, &joined) && memcmp(tail, hash, HASH_BYTES) == 0 ? STORE_OK : STORE_CONFLICT;
}

store_result spheres_check(const objects *store, const char *id) {
  int fd;
  uint64_t size;
  store_result result = objects_read(store, OBJECT_SPHERES, id, &fd, &size);
  if (result == STORE_OK) {
    result = spheres_check_file(fd, size);
    close(fd);
  }
  return result;
}
