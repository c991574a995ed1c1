/* The rows of orbmorph/material_members.h as a table. */
#ifndef ORB_FORMAT_MATERIAL_TABLE_H
#define ORB_FORMAT_MATERIAL_TABLE_H

#include "orbmorph/material.h"

typedef enum orb_member_kind {
  ORB_MEMBER_PRESENCE,
  ORB_MEMBER_NUMBER,
  ORB_MEMBER_COLOR,
  ORB_MEMBER_COLOR4,
  ORB_MEMBER_FLAG,
  ORB_MEMBER_MODE,
  ORB_MEMBER_TEXTURE
} orb_member_kind;

typedef struct orb_member_row {
  const char *extension, *name;
  orb_member_kind kind;
  double low, high;
  int needs_tangents;
} orb_member_row;

#ifdef __cplusplus
extern "C" {
#endif

/* member: below ORB_MATERIAL_MEMBER_COUNT. */
const orb_member_row *orb_member_row_of(orb_material_member member);

/* How many numbers a value of this member has in glTF: of a texture 1 if it has a scale or strength, else 0. */
int orb_member_numbers(orb_material_member member);

/* The name of a texture's number: "scale", "strength"; NULL if it has none. */
const char *orb_member_factor(orb_material_member member);

/* The nearest number in the range of the member. An index of refraction of 0 stays: it stands for infinity. */
double orb_member_clamp(orb_material_member member, double number);

#ifdef __cplusplus
}
#endif
#endif
