#include "transfer/names.h"

#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/hash.h"
#include "base/memory.h"
#include "orbmorph/utf8.h"

enum { CHECK_EVERY = 1024 }; /* names between two checks for cancellation */

typedef char base_name[2 * ORB_NAME_MAX + 32]; /* a name without its number */

typedef struct namer {
  orb_context *ctx;
  orb_target_name *texts;
  int32_t *slots;  /* of a table of texts: their frames; 0: free, as that of the first shape is not in it */
  int32_t *number; /* per frame: the last one that was tried on its text; 0: none yet */
  uint64_t mask;
} namer;

/* The slot of a text, or the free one that it would get. */
static int32_t *slot_of(const namer *n, const char *text) {
  uint64_t slot = orb_hash(n->ctx, text, strlen(text)) & n->mask;
  while (n->slots[slot] && strcmp(n->texts[n->slots[slot]], text) != 0) {
    slot = (slot + 1) & n->mask;
  }
  return &n->slots[slot];
}

/* The numbers tried on one text only grow, so that a text is in the way of at most one other. */
static void name_frame(namer *n, int32_t frame, const char *base) {
  orb_target_name *text = &n->texts[frame];
  (void)snprintf(*text, sizeof *text, "%s", base);
  int32_t *slot = slot_of(n, base), first = *slot;
  while (*slot) {
    n->number[first] += n->number[first] ? 1 : 2;
    (void)snprintf(*text, sizeof *text, "%s (%d)", base, (int)n->number[first]);
    slot = slot_of(n, *text);
  }
  *slot = frame;
}

/* A frame's name before it is unique. */
static void base_of(const orb_draft *draft, const char *const *names, int32_t frame, base_name out) {
  int32_t shapes = draft->shape_count, steps = draft->options->path_steps, between = frame - shapes;
  char one[ORB_NAME_MAX], next[ORB_NAME_MAX];
  if (frame < shapes) {
    (void)orb_utf8_copy(out, ORB_NAME_MAX, names[frame]);
  } else if (between < draft->between_count) {
    (void)orb_utf8_copy(one, sizeof one, names[between / steps]);
    (void)orb_utf8_copy(next, sizeof next, names[between / steps + 1]);
    (void)snprintf(out, sizeof(base_name), "%s to %s %d/%d", one, next, (int)(between % steps) + 1, (int)steps + 1);
  } else {
    (void)orb_utf8_copy(out, ORB_NAME_MAX, draft->options->targets[between - draft->between_count].name);
  }
}

orb_status orb_draft_names(orb_context *ctx, const orb_draft *draft, const char *const *names, orb_target_name *texts,
                           const char **out) {
  uint64_t size = 4;
  while (size < 2 * (uint64_t)draft->frame_count) {
    size *= 2;
  }
  namer n = {.ctx = ctx,
             .texts = texts,
             .slots = ORB_NEW0(ctx, int32_t, size),
             .number = ORB_NEW0(ctx, int32_t, draft->frame_count),
             .mask = size - 1};
  orb_status status = n.slots && n.number ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t f = 0; status == ORB_OK && f < draft->frame_count; f++) {
    base_name base;
    base_of(draft, names, f, base);
    out[f] = texts[f];
    if (f == 0) {
      (void)snprintf(texts[0], sizeof texts[0], "%s", base);
    } else {
      name_frame(&n, f, base);
    }
    status = f % CHECK_EVERY == 0 ? orb_context_check(ctx) : ORB_OK;
  }
  orb_free(ctx, n.slots);
  orb_free(ctx, n.number);
  return status;
}
