/* How far a sheet may grow. */
#include "align/pin/room.h"

int32_t orb_pin_limit(const orb_sheet *sheet, double growth) {
  double own = sheet->shape.mesh.triangle_count, more = growth * (own > 2000 ? own : 2000);
  double most = own + (more < 800000 ? more : 800000);
  return most < INT32_MAX / 16 ? (int32_t)most : INT32_MAX / 16;
}
