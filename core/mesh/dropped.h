/* Lists of what a file has and its asset lacks. */
#ifndef ORB_MESH_DROPPED_H
#define ORB_MESH_DROPPED_H

#include "orbmorph/context.h"
#include "orbmorph/material.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Adds an entry to a list (NULL and 0 at first; freed by the caller). Longer texts are cut; why must be a literal. Once
 * the list has ORB_DROPPED_MAX − 1 entries, the last one only counts the rest. */
ORB_MUST_CHECK orb_status orb_dropped_add(orb_context *ctx, orb_dropped **list, int32_t *count, const char *what,
                                          const char *where, const char *why);

#ifdef __cplusplus
}
#endif
#endif
