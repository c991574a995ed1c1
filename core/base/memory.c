/* Budgeted memory: the header of each block records its size, which is charged to the budget and given back.
 *
 * Blocks of at least a huge page are mapped one by one instead of taken from malloc(): they go back to the system when
 * they are freed, whatever lies beside them; they come zeroed; and they are aligned to a huge page and ask for huge
 * pages, which saves most page faults and TLB misses. Smaller blocks stay with malloc(), which hands the same pages out
 * again: mapped one by one from 512 KiB on, an alignment had twice the page faults and took a tenth longer.
 *
 * A process that keeps its heap (orb_keep_heap()) has huge pages there, and maps only much larger blocks: an embedding
 * of 280,000 triangles then takes three quarters of the time, since the ends of mapped blocks are small pages, faulted
 * anew in each block. With sanitizers malloc() serves all blocks, because they watch it. */
#include <stdlib.h>
#include <string.h>
#if defined(__linux__)
#include <sys/mman.h>
#endif

#include "base/check.h"
#include "base/error.h"
#include "base/heap.h"
#include "base/memory.h"
#include "base/state.h"

#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ORB_MAPS 1
#endif
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#undef ORB_MAPS
#endif
#endif

enum {
  ALIGNMENT = 64,      /* bytes: a cache line, and the widest vector */
  PAGE = 1 << 16,      /* a multiple of the page size of every supported machine */
  HUGE_PAGE = 1 << 21, /* bytes, of x86-64 and of Arm with 4 KiB pages; blocks of this size are mapped */
  KEPT_MOST = 1 << 24, /* bytes; and blocks of this size where the heap is kept: a quarter of what it keeps */
  BLOCK_MAGIC = 0x0b10c4ed,
  FREED_MAGIC = 0x0b10dead
};

/* Occupies the 64 bytes before the block that the caller sees. raw: what the allocator returned, or the mapping. */
typedef struct block_header {
  uint32_t magic;
  int mapped;
  void *raw;
  size_t total; /* charged to the budget */
  size_t size;  /* requested */
} block_header;

_Static_assert(sizeof(block_header) <= ALIGNMENT, "the header fits before the block");

static block_header *header_of(void *block) {
  return (block_header *)(void *)((char *)block - ALIGNMENT);
}

static void *out_of_memory(orb_context *ctx, size_t wanted, int budget) {
  if (budget) {
    (void)orb_fail(ctx, ORB_E_NO_MEMORY,
                   "The job needs more than its memory budget of %zu bytes (%zu more requested); raise the budget or "
                   "send a smaller mesh.",
                   ctx->options.memory_limit, wanted);
  } else {
    (void)orb_fail(ctx, ORB_E_NO_MEMORY, "The machine is out of memory (%zu bytes requested).", wanted);
  }
  return NULL;
}

static void raise_to(atomic_size_t *most, size_t value) {
  size_t known = atomic_load(most);
  while (value > known && !atomic_compare_exchange_weak(most, &known, value)) {
  }
}

/* A heap that keeps what is freed (orb_keep_heap()) holds more than what is in use. Both together stay within the
 * limit: what is kept goes back where the limit has no more room for it. */
static void give_back(const orb_context *ctx, size_t used) {
  orb_context *root = ctx->root;
  const size_t heap = atomic_load(&root->heap_used), held = atomic_load(&root->heap_held);
  if (held > heap && used + (held - heap) > ctx->options.memory_limit) {
    orb_heap_give_back();
    atomic_store(&root->heap_held, heap);
  }
}

static int charge(orb_context *ctx, size_t total, int mapped) {
  orb_context *root = ctx->root;
  const size_t limit = ctx->options.memory_limit, used = atomic_fetch_add(&root->memory_used, total) + total;
  if (limit && used > limit) {
    atomic_fetch_sub(&root->memory_used, total);
    return 0;
  }
  raise_to(&root->memory_peak, used);
  if (!mapped) {
    raise_to(&root->heap_held, atomic_fetch_add(&root->heap_used, total) + total);
  }
  if (limit) {
    give_back(ctx, used);
  }
  return 1;
}

static void discharge(orb_context *ctx, size_t total, int mapped) {
  atomic_fetch_sub(&ctx->root->memory_used, total);
  if (!mapped) {
    atomic_fetch_sub(&ctx->root->heap_used, total);
  }
}

