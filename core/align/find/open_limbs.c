#include "align/find/open_limbs.h"

#include "align/find/params.h"
#include "align/find/tips.h"
#include "base/check.h"

/* Does a landmark of copy s lie near a vertex, along the surface? */
static int is_told(const orb_trials *t, int s, int32_t v) {
  for (int32_t i = 0; i < t->hint.count; i++) {
    if (orb_survey_apart(&t->survey[s], &t->copy[s].mesh, v, t->hint.vertex[s][i]) <= ORB_FIND_HINT_TELLS) {
      return 1;
    }
  }
  return 0;
}

orb_status orb_open_limbs_count(const orb_trials *t, int32_t *count) {
  *count = 0;
  for (int s = 0; s < 2; s++) {
    orb_tips tips;
    int32_t open = 0;
    ORB_TRY(orb_tips_find(t->ctx, &t->copy[s], &t->survey[s], &tips));
    for (int32_t i = 0; i < tips.count; i++) {
      open += !is_told(t, s, tips.vertex[i]);
    }
    *count = open > *count ? open : *count;
  }
  return ORB_OK;
}
