/* The studio's files, compiled into the daemon.
 *
 * client/web/build.sh builds client/web/dist; CMake embeds its files (server/studio/embed.cmake). Paths are URL paths:
 * "/" is dist/index.html, "/assets/x.js" is dist/assets/x.js. A daemon built without the studio serves a page at "/"
 * that says how to build it. All responses with these files carry ORB_STUDIO_CSP as Content-Security-Policy. */
#ifndef ORB_STUDIO_H
#define ORB_STUDIO_H

#include <stddef.h>

#define ORB_STUDIO_CSP                                                                                  \
  "default-src 'self'; img-src 'self' blob: data:; worker-src 'self' blob:; connect-src 'self' blob:; " \
  "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"

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

/* The file at a path, or NULL. */
const orb_studio_file *orb_studio_find(const char *path);

#endif
