/* A round adds up pulls on the vertices of mesh a: from the rough map, and from the nearest places both ways. Then
 * rotations and positions take turns. Each vertex takes the rotation that fits its edges best. Then all positions
 * together solve a linear system that asks each edge to equal the given edge under the rotations of its ends. The pulls
 * grow stronger from round to round.
 *
 * The first rotations come from the rough map: how it rotates the surroundings of each vertex. If they came from the
 * rotation of the whole instead, an arm raised by 150° would stay twisted, since neighbouring rotations hold each
 * other. */
#include "elastic/elastic.h"

#include "base/check.h"
#include "elastic/mend.h"
#include "elastic/rough_map.h"
#include "elastic/rounds.h"

/* Lengths are those of surfaces of area 4π. Chosen by trial on the pairs of the half `choose` of
 * tests/bench/correspond.py, unless a line gives another reason. */
enum { PLACE_ROUNDS = 6 }; /* to the nearest places; 10 rank maps no better, and let wrong ones catch up */
/* Distance at which a pull is as strong as the edges: a rough map is off by 0.2 or more at the ends of limbs. */
static const double FIRST_REACH = 0.6, LAST_REACH = 0.06;
/* A pose to settle is carried from copies, and is off by about one of their edges. */
static const double SETTLE_FIRST_REACH = 0.15, SETTLE_LAST_REACH = 0.03;

orb_status orb_elastic_register(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, const orb_surroundings *around,
                                const orb_rough_map *map, const orb_elastic_anchors *anchors, orb_elastic_pose *pose,
                                double *bend) {
  orb_registration r = {.ctx = ctx, .map = map, .anchors = anchors, .surroundings = around, .pose = pose};
  orb_status status;
  ORB_GO(status, orb_registration_create(ctx, a, b, &r), end);
  ORB_GO(status, orb_follow_rough_map(&r), end);
  ORB_GO(status, orb_registration_rounds(&r, PLACE_ROUNDS, FIRST_REACH, LAST_REACH), end);
  *bend = orb_registration_bend(&r);
end:
  orb_registration_free(&r);
  return status;
}

orb_status orb_elastic_settle(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                              const orb_elastic_anchors *anchors, int rounds, int mends, orb_elastic_pose *pose) {
  orb_registration r = {.ctx = ctx, .anchors = anchors, .pose = pose, .is_alone = 1};
  orb_status status;
  ORB_GO(status, orb_registration_create(ctx, a, b, &r), end);
  ORB_GO(status, orb_registration_rounds(&r, rounds, SETTLE_FIRST_REACH, SETTLE_LAST_REACH), end);
  if (mends) {
    status = orb_registration_mend(&r, SETTLE_LAST_REACH);
  }
end:
  orb_registration_free(&r);
  return status;
}
