/* The API document, its reader and the problem pages, compiled in by server/pages.cmake. http/pages.c serves them. */
#ifndef ORB_PAGES_H
#define ORB_PAGES_H

#include <stddef.h>

typedef struct page {
  const char *path, *mime;
  const unsigned char *bytes;
  size_t size;
} page;

extern const page pages[]; /* ends with a NULL path */

#endif
