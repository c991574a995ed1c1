/* The error record of a context: how core sets it. Callers read it with orb_context_error(). */
#ifndef ORB_BASE_ERROR_H
#define ORB_BASE_ERROR_H

#include "base/printf.h"
#include "orbmorph/context.h"

/* Sets a new error record (without facts) and returns status. Any thread: in a parallel loop the first failure wins,
 * until orb_error_clear(). */
orb_status orb_fail(orb_context *ctx, orb_status status, const char *format, ...) ORB_PRINTF(3, 4);

/* The record, to add facts to it after orb_fail(). */
orb_error *orb_context_error_edit(orb_context *ctx);
void orb_error_clear(orb_context *ctx);

/* Clears a record: counts become 0, and numbers that need not apply become −1. */
void orb_error_reset(orb_error *error);

#endif
