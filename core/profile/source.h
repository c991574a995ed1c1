/* A stored asset, taken apart. */
#ifndef ORB_PROFILE_SOURCE_H
#define ORB_PROFILE_SOURCE_H

#include <cjson/cJSON.h>

#include "orbmorph/context.h"

typedef struct orb_source_accessor {
  const unsigned char *bytes;
  int32_t view, count, components, component_type;
  int32_t stride; /* bytes from one element to the next */
} orb_source_accessor;

/* A view: the bytes, and the accessor that alone uses it. */
typedef struct orb_source_view {
  const unsigned char *bytes;
  size_t size;
  int32_t accessor; /* −1: an image */
} orb_source_view;

typedef struct orb_source {
  cJSON *document;
  int32_t accessor_count, view_count;
  orb_source_accessor *accessors;
  orb_source_view *views;
} orb_source;

/* Refers to the bytes. Every accessor lies within them. ORB_E_CORRUPT: orbmorph did not write it; ORB_E_NO_MEMORY. Free
 * it with orb_source_close(), also after an error. */
ORB_MUST_CHECK orb_status orb_source_open(orb_context *ctx, const unsigned char *bytes, size_t size, orb_source *out);
void orb_source_close(orb_context *ctx, orb_source *source);

/* The number of an accessor in an object such as `attributes`; −1: none. */
int32_t orb_source_number(const cJSON *object, const char *name);
/* Whether it is an accessor of float32 vectors with this many components and elements. */
int orb_source_is_floats(const orb_source *source, int32_t accessor, int32_t components, int32_t count);
/* Copies the elements; element i becomes order[i] (order NULL: i). */
void orb_source_floats(const orb_source *source, int32_t accessor, const uint32_t *order, float *out);
/* ORB_E_CORRUPT with a message. */
orb_status orb_source_corrupt(orb_context *ctx);

#endif
