/* Writes ZIP archives for tests. */
#ifndef SUPPORT_ZIP_H
#define SUPPORT_ZIP_H

#include <stddef.h>
#include <stdint.h>

typedef struct archive {
  unsigned char *bytes, *directory;
  size_t size, room, directory_size, directory_room;
  int entries, is_wide; /* is_wide: sizes and offsets are those of ZIP64 */
} archive;

/* Adds a file, deflated or stored. */
void archive_add(archive *a, const char *name, const void *bytes, size_t size, int deflated);
/* Writes the directory; a->bytes and a->size are the archive then. */
void archive_end(archive *a);
void archive_free(archive *a);

#endif
