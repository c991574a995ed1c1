/* Budgeted memory: every block has a header that remembers its size, so that the budget can be kept and freed. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"

enum { ALIGNMENT = 64, BLOCK_MAGIC = 0x0b10c4ed, FREED_MAGIC = 0x0b10dead };

/* Lies in the 64 bytes before the block that the caller sees; raw is what the allocator gave. */
typedef struct block_header {
  uint32_t magic;
  void *raw;
  size_t total; /* charged to the budget */
  size_t size;  /* asked for */
} block_header;

_Static_assert(sizeof(block_header) <= ALIGNMENT, "the header fits before the block");

static block_header *header_of(void *block) {
  return (block_header *)(void *)((char *)block - ALIGNMENT);
}

static void *out_of_memory(orb_context *ctx, size_t wanted, int budget) {
  if (budget) {
    (void)orb_fail(ctx, ORB_E_NO_MEMORY,
                   "The job needs more than its memory budget of %zu bytes (%zu more asked for); raise the budget or "
                   "send a smaller mesh.",
                   ctx->options.memory_limit, wanted);
  } else {
    (void)orb_fail(ctx, ORB_E_NO_MEMORY, "The machine has no memory left (%zu bytes asked for).", wanted);
  }
  return NULL;
}

static int charge(orb_context *ctx, size_t total) {
  size_t used = atomic_fetch_add(&ctx->memory_used, total) + total;
  if (ctx->options.memory_limit && used > ctx->options.memory_limit) {
    atomic_fetch_sub(&ctx->memory_used, total);
    return 0;
  }
  size_t peak = atomic_load(&ctx->memory_peak);
  while (used > peak && !atomic_compare_exchange_weak(&ctx->memory_peak, &peak, used)) {
  }
  return 1;
}

void *orb_alloc(orb_context *ctx, size_t count, size_t size) {
  size_t bytes, total;
  if (__builtin_mul_overflow(count, size, &bytes) || __builtin_add_overflow(bytes, 2 * (size_t)ALIGNMENT, &total)) {
    return out_of_memory(ctx, SIZE_MAX, 0);
  }
  if (!charge(ctx, total)) {
    return out_of_memory(ctx, total, 1);
  }
  void *raw =
      ctx->options.allocator.alloc ? ctx->options.allocator.alloc(ctx->options.allocator.user, total) : malloc(total);
  if (!raw) {
    atomic_fetch_sub(&ctx->memory_used, total);
    return out_of_memory(ctx, total, 0);
  }
  uintptr_t start = ((uintptr_t)raw + 2 * ALIGNMENT - 1) & ~(uintptr_t)(ALIGNMENT - 1);
  void *block = (void *)start;
  *header_of(block) = (block_header){.magic = BLOCK_MAGIC, .raw = raw, .total = total, .size = bytes};
  return block;
}

void *orb_calloc(orb_context *ctx, size_t count, size_t size) {
  void *block = orb_alloc(ctx, count, size);
  if (block) {
    memset(block, 0, count * size);
  }
  return block;
}

void *orb_realloc(orb_context *ctx, void *block, size_t count, size_t size) {
  void *grown = orb_alloc(ctx, count, size);
  if (grown && block) {
    size_t old = header_of(block)->size, now = count * size;
    memcpy(grown, block, old < now ? old : now);
    orb_free(ctx, block);
  }
  return grown;
}

void orb_free(orb_context *ctx, void *block) {
  if (!block) {
    return;
  }
  block_header *header = header_of(block);
  ORB_ASSERT(header->magic == BLOCK_MAGIC);
  header->magic = FREED_MAGIC;
  atomic_fetch_sub(&ctx->memory_used, header->total);
  void *raw = header->raw;
  if (ctx->options.allocator.free) {
    ctx->options.allocator.free(ctx->options.allocator.user, raw);
  } else {
    free(raw);
  }
}

size_t orb_memory_used(const orb_context *ctx) {
  return atomic_load(&ctx->memory_used);
}
size_t orb_memory_peak(const orb_context *ctx) {
  return atomic_load(&ctx->memory_peak);
}

static orb_status buffer_reserve(orb_context *ctx, orb_buffer *buffer, size_t more) {
  size_t max = buffer->max ? buffer->max : (size_t)UINT32_MAX;
  if (more > max || buffer->size > max - more) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "A result would be larger than %zu bytes.", max);
  }
  size_t need = buffer->size + more;
  if (need <= buffer->capacity) {
    return ORB_OK;
  }
  size_t capacity = buffer->capacity < 4096 ? 4096 : buffer->capacity + buffer->capacity / 2;
  if (capacity < need) {
    capacity = need;
  }
  if (capacity > max) {
    capacity = max;
  }
  unsigned char *data = orb_realloc(ctx, buffer->data, capacity, 1);
  if (!data) {
    return ORB_E_NO_MEMORY;
  }
  buffer->data = data;
  buffer->capacity = capacity;
  return ORB_OK;
}

orb_status orb_buffer_append(orb_context *ctx, orb_buffer *buffer, const void *bytes, size_t size) {
  ORB_TRY(buffer_reserve(ctx, buffer, size));
  if (size) {
    memcpy(buffer->data + buffer->size, bytes, size);
  }
  buffer->size += size;
  return ORB_OK;
}

orb_status orb_buffer_printf(orb_context *ctx, orb_buffer *buffer, const char *format, ...) {
  va_list args, again;
  va_start(args, format);
  va_copy(again, args);
  int length = vsnprintf(NULL, 0, format, args);
  va_end(args);
  orb_status status = ORB_E_INTERNAL;
  if (length >= 0) {
    status = buffer_reserve(ctx, buffer, (size_t)length + 1);
    if (status == ORB_OK) {
      vsnprintf((char *)buffer->data + buffer->size, (size_t)length + 1, format, again);
      buffer->size += (size_t)length;
    }
  }
  va_end(again);
  return status;
}

void orb_buffer_free(orb_context *ctx, orb_buffer *buffer) {
  orb_free(ctx, buffer->data);
  buffer->data = NULL;
  buffer->size = buffer->capacity = 0;
}
