/* The readers: for each format a detector and a reader, defined in the file of its name and listed in the table of
 * read.c. Both get at least one byte. A reader fills an orb_build (build.h) and ends with orb_build_finish(). */
#ifndef ORB_FORMAT_READERS_H
#define ORB_FORMAT_READERS_H

#include "format/build.h"

/* How sure a detector is that bytes are of its format. The surest detector wins; of equally sure ones, the first in the
 * table. */
typedef enum orb_certainty {
  ORB_NO,
  ORB_POSSIBLE, /* nothing speaks against it */
  ORB_LIKELY,   /* the first words are those of the format */
  ORB_SURE      /* a signature, or counts that agree with the size */
} orb_certainty;

#ifdef __cplusplus
extern "C" {
#endif

orb_certainty orb_glb_is(const unsigned char *bytes, size_t size);
orb_certainty orb_gltf_is(const unsigned char *bytes, size_t size);
orb_certainty orb_obj_is(const unsigned char *bytes, size_t size);
orb_certainty orb_off_is(const unsigned char *bytes, size_t size);
orb_certainty orb_ply_is(const unsigned char *bytes, size_t size);
orb_certainty orb_stl_is(const unsigned char *bytes, size_t size);

ORB_MUST_CHECK orb_status orb_glb_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_gltf_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_obj_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_off_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_ply_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_stl_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);

#ifdef __cplusplus
}
#endif
#endif
