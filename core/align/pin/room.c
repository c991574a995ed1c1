/* How far a sheet may grow. */
#include "align/pin/room.h"

/* Triangles, see orb_align_options.max_growth: a smaller sheet may grow as if it had SMALL; none grows by more than
 * MOST.
 */
enum { SMALL = 2000, MOST = 800000 };

int32_t orb_pin_limit(const orb_sheet *sheet, double growth) {
  double own = sheet->shape.mesh.triangle_count, more = growth * (own > SMALL ? own : SMALL);
  double most = own + (more < MOST ? more : MOST);
  return most < INT32_MAX / 16 ? (int32_t)most : INT32_MAX / 16;
}
