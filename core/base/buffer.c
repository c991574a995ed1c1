/* Growing buffers of bytes. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/buffer.h"
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "orbmorph/context.h"

static orb_status buffer_reserve(orb_context *ctx, orb_buffer *buffer, size_t more) {
  size_t max = buffer->max ? buffer->max : (size_t)UINT32_MAX;
  if (more > max || buffer->size > max - more) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "A result would be larger than %zu bytes.", max);
  }
  size_t need = buffer->size + more;
  if (need <= buffer->capacity) {
    return ORB_OK;
  }
  size_t capacity = buffer->capacity < 4096 ? 4096 : buffer->capacity + buffer->capacity / 2;
  if (capacity < need) {
    capacity = need;
  }
  if (capacity > max) {
    capacity = max;
  }
  unsigned char *data = orb_realloc(ctx, buffer->data, capacity, 1);
  if (!data) {
    return ORB_E_NO_MEMORY;
  }
  buffer->data = data;
  buffer->capacity = capacity;
  return ORB_OK;
}

orb_status orb_buffer_append(orb_context *ctx, orb_buffer *buffer, const void *bytes, size_t size) {
  ORB_TRY(buffer_reserve(ctx, buffer, size));
  if (size) {
    memcpy(buffer->data + buffer->size, bytes, size);
  }
  buffer->size += size;
  return ORB_OK;
}

orb_status orb_buffer_printf(orb_context *ctx, orb_buffer *buffer, const char *format, ...) {
  va_list args, again;
  va_start(args, format);
  va_copy(again, args);
  int length = vsnprintf(NULL, 0, format, args);
  va_end(args);
  orb_status status = ORB_E_INTERNAL;
  if (length >= 0) {
    status = buffer_reserve(ctx, buffer, (size_t)length + 1);
    if (status == ORB_OK) {
      vsnprintf((char *)buffer->data + buffer->size, (size_t)length + 1, format, again);
      buffer->size += (size_t)length;
    }
  }
  va_end(again);
  return status;
}

void orb_buffer_free(orb_context *ctx, orb_buffer *buffer) {
  orb_free(ctx, buffer->data);
  buffer->data = NULL;
  buffer->size = buffer->capacity = 0;
}
