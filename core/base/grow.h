/* An array that its owner holds by a pointer of any type grows in place. */
#ifndef ORB_BASE_GROW_H
#define ORB_BASE_GROW_H

#include <string.h>

#include "orbmorph/context.h"

/* array: the address of the pointer. 0 where memory cannot be had: all is then as before. */
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
