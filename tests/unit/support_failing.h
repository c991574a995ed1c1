/* Torture by memory: the first, second, third … allocation fails, each in a separate run. */
#ifndef SUPPORT_FAILING_H
#define SUPPORT_FAILING_H

#include "orbmorph/embed.h"

/* Embeds the mesh repeatedly with one failing allocation, until a run meets no failure. Every other run must end with
 * ORB_E_NO_MEMORY, give no embedding and leak nothing. Returns the number of failed runs. */
int failing_embeds(const orb_mesh *mesh, const orb_embed_options *options);

#endif
