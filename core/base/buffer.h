/* Growing buffers beyond orb_buffer_append(). */
#ifndef ORB_BASE_BUFFER_H
#define ORB_BASE_BUFFER_H

#include "base/printf.h"
#include "orbmorph/context.h"

ORB_MUST_CHECK orb_status orb_buffer_printf(orb_context *ctx, orb_buffer *buffer, const char *format, ...)
    ORB_PRINTF(3, 4);

#endif
