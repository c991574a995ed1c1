/* One reader a format, each in its own file. They fill an orb_build; size is at least 1. */
#ifndef ORB_FORMAT_READERS_H
#define ORB_FORMAT_READERS_H

#include "format/build.h"

ORB_MUST_CHECK orb_status orb_obj_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_off_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_ply_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);
ORB_MUST_CHECK orb_status orb_stl_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out);

/* What the first bytes say. */
int orb_off_is(const unsigned char *bytes, size_t size);
int orb_ply_is(const unsigned char *bytes, size_t size);
int orb_obj_is(const unsigned char *bytes, size_t size);
int orb_stl_is_text(const unsigned char *bytes, size_t size);
int orb_stl_is_exact(const unsigned char *bytes, size_t size);     /* binary, and its count fits its size */
int orb_stl_is_plausible(const unsigned char *bytes, size_t size); /* binary, going by its first facets */

/* Bytes of a UTF-8 byte order mark at the start. */
static inline size_t orb_bom(const unsigned char *bytes, size_t size) {
  return size >= 3 && bytes[0] == 0xef && bytes[1] == 0xbb && bytes[2] == 0xbf ? 3 : 0;
}

#endif
