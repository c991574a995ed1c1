#include "support_trials.h"

#include "base/check.h"
#include "support_context.h"
#include "support_shapes.h"

orb_status scene_survey(scene *s, orb_context *of) {
  ORB_TRY(orb_trials_open(of, &s->mesh[0], &s->mesh[1], &s->coarse));
  ORB_TRY(orb_trials_open_small(&s->coarse, &s->small));
  return orb_trials_survey(&s->small, 1);
}

void scene_close_trials(scene *s) {
  orb_trials_close(&s->small);
  orb_trials_close(&s->coarse);
}

void scene_close(scene *s) {
  scene_close_trials(s);
  shape_free(ctx, &s->mesh[0]);
  shape_free(ctx, &s->mesh[1]);
}
