/* Shapes that stand on a flat base, such as busts and statues. */
#ifndef ORB_CLI_VIEW_BASE_H
#define ORB_CLI_VIEW_BASE_H

#include "view_mesh.h"

/* The axis that points up where the first shape is flat at one end and nowhere else, and tall enough to stand on it;
 * 'Y' if it stands on its head. 0: none. */
char view_find_base(const view_mesh *mesh);

#endif
