/* Keeps a folder of copies below a number of bytes: what was used longest ago is deleted. Any thread. */
#ifndef ORB_STORE_OBJECT_CACHE_H
#define ORB_STORE_OBJECT_CACHE_H

#include <stdint.h>

typedef struct object_cache object_cache;

/* folder: of folders of folders of files. NULL: out of memory. */
object_cache *object_cache_open(const char *folder, uint64_t most);
void object_cache_close(object_cache *cache);
/* To be called after a file was read through a descriptor, or put there: it was used now. */
void object_cache_used(int fd);
/* To be called after a file was put there. Deletes files if they are too many now. */
void object_cache_grew(object_cache *cache, uint64_t bytes);

#endif
