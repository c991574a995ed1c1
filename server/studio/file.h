/* A file of the studio as the daemon serves it. */
#ifndef ORB_STUDIO_FILE_H
#define ORB_STUDIO_FILE_H

#include <stddef.h>

typedef struct orb_studio_file {
  const char *path;          /* URL path, without the query */
  const char *type;          /* Content-Type */
  const char *etag;          /* strong, with quotes */
  const char *cache_control; /* immutable under /assets/, whose names contain a hash of the content; else no-cache */
  const unsigned char *data; /* static, never freed */
  size_t size;
} orb_studio_file;

/* The generated table, sorted by path; only studio.c reads it. */
extern const orb_studio_file orb_studio_table[];
extern const size_t orb_studio_count;

#endif
