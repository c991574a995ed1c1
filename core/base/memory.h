/* Memory of a context beyond orb_alloc() and orb_free(): zeroed, resized, typed. Charged to the same budget. */
#ifndef ORB_BASE_MEMORY_H
#define ORB_BASE_MEMORY_H

#include "orbmorph/context.h"

void *orb_calloc(orb_context *ctx, size_t count, size_t size);
/* Grows or shrinks a block of orb_alloc() (or NULL); on failure returns NULL and keeps the old block. */
void *orb_realloc(orb_context *ctx, void *block, size_t count, size_t size);

/* Typed allocation: ORB_NEW(ctx, double, 3 * n). ORB_NEW0: zeroed. */
#define ORB_NEW(ctx, type, count) ((type *)orb_alloc((ctx), (size_t)(count), sizeof(type)))
#define ORB_NEW0(ctx, type, count) ((type *)orb_calloc((ctx), (size_t)(count), sizeof(type)))

#endif
