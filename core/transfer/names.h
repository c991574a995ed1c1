/* The names of the targets of an asset. */
#ifndef ORB_TRANSFER_NAMES_H
#define ORB_TRANSFER_NAMES_H

#include "transfer/draft.h"

/* A name, or the two of an in-between, and a number. */
typedef char orb_target_name[2 * ORB_NAME_MAX + 64];

/* The names of the frames: of the shapes, of the in-betweens, of the targets of the options. A name is cut after
 * ORB_NAME_MAX − 1 bytes at most. If a name is taken, the later frame gets a number. The first shape names the mesh
 * rather than a target, and takes no name. texts and out: frame_count; out refers to texts. Expected O(N). */
ORB_MUST_CHECK orb_status orb_draft_names(orb_context *ctx, const orb_draft *draft, const char *const *names,
                                          orb_target_name *texts, const char **out);

#endif
