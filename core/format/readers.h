/* The readers: for each format a detector and a reader, defined in the file of its name and listed in
 * orbmorph/formats.h. Both get at least one byte. A reader fills an orb_build (build.h) and ends with
 * orb_build_finish() (build_finish.h). */
#ifndef ORB_FORMAT_READERS_H
#define ORB_FORMAT_READERS_H

#include "format/build_finish.h"

/* How sure a detector is that bytes are of its format. The surest detector wins; of equally sure ones, the first in
 * that list. */
typedef enum orb_certainty {
  ORB_NO,
  ORB_POSSIBLE, /* nothing speaks against it */
  ORB_LIKELY,   /* the first words are those of the format */
  ORB_SURE      /* a signature, or counts that agree with the size */
} orb_certainty;

#ifdef __cplusplus
extern "C" {
#endif

/* orb_obj_is() and orb_obj_read(), and so on. */
#define ORB_FORMAT_DECLARATION(id, value, function, name)                                                    \
  orb_certainty orb_##function##_is(const unsigned char *bytes, size_t size);                                \
  ORB_MUST_CHECK orb_status orb_##function##_read(orb_context *ctx, const unsigned char *bytes, size_t size, \
                                                  orb_mesh *out);
ORB_FORMATS(ORB_FORMAT_DECLARATION)
#undef ORB_FORMAT_DECLARATION

#ifdef __cplusplus
}
#endif
#endif
