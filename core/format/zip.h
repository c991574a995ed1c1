/* ZIP archives: their directory, and files out of it, stored or deflated. Nothing is allocated but what inflating
 * takes; entries point into the archive. */
#ifndef ORB_FORMAT_ZIP_H
#define ORB_FORMAT_ZIP_H

#include "orbmorph/context.h"

typedef struct orb_zip {
  const unsigned char *bytes, *directory;
  size_t size, directory_size;
} orb_zip;

typedef struct orb_zip_entry {
  const unsigned char *name; /* not terminated */
  size_t name_length, local, packed, size;
  uint32_t crc;
  int method, is_encrypted;
} orb_zip_entry;

/* Finds the directory. Returns 0 if the bytes are not an archive or lack its end. O(1): the directory is not read. */
int orb_zip_open(const unsigned char *bytes, size_t size, orb_zip *out);

/* The entry at *at (0: the first), and *at moves to the next. Returns 0 at the end, and where the directory is damaged.
 */
int orb_zip_next(const orb_zip *zip, size_t *at, orb_zip_entry *out);

/* Gets a piece of a file; the last one, perhaps empty, has is_last. */
typedef orb_status (*orb_zip_sink)(void *user, const unsigned char *bytes, size_t size, int is_last);

/* Hands the bytes of a file to the sink, piece by piece, and checks their sum. *allowance: how many bytes files of this
 * archive may still unpack to; ORB_E_TOO_LARGE beyond. O(packed + bytes). */
ORB_MUST_CHECK orb_status orb_zip_read(orb_context *ctx, const orb_zip *zip, const orb_zip_entry *entry,
                                       uint64_t *allowance, orb_zip_sink sink, void *user);

#endif
