/* The new bytes of an accessor. */
#ifndef ORB_PROFILE_STREAM_H
#define ORB_PROFILE_STREAM_H

#include "orbmorph/context.h"

/* How EXT_meshopt_compression turns stored elements into those that a renderer sees. */
typedef enum orb_filter { ORB_FILTER_NONE = 0, ORB_FILTER_OCTAHEDRAL, ORB_FILTER_EXPONENTIAL } orb_filter;

typedef struct orb_stream {
  unsigned char *bytes;  /* count × stride, as a renderer sees them; NULL: the accessor stays as it is */
  unsigned char *stored; /* the same before the filter; NULL without a filter */
  int32_t count;         /* elements */
  int32_t stride;        /* bytes from one to the next; of vertices a multiple of 4, the rest is 0 */
  int32_t components, component_type;
  int normalized, triangles; /* triangles: indices */
  orb_filter filter;
  int bounded; /* min and max are given */
  double min[4], max[4];
} orb_stream;

/* Bytes for all elements, zeroed; stored: also those before a filter. ORB_E_NO_MEMORY. */
ORB_MUST_CHECK orb_status orb_stream_allocate(orb_context *ctx, orb_stream *stream, int stored);
void orb_stream_free(orb_context *ctx, orb_stream *stream);

#endif
