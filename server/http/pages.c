/* Compiled-in files: the studio, the API document and its reader, a page for each problem type. */
#include <string.h>

#include "http/http.h"
#include "pages.h"
#include "studio/studio.h"

static const page *find_page(const char *path) {
  for (const page *p = pages; p->path; p++) {
    if (strcmp(p->path, path) == 0) {
      return p;
    }
  }
  return NULL;
}

int is_page(const char *path) {
  return orb_studio_find(path) || find_page(path);
}

void handle_page(request *r, const char *path) {
  const orb_studio_file *file = orb_studio_find(path);
  const page *own = file ? NULL : find_page(path);
  const char *none_match = header_of(r, "If-None-Match");
  if (file && none_match && parse_tag_matches(none_match, file->etag)) {
    reply_empty(r, 304);
  } else if (file) {
    reply_bytes(r, 200, file->type, file->data, file->size);
  } else if (own) {
    reply_bytes(r, 200, own->mime, own->bytes, own->size);
  } else {
    reply_refuse(r, "not-found", "Nothing exists at this path; /openapi.json lists all routes.");
    return;
  }
  if (file) {
    reply_header(r, "ETag", file->etag);
  }
  reply_header(r, "Content-Security-Policy", ORB_STUDIO_CSP);
  reply_header(r, "Cache-Control", file ? file->cache_control : "no-cache");
}
