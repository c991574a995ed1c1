/* The temporary files of meshes that arrive, in uploads and downloads: how much of the disk those of one owner may
 * take.
 *
 * Contract. An owner may have at most as many bytes in them as it leaves free beyond the disk reserve: alone half of
 * what was free, a second one half of the rest, and so on. So however much some send and then stall, others find room.
 * Bytes count from before they are written until their file is stored or deleted. Nobody waits: what does not fit is
 * refused. Any thread may use it; one thread at a time uses a file. Each call takes constant time, and memory grows
 * with the number of owners that have files.
 */
#ifndef ORB_TEMPORARY_H
#define ORB_TEMPORARY_H

#include <stdint.h>

typedef struct temporary temporary;

/* What a file takes. Starts as {.owner = …}; must be given back before it ends. */
typedef struct temporary_file {
  uint64_t owner; /* tenant_hash(), or the hash of an address */
  int64_t bytes;
} temporary_file;

typedef struct temporary_limits {
  int64_t room; /* bytes that are free on the disk beyond its reserve */
  int64_t most; /* bytes that the owner may have in all its files; 0: as many as its share has */
} temporary_limits;

/* The limits on a disk that has so many bytes free. largest: the largest file that the owner's quota allows, of which
 * two can arrive at once; 0: it has no quota. */
temporary_limits temporary_limits_of(uint64_t free_bytes, int64_t reserve, int64_t largest);

/* Whether there is room for so many more bytes of a file. */
typedef enum temporary_room {
  TEMPORARY_FULL,   /* the file alone is too large for the owner's share */
  TEMPORARY_OTHERS, /* others of the owner's files are in the way, or there is no memory to count */
  TEMPORARY_FREE
} temporary_room;

temporary *temporary_create(void); /* NULL: out of memory */
void temporary_destroy(temporary *t);
/* Takes the bytes if the result is TEMPORARY_FREE. */
temporary_room temporary_take(temporary *t, temporary_file *file, int64_t bytes, const temporary_limits *limits);
/* The same, but takes nothing. */
temporary_room temporary_look(temporary *t, const temporary_file *file, int64_t bytes, const temporary_limits *limits);
void temporary_give(temporary *t, temporary_file *file); /* all of its bytes; none is fine */
int64_t temporary_bytes(temporary *t);                   /* of all files */

#endif
