/* The studio's files, compiled into the daemon.
 *
 * client/web/build.sh builds client/web/dist; CMake embeds its files (server/studio/embed.cmake). Paths are URL paths:
 * "/" is dist/index.html, "/assets/x.js" is dist/assets/x.js. A daemon built without the studio serves a page at "/"
 * that says how to build it. All responses with these files carry ORB_STUDIO_CSP as Content-Security-Policy. */
#ifndef ORB_STUDIO_H
#define ORB_STUDIO_H

#include "studio/file.h"

#define ORB_STUDIO_CSP                                                                                  \
  "default-src 'self'; img-src 'self' blob: data:; worker-src 'self' blob:; connect-src 'self' blob:; " \
  "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"

/* The file at a path, or NULL. */
const orb_studio_file *orb_studio_find(const char *path);

#endif
