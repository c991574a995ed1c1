/* Kept alignments: an object (the bytes of orb_alignment_write()) and a row with its hash, named by all that the
 * alignment depends on (api_alignment_id()). A request that differs from an earlier one only in remeshing or in the
 * asset reuses its alignment; one that is gone or damaged is computed again. A request may also name one to begin with
 * ("align.start"), and fails if that is gone. They are evicted like embeddings. */
#ifndef ORB_STORE_ALIGNMENTS_H
#define ORB_STORE_ALIGNMENTS_H

#include "orbmorph/kept.h"
#include "store/catalogue.h"

/* 1 with the alignment of this row, verified against its hash and certified again; 0: it cannot be used. Blocks. cat:
 * NULL in a process of its own, here and below: the daemon notes the use and writes the row. */
int alignments_get(catalogue *cat, const objects *store, orb_context *ctx, const resource *row,
                   const orb_align_shape *shapes, int32_t shape_count, orb_alignment *out);

/* Stores an alignment that was written to a temporary file, and its row, which counts for the tenant. STORE_FULL: the
 * disk is nearly full. Blocks for a commit. The caller calls objects_abandon(). */
store_result alignments_publish(catalogue *cat, objects *store, const char *id, const char *tenant, object_temp *temp);

/* Keeps an alignment of these shapes, unless the disk is nearly full. Failures are logged; their only consequence is
 * that a later request aligns again. Blocks for a commit. */
void alignments_put(catalogue *cat, objects *store, orb_context *ctx, const char *id, const char *tenant,
                    const orb_align_shape *shapes, const orb_alignment *alignment);

#endif
