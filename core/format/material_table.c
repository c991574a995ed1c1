#include "format/material_table.h"

#include <stddef.h>

#include "base/check.h"

enum { NOTHING, TANGENTS };

#define ROW(id, extension, name, kind, low, high, needs) {extension, name, ORB_MEMBER_##kind, low, high, needs},
static const orb_member_row ROWS[] = {ORB_MATERIAL_MEMBERS(ROW)};
#undef ROW

const orb_member_row *orb_member_row_of(orb_material_member member) {
  ORB_ASSERT((unsigned)member < ORB_MATERIAL_MEMBER_COUNT);
  return &ROWS[member];
}

const char *orb_member_factor(orb_material_member member) {
  const orb_member_row *row = orb_member_row_of(member);
  if (row->kind != ORB_MEMBER_TEXTURE || row->high == 0) {
    return NULL;
  }
  return row->needs_tangents ? "scale" : "strength";
}

int orb_member_numbers(orb_material_member member) {
  switch (orb_member_row_of(member)->kind) {
    case ORB_MEMBER_NUMBER:
    case ORB_MEMBER_FLAG:
    case ORB_MEMBER_MODE:
      return 1;
    case ORB_MEMBER_COLOR:
      return 3;
    case ORB_MEMBER_COLOR4:
      return 4;
    case ORB_MEMBER_TEXTURE:
      return orb_member_factor(member) ? 1 : 0;
    default:
      return 0;
  }
}

double orb_member_clamp(orb_material_member member, double number) {
  const orb_member_row *row = orb_member_row_of(member);
  if (member == ORB_MATERIAL_IOR && number == 0) {
    return 0;
  }
  return number > row->low ? (number < row->high ? number : row->high) : row->low; /* NaN: low */
}
