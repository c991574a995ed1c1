/* Converts a stored asset to another profile, in a process of its own: an asset has what callers' files have, and a
 * process that a file has taken over may have written it. http/profile.c calls this. */
#ifndef ORB_CONVERT_H
#define ORB_CONVERT_H

#include "isolate/task.h"
#include "orbmorph/profile.h"

typedef struct convert_limits {
  int64_t memory, deadline_ms; /* the context has the same */
  int (*wanted)(void *user);   /* called many times a second while a process works: 0 ends it */
  void *user;
} convert_limits;

/* Writes the asset of the supermesh `id` in another profile to a temporary file, for which the caller calls
 * objects_abandon(). 1, or 0 with the problem; then *out is empty. asset: a descriptor of the stored asset, of so many
 * bytes. tenant: for whom; a process that dies is counted for it. */
int convert_asset(catalogue *cat, objects *store, orb_context *ctx, const char *id, orb_profile profile, int asset,
                  int64_t size, const char *tenant, const convert_limits *limits, object_temp *out,
                  api_problem *problem);

/* Within a process of its own: appends the asset in this descriptor in the profile of the task. 1, or 0 with the
 * problem. */
int convert_here(const task_head *task, int asset, orb_context *ctx, orb_buffer *out, api_problem *problem);

#endif
