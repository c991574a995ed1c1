/* Trials between two meshes, on small copies of their coarse copies. */
#ifndef SUPPORT_TRIALS_H
#define SUPPORT_TRIALS_H

#include "align/find/trials.h"
#include "orbmorph/context.h"
#include "orbmorph/mesh.h"

typedef struct scene {
  orb_mesh mesh[2];
  orb_trials coarse, small;
} scene;

/* Opens the trials of the meshes, and surveys the small copies with distances. The rest of the scene is zero. Free it
 * in any case: with scene_close(), or with scene_close_trials(), which leaves the meshes. */
ORB_MUST_CHECK orb_status scene_survey(scene *s, orb_context *of);
void scene_close_trials(scene *s);
void scene_close(scene *s); /* with `ctx` of support_context.h, which has the meshes */

#endif