#ifdef ORB_MAPS
/* A zeroed mapping of `total` bytes, a multiple of PAGE; NULL without memory. */
static void *map_block(size_t total) {
  char *raw = mmap(NULL, total + HUGE_PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (raw == MAP_FAILED) {
    return NULL;
  }
  size_t before = (HUGE_PAGE - (uintptr_t)raw % HUGE_PAGE) % HUGE_PAGE;
  if (before) {
    munmap(raw, before);
  }
  munmap(raw + before + total, HUGE_PAGE - before);
  raw += before;
  (void)madvise(raw, total, MADV_HUGEPAGE); /* a hint; without it everything is only slower */
  return raw;
}
#endif

static int maps(const orb_context *ctx, size_t total) {
#ifdef ORB_MAPS
  return total >= (orb_heap_is_kept() ? KEPT_MOST : HUGE_PAGE) && !ctx->options.allocator.alloc;
#else
  (void)ctx;
  (void)total;
  return 0;
#endif
}

static void *get_raw(orb_context *ctx, size_t total, int mapped) {
#ifdef ORB_MAPS
  if (mapped) {
    return map_block(total);
  }
#endif
  (void)mapped;
  return ctx->options.allocator.alloc ? ctx->options.allocator.alloc(ctx->options.allocator.user, total)
                                      : malloc(total);
}

/* The bytes that a block of count × size takes in all; 0 if that overflows. */
static size_t total_of(const orb_context *ctx, size_t count, size_t size, size_t *bytes) {
  size_t total;
  if (__builtin_mul_overflow(count, size, bytes) || __builtin_add_overflow(*bytes, (size_t)(2 * PAGE), &total)) {
    return 0;
  }
  total = *bytes + 2 * (size_t)ALIGNMENT;
  return maps(ctx, total) ? (total + PAGE - 1) & ~((size_t)PAGE - 1) : total;
}

void *orb_alloc(orb_context *ctx, size_t count, size_t size) {
  size_t bytes, total = total_of(ctx, count, size, &bytes);
  if (total == 0) {
    return out_of_memory(ctx, SIZE_MAX, 0);
  }
  int mapped = maps(ctx, total);
  if (!charge(ctx, total, mapped)) {
    return out_of_memory(ctx, total, 1);
  }
  void *raw = get_raw(ctx, total, mapped);
  if (!raw) {
    discharge(ctx, total, mapped);
    return out_of_memory(ctx, total, 0);
  }
  uintptr_t start = ((uintptr_t)raw + 2 * ALIGNMENT - 1) & ~(uintptr_t)(ALIGNMENT - 1);
  void *block = (void *)start;
  *header_of(block) = (block_header){.magic = BLOCK_MAGIC, .mapped = mapped, .raw = raw, .total = total, .size = bytes};
  return block;
}

void *orb_calloc(orb_context *ctx, size_t count, size_t size) {
  void *block = orb_alloc(ctx, count, size);
  if (block && !header_of(block)->mapped) {
    memset(block, 0, count * size);
  }
  return block;
}

#ifdef ORB_MAPS
/* Grows or shrinks a mapping without copying. */
static void *remap(orb_context *ctx, void *block, size_t total, size_t bytes) {
  block_header *header = header_of(block);
  size_t old = header->total, offset = (size_t)((char *)block - (char *)header->raw);
  if (total > old && !charge(ctx, total - old, 1)) {
    return out_of_memory(ctx, total - old, 1);
  }
  char *raw = mremap(header->raw, old, total, MREMAP_MAYMOVE);
  if (raw == MAP_FAILED) {
    if (total > old) {
      discharge(ctx, total - old, 1);
    }
    return out_of_memory(ctx, total, 0);
  }
  if (total < old) {
    discharge(ctx, old - total, 1);
  }
  block = raw + offset;
  header = header_of(block);
  header->raw = raw;
  header->total = total;
  header->size = bytes;
  return block;
}
#endif

void *orb_realloc(orb_context *ctx, void *block, size_t count, size_t size) {
#ifdef ORB_MAPS
  size_t bytes, total = total_of(ctx, count, size, &bytes);
  if (block && header_of(block)->mapped && maps(ctx, total)) {
    return remap(ctx, block, total, bytes);
  }
#endif
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
  size_t total = header->total;
  discharge(ctx, total, header->mapped);
  void *raw = header->raw;
#ifdef ORB_MAPS
  if (header->mapped) {
    ORB_ASSERT(munmap(raw, total) == 0);
    return;
  }
#endif
  if (ctx->options.allocator.free) {
    ctx->options.allocator.free(ctx->options.allocator.user, raw);
  } else {
    free(raw);
  }
}

orb_status orb_memory_charge(orb_context *ctx, size_t bytes) {
  if (!charge(ctx, bytes, 1)) {
    (void)out_of_memory(ctx, bytes, 1);
    return ORB_E_NO_MEMORY;
  }
  return ORB_OK;
}

void orb_memory_discharge(orb_context *ctx, size_t bytes) {
  discharge(ctx, bytes, 1);
}

size_t orb_memory_used(const orb_context *ctx) {
  return atomic_load(&ctx->root->memory_used);
}
size_t orb_memory_peak(const orb_context *ctx) {
  return atomic_load(&ctx->root->memory_peak);
}
