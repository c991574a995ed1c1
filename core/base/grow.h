/* Growing an array through a pointer of any type. */
#ifndef ORB_BASE_GROW_H
#define ORB_BASE_GROW_H

#include <string.h>

#include "base/memory.h"
#include "orbmorph/context.h"

/* array: the address of the pointer. Returns 0 without memory; the array is then unchanged. */
static inline int orb_regrow(orb_context *ctx, void *array, size_t count, size_t size) {
  void *block;
  memcpy(&block, array, sizeof block);
  block = orb_realloc(ctx, block, count, size);
  if (block) {
    memcpy(array, &block, sizeof block);
  }
  return block != NULL;
}

#endif
