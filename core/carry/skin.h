/* The skin of a shape on the supermesh. */
#ifndef ORB_CARRY_SKIN_H
#define ORB_CARRY_SKIN_H

#include "carry/source.h"

typedef struct orb_carried_skin {
  orb_given_skin given;  /* without joints and weights */
  uint16_t (*joints)[4]; /* a supermesh vertex; its heaviest first; 0 where the weight is 0 */
  float (*weights)[4];   /* their sum is 1 exactly */
} orb_carried_skin;

/* Blends the joints and weights of the shape's file at the places of the supermesh's vertices, and keeps the four
 * heaviest. ORB_E_BAD_OPTION with a message: the file has several skins. given.skin −1: it has none. Free also after an
 * error. */
ORB_MUST_CHECK orb_status orb_carry_skin(orb_context *ctx, const orb_carry_source *source, orb_carried_skin *out);
void orb_carried_skin_free(orb_context *ctx, orb_carried_skin *skin);

/* Keeps the four heaviest of `count` joints and weights; the kept weights become float32 with the exact sum 1. Weights
 * that are float32 with that sum already stay as they are. Without any weight: joint 0. Sorts the lists. */
void orb_four_heaviest(int32_t *joints, double *weights, int32_t count, uint16_t joint[4], float weight[4]);

#endif
