/* The direction of the view, unless the user sets it. */
#ifndef ORB_CLI_VIEW_AIM_H
#define ORB_CLI_VIEW_AIM_H

#include "view_mesh.h"
#include "view_options.h"

/* Fills in options->up, options->sign and options->yaw where they are open.
 *
 * Up is y, as glTF says, unless the first shape clearly lies down: it is a mirror image of itself along y and not along
 * x or z, it stands on one spot along y and on separate feet along another axis, it has two legs along a long axis
 * while y is its depth (view_legs.h), or it has one flat base that faces another way (view_base.h). The yaw shows the
 * largest side of the shapes, rotated by 22° so that depth shows, to where more of them shows. */
void view_aim(const view_mesh *mesh, view_options *options);

#endif
