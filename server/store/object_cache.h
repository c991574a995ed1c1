/* Keeps a folder of copies below a number of bytes: it deletes the least recently used copies. Any thread. */
#ifndef ORB_STORE_OBJECT_CACHE_H
#define ORB_STORE_OBJECT_CACHE_H

#include <stdint.h>

typedef struct object_cache object_cache;

/* folder: has folders of folders of files. NULL: out of memory. */
object_cache *object_cache_open(const char *folder, uint64_t most);
void object_cache_close(object_cache *cache);
/* Notes that a file was used now. Call it after you read the file through a descriptor or put it there. */
void object_cache_used(int fd);
/* Deletes files if they exceed that number of bytes. Call it after you put a file there. */
void object_cache_grew(object_cache *cache, uint64_t bytes);

#endif
