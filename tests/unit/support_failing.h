/* Torture by memory: the first, second, third … allocation of a run fails, each in a run of its own. */
#ifndef SUPPORT_FAILING_H
#define SUPPORT_FAILING_H

#include "orbmorph/embed.h"

/* Embeds the mesh again and again with a failing allocation, until a run gets through without one. Each of the others
 * must end with ORB_E_NO_MEMORY, give no embedding and leave no block behind; returns how many there were. */
int failing_embeds(const orb_mesh *mesh, const orb_embed_options *options);

#endif
