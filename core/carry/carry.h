/* Copies what shapes have besides a surface to the asset. The caller calls orb_carrier_open(), writes the asset with
 * the carrier's splits and targets, and calls orb_carrier_add(), which adds the rest. */
#ifndef ORB_CARRY_CARRY_H
#define ORB_CARRY_CARRY_H

#include "carry/skin.h"
#include "orbmorph/asset.h"
#include "transfer/wedge.h"

typedef struct orb_carry_job {
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shapes;
  const orb_align_shape *given; /* before the alignment */
  const orb_shape_file *files;
  const char *const *names; /* of the shapes */
  const orb_carry *carries;
  int32_t carry_count;
  orb_fit fit;
  int is_document; /* the asset is the document of the first shape, and has all of it */
} orb_carry_job;

/* A set of colours or texture coordinates. */
typedef struct orb_carried_set {
  int32_t carry;
  orb_wedges wedges;
} orb_carried_set;

typedef struct orb_carrier {
  orb_carry_job job;
  double *moved; /* 16 per shape, see orb_asset_transforms() */
  int32_t set_count, set_capacity;
  orb_carried_set *sets;
  const int32_t **splits; /* set_count: see orb_asset_options */
  int32_t skin_carry;     /* −1: no skin */
  orb_carried_skin skin;
  int32_t target_count;
  orb_asset_target *targets; /* see orb_asset_options */
  int32_t *target_carry;     /* target_count: the carry of each */
  int32_t texture_count;     /* of the carries */
} orb_carrier;

/* Reads what is to be carried. ORB_E_BAD_OPTION: a shape does not have it, or the request contradicts itself; the error
 * names the shape. Free also after an error. */
ORB_MUST_CHECK orb_status orb_carrier_open(orb_context *ctx, const orb_carry_job *job, orb_carrier *out);
void orb_carrier_free(orb_context *ctx, orb_carrier *carrier);

/* Replaces the GLB by one that has all that is carried. vertices: the supermesh vertices of its vertex_count vertices,
 * −1: none. *list (freed by the caller, after an error too) and *count: what was carried. */
ORB_MUST_CHECK orb_status orb_carrier_add(orb_context *ctx, const orb_carrier *carrier, const int32_t *vertices,
                                          int32_t vertex_count, orb_buffer *asset, orb_carried **list, int32_t *count);

/* Whether orb_carrier_add() changes more of the asset than its splits and targets, so that it has no profiles. */
int orb_carrier_edits(const orb_carrier *carrier);

/* Removes what was carried from the list of what the asset lacks, and adds what changed on the way. */
ORB_MUST_CHECK orb_status orb_carried_settle(orb_context *ctx, const orb_carried *carried, int32_t count,
                                             orb_dropped **dropped, int32_t *dropped_count);

#endif
