/* What a pinning may use up. */
#ifndef ORB_ALIGN_PIN_ROOM_H
#define ORB_ALIGN_PIN_ROOM_H

#include "align/sheet/sheet.h"

/* What a pinning may use up. */
typedef struct orb_pin_room {
  double growth; /* of a sheet, see orb_pin_limit() */
  int64_t work;  /* visits of nodes and vertices that are left; when it is spent, the landmarks count as not met */
} orb_pin_room;

/* What `pin` may use up for one alignment, and `rbf` if it falls back on the patches of pin. */
static const double ORB_PIN_GROWTH = 64; /* default of orb_align_options.max_growth: for landmarks in another order */
static const int64_t ORB_PIN_WORK = 500000000; /* visits: about a minute; 150 random landmarks take a few seconds */

/* The most triangles of a sheet that may grow by this share of its own number; small sheets may grow by more. */
int32_t orb_pin_limit(const orb_sheet *sheet, double growth);

#endif
