#include "mesh/dropped.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"

orb_status orb_dropped_add(orb_context *ctx, orb_dropped **list, int32_t *count, const char *what, const char *where,
                           const char *why) {
  if (!*list && !(*list = ORB_NEW0(ctx, orb_dropped, ORB_DROPPED_MAX))) {
    return ORB_E_NO_MEMORY;
  }
  orb_dropped *last = *list + ORB_DROPPED_MAX - 1;
  if (*count < ORB_DROPPED_MAX - 1) {
    orb_dropped *entry = *list + (*count)++;
    (void)snprintf(entry->what, sizeof entry->what, "%s", what);
    (void)snprintf(entry->where, sizeof entry->where, "%s", where);
    entry->why = why;
    return ORB_OK;
  }
  long more = *count == ORB_DROPPED_MAX ? strtol(last->what, NULL, 10) : 0;
  *count = ORB_DROPPED_MAX;
  (void)snprintf(last->what, sizeof last->what, "%ld more", more + 1);
  last->why = "The list names at most 99 entries.";
  return ORB_OK;
}
