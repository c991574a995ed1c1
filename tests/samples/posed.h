/* Posed bodies with true correspondences, for tests/bench/correspond.py.
 *
 * A kind is an animal of primitives whose cones are also its bones. Every body is polygonised by itself in its rest
 * pose (posed_build.c) and then skinned (posed_pose.c). A sample is a ray from a bone, stated by limb, position along
 * the limb and direction around it, so every kind that has the limb has the sample (posed_truth.c); where it leaves the
 * body at rest is the true place, and skinning carries it into the pose. Poses of one kind therefore correspond
 * exactly; places on different kinds or proportions correspond by the plan of their skeletons.
 */
#ifndef ORB_SAMPLES_POSED_H
#define ORB_SAMPLES_POSED_H

#include "sample.h"

/* Limbs. R and L: right and left; forelegs (F) and hind legs (H) have upper and lower bones and a foot, hind legs also
 * a cannon bone. */
typedef enum posed_limb {
  LIMB_NONE, /* eyes, horns: they follow their parent and have no samples */
  TORSO,
  NECK,
  HEAD,
  SNOUT, /* or trunk */
  TAIL,
  EAR_R,
  EAR_L,
  FRU,
  FRL,
  FRF,
  FLU,
  FLL,
  FLF,
  HRU,
  HRL,
  HRC,
  HRF,
  HLU,
  HLL,
  HLC,
  HLF,
  FACE,   /* of heads and busts: rays from its centre */
  LIMB_A, /* legs, wings, fingers or fins of other plans (posed_plans.c) */
  LIMB_B,
  LIMB_C,
  LIMB_D,
  LIMB_E,
  LIMB_F,
  LIMB_G,
  LIMB_H,
  LIMB_COUNT
} posed_limb;

enum { POSED_BONES = 48 };

/* What a primitive is as a bone. */
typedef struct posed_bone {
  posed_limb limb;
  int parent; /* the parent primitive; −1: the root */
} posed_bone;

typedef struct posed_kind {
  const orb_animal *animal;
  const posed_bone *bones; /* one per primitive */
} posed_kind;

const posed_kind *posed_find(const char *name);
extern const posed_kind posed_plans[];
extern const int posed_plan_count;

/* A kind with its proportions: primitives in its rest pose. */
typedef struct posed_rest {
  const posed_kind *kind;
  orb_primitive primitives[POSED_BONES];
  orb_animal animal; /* of these bones, with their box */
} posed_rest;

/* variant: "" as the table has it, "slim" or "stout". */
void posed_proportion(const posed_kind *kind, const char *variant, posed_rest *out);
/* Moves the vertices of a body at rest into a pose. */
void posed_skin(const posed_rest *rest, const char *pose, orb_sample *mesh);

/* Polygonises a body at rest; seed chooses the grid, the method and the number of triangles. */
void posed_polygonise(const posed_rest *rest, unsigned seed, orb_sample *out);

typedef struct posed_place {
  int triangle; /* −1: the body lacks the sample */
  double at[3];
} posed_place;

int posed_sample_count(void);
const char *posed_sample_part(int sample);
/* The place of each sample on a body at rest. */
void posed_find_places(const posed_rest *rest, const orb_sample *mesh, posed_place *out);

/* A number from 0 up to limit − 1. */
unsigned posed_random(unsigned *state, unsigned limit);

#endif
