/* What is to be carried, checked: before the work by orb_carry_check(), and by orb_carrier_open() itself. */
#ifndef ORB_CARRY_CHECK_H
#define ORB_CARRY_CHECK_H

#include "orbmorph/align.h"
#include "orbmorph/asset.h"
#include "orbmorph/carry.h"

typedef struct orb_carry_wish {
  const orb_align_shape *given; /* shape_count, as the files; before the alignment */
  const orb_shape_file *files;
  int32_t shape_count;
  const orb_carry *carries;
  int32_t carry_count;
  /* The asset is the document of the first shape; NULL: it is not. Before repairs. */
  const orb_mesh *document;
  const unsigned char *document_bytes;
  size_t document_size;
} orb_carry_wish;

/* Whether the entries fit together. ORB_E_BAD_OPTION. */
ORB_MUST_CHECK orb_status orb_carry_entries(orb_context *ctx, const orb_carry *carries, int32_t count,
                                            int32_t shape_count);

/* Whether the files have what the entries name, in a form that can be carried: what orb_carrier_open() and
 * orb_carrier_add() would refuse, without a supermesh. The error names shape and entry. */
ORB_MUST_CHECK orb_status orb_carry_check(orb_context *ctx, const orb_carry_wish *wish);

/* The refusal of an entry whose shape does not have it. */
orb_status orb_carry_refuse(orb_context *ctx, const orb_carry *carries, int32_t number);

/* Adds to the error of a failed call which shape and entry it is about, where `status` says that a file or the request
 * is at fault. Returns status. */
orb_status orb_carry_blame(orb_context *ctx, orb_status status, int32_t shape, int32_t number);

#endif
