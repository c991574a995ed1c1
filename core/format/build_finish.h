/* Turns an orb_build into a mesh. */
#ifndef ORB_FORMAT_BUILD_FINISH_H
#define ORB_FORMAT_BUILD_FINISH_H

#include "format/build.h"

/* Checks indices, cuts polygons, fills `out`. end: the last line or the size; the error of a file without faces points
 * there. */
ORB_MUST_CHECK orb_status orb_build_finish(orb_build *build, int is_text, int64_t end, orb_mesh *out);

/* Converts a channel of a colour, 0 to 1. */
float orb_srgb_to_linear(float c);

#endif
