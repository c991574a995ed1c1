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
  if (!file && !own) {
    reply_refuse(r, "not-found", "Nothing exists at this path; /openapi.json lists all routes.");
    return;
  }
  const char *mime = file ? file->type : own->mime, *key = file ? file->path : own->path;
  const unsigned char *bytes = file ? file->data : own->bytes;
  size_t size = file ? file->size : own->size;
  int is_text = strncmp(mime, "text/", 5) == 0 || strncmp(mime, "application/json", 16) == 0 ||
                strncmp(mime, "image/svg", 9) == 0 || strncmp(mime, "model/", 6) == 0;
  reply_choose(r, key, file ? file->etag : "", bytes, is_text ? size : 0);
  if (file && none_match && parse_tag_matches(none_match, r->etag)) {
    reply_empty(r, 304);
  } else if (r->encoded) {
    reply_encoded(r, 200, mime);
  } else {
    reply_bytes(r, 200, mime, bytes, size);
  }
  if (is_text && (r->status == 304 || !r->coded)) {
    reply_header(r, "Vary", "Accept-Encoding");
  }
  if (file) {
    reply_header(r, "ETag", r->etag);
  }
  reply_header(r, "Content-Security-Policy", ORB_STUDIO_CSP);
  reply_header(r, "Cache-Control", file ? file->cache_control : "no-cache");
}
