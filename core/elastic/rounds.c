#include "elastic/rounds.h"

#include <math.h>

#include "base/check.h"
#include "base/context.h"
#include "elastic/places.h"
#include "elastic/rough_map.h"

/* Chosen by trial on the pairs of the half `choose` of tests/bench/correspond.py. */
enum { ALTERNATIONS = 2 };    /* of rotations and positions in a round */
enum { STEPS_OF_VERTEX = 8 }; /* for progress: for each vertex, a round takes as long as so many steps of a map */
/* The rough map keeps pulling beside the places, with this share of its strength at first, and not at all after FADED
 * of the rounds: without it a limb slides to the nearest other one. */
static const double MAP_SHARE = 0.3, FADED = 0.7;
/* Distance at which a vertex of the rough map is an outlier and counts a quarter, for surfaces of area 4π. */
static const double OUTLIER_PLACE = 0.4;

orb_status orb_registration_round(orb_registration *r, double done, double reach) {
  if (r->is_alone) { /* elsewhere the caller's loops check */
    ORB_TRY(orb_context_check(r->ctx));
  }
  orb_registration_clear(r);
  if (r->map && done < FADED) {
    orb_pull_by_rough_map(r, MAP_SHARE / orb_rough_map_reach2() * (1 - done / FADED), OUTLIER_PLACE);
  }
  orb_pull_by_places(r, 1 / (reach * reach));
  orb_registration_pull_by_anchors(r);
  for (int k = 0; k < ALTERNATIONS; k++) {
    ORB_TRY(orb_registration_solve(r, k == 0));
    orb_registration_fit(r);
  }
  orb_progress_steps(r->ctx, STEPS_OF_VERTEX * (int64_t)r->a.count);
  return ORB_OK;
}

orb_status orb_registration_rounds(orb_registration *r, int rounds, double first, double last) {
  for (int i = 0; i < rounds; i++) {
    const double done = (double)i / (rounds - 1);
    ORB_TRY(orb_registration_round(r, done, first * pow(last / first, done)));
  }
  return ORB_OK;
}
