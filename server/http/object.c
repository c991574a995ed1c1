/* Sending stored objects, with conditions, ranges and sendfile. A request for several ranges gets the whole file, as
 * RFC 9110 section 14.2 allows. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "http/disposition.h"
#include "http/http.h"
#include "log.h"
#include "store/object_removal.h"
#include "store/verify.h"

enum { YEAR_S = 31536000 };
#define YEAR_LONG ", max-age=31536000, immutable"

static void add_headers(request *r, const char *mime, const char *disposition, int varies) {
  reply_header(r, "ETag", r->etag);
  if (varies && (!r->coded || r->status == 304)) {
    reply_header(r, "Vary", "Accept-Encoding");
  }
  if (r->signer) { /* anyone with the URL may read it until it expires */
    char control[64];
    int64_t left = r->expires - (int64_t)time(NULL);
    snprintf(control, sizeof control, "public, max-age=%lld",
             (long long)(left < 0        ? 0
                         : left < YEAR_S ? left
                                         : YEAR_S));
    reply_header(r, "Cache-Control", control);
  } else { /* a shared cache must not keep what only one token, or a check in front of the service, lets through */
    int shared = !r->caller && strcmp(r->srv->options->auth, "off") != 0;
    reply_header(r, "Cache-Control", shared ? "public" YEAR_LONG : "private" YEAR_LONG);
  }
  reply_header(r, "Accept-Ranges", "bytes");
  if (r->status != 304) {
    if (!r->coded) {
      reply_header(r, "Content-Type", mime);
    }
    reply_header(r, "Content-Disposition", disposition);
  }
}

static void free_part(request *r, void *bytes) {
  free(bytes);
  request_holds(r, &r->answer_bytes, 0);
}

/* The size of a part for which there is no room now. */
#define NO_ROOM SIZE_MAX

/* Reads a part of an object into memory; NULL on failure, if it is larger than `most`, or if there is no room for it:
 * *size is NO_ROOM then. For free_part(). */
static void *read_part(request *r, object_kind kind, const char *id, object_part part, size_t most, size_t *size) {
  int fd;
  uint64_t whole;
  *size = 0;
  if (objects_read(r->srv->store, kind, id, &fd, &whole) != STORE_OK) {
    return NULL;
  }
  uint64_t wanted = part.length ? part.length : whole;
  const int is_wanted = wanted >= ENCODE_LEAST && wanted <= most;
  if (is_wanted && !request_holds(r, &r->answer_bytes, (int64_t)wanted)) {
    close(fd);
    *size = NO_ROOM;
    return NULL;
  }
  char *bytes = is_wanted ? malloc((size_t)wanted) : NULL;
  for (ssize_t n = 1; bytes && n > 0 && *size<wanted; *size += n> 0 ? (size_t)n : 0) {
    n = pread(fd, bytes + *size, (size_t)wanted - *size, (off_t)(part.start + *size));
  }
  close(fd);
  if (*size < wanted) {
    free_part(r, bytes);
    bytes = NULL;
  }
  return bytes;
}

/* Sending an asset of this size from the cache takes two system calls, from its file at least eight. Larger ones would
 * leave room for few in the cache, and for them the calls weigh little. */
enum { MEMORY_MOST = 4 << 20 };

/* Takes a small asset from memory, and reads it there if it is not. 0: only a task may do that. */
static int choose_memory(request *r, object_kind kind, const char *id, const char *key) {
  size_t size;
  if ((kind != OBJECT_ASSET && kind != OBJECT_QUANTIZED) || r->srv->options->encoded_bytes == 0 ||
      header_of(r, "Range")) {
    return 1;
  }
  const encoded *found = encoded_find(r->srv->encoded, key, CODING_NONE);
  if (!found && r->phase != PHASE_AWAY) {
    return 0;
  }
  if (!found) {
    void *bytes = read_part(r, kind, id, (object_part){0}, MEMORY_MOST, &size);
    found = size == NO_ROOM ? NULL : encoded_make(r->srv->encoded, key, CODING_NONE, bytes, size);
    free_part(r, bytes);
  }
  if (found && found->bytes) {
    r->encoded = found;
  } else {
    encoded_release(found);
  }
  return 1;
}

/* The name of an object in the cache of encoded answers. A known asset is sent in 40 µs, so neither this nor its
 * headers go through printf(), which takes 0.3 µs a call. */
static void key_of(const request *r, object_kind kind, const char *id, const char *etag, char out[96]) {
  const char form[] = {(char)('a' + kind), (char)('0' + r->shape), ' ', 0}; /* shape: −1 to 99 */
  stpcpy(stpncpy(stpcpy(stpcpy(out, "object "), form), id, 16), etag);
}

/* Chooses the form of an object, and compresses it if that has not been done. 0: only a task may do that. */
static int choose_form(request *r, object_kind kind, const char *id, object_part part, const char *etag) {
  char key[96];
  size_t size;
  key_of(r, kind, id, etag, key);
  if (!reply_choose(r, key, etag, NULL, ENCODE_LEAST)) {
    if (r->phase != PHASE_AWAY) {
      return 0;
    }
    void *bytes = read_part(r, kind, id, part, ENCODE_MOST, &size);
    if (bytes) {
      reply_choose(r, key, etag, bytes, size);
    }
    free_part(r, bytes);
  }
  return r->encoded || choose_memory(r, kind, id, key);
}

int object_is_ready(request *r, object_kind kind, const char *sha) {
  if (!verify_is_done(r->srv->store, kind, r->id)) {
    if (r->phase != PHASE_AWAY) {
      return 0;
    }
    store_result result = verify_once(r->srv->store, kind, r->id, sha);
    r->is_unverified = result != STORE_OK && result != STORE_NOT_FOUND;
    r->is_away = result == STORE_AWAY;
  }
  return 1;
}

int reply_part(request *r, object_kind kind, const char *id, object_part part, const char *sha, const char *mime,
               const char *disposition) {
  char etag[40], content_range[80];
  int fd, compresses = kind == OBJECT_ASSET || kind == OBJECT_QUANTIZED || kind == OBJECT_SPHERE ||
                       r->route->id == ROUTE_SUPERMESH_SPHERE;
  uint64_t size, first = 0, length;
  if (r->is_unverified) {
    reply_store(r, r->is_away ? STORE_AWAY : STORE_ERROR);
    return 1;
  }
  stpcpy(stpncpy(stpcpy(etag, "\""), sha, 32), "\"");
  stpcpy(r->etag, etag);
  if (compresses && !choose_form(r, kind, id, part, etag)) {
    return 0;
  }
  if (reply_conditions(r, r->etag)) {
    if (r->status == 304) {
      add_headers(r, mime, disposition, compresses);
    }
    return 1;
  }
  if (r->encoded) {
    if (r->coded) {
      reply_encoded(r, 200, mime);
    } else {
      reply_memory(r, 200);
    }
    add_headers(r, mime, disposition, 1);
    return 1;
  }
  store_result found = objects_read(r->srv->store, kind, id, &fd, &size);
  if (found != STORE_OK) {
    reply_store(r, found);
    return 1;
  }
  size = part.length ? part.length : size;
  length = size;
  const char *if_range = header_of(r, "If-Range");
  int usable = !r->head && (!if_range || strcmp(if_range, etag) == 0);
  int ranged = usable ? parse_range(header_of(r, "Range"), size, &first, &length) : 0;
  if (ranged < 0) {
    close(fd);
    reply_refuse(r, "range-not-satisfiable", "The file has only %llu bytes; request a range within them.",
                 (unsigned long long)size);
    snprintf(content_range, sizeof content_range, "bytes */%llu", (unsigned long long)size);
    reply_header(r, "Content-Range", content_range);
    return 1;
  }
  struct MHD_Response *response = MHD_create_response_from_fd_at_offset64(length, fd, part.start + first);
  if (!response) {
    close(fd);
  }
  r->response = response;
  r->status = ranged ? 206 : 200;
  r->sends = (int64_t)length;
  r->phase = PHASE_SEND;
  if (ranged) {
    snprintf(content_range, sizeof content_range, "bytes %llu-%llu/%llu", (unsigned long long)first,
             (unsigned long long)(first + length - 1), (unsigned long long)size);
    reply_header(r, "Content-Range", content_range);
  }
  add_headers(r, mime, disposition, compresses);
  return 1;
}

int reply_object(request *r, object_kind kind, const char *id, const char *sha, const char *mime,
                 const char *disposition) {
  return reply_part(r, kind, id, (object_part){0}, sha, mime, disposition);
}

static const char *disposition_of(const cached *entry) {
  const char *known = cache_header(entry);
  if (!known) {
    char name[DISPOSITION_NAME], value[DISPOSITION_SIZE];
    disposition_name(entry->row.json, name);
    disposition_write(name, value);
    known = cache_keep_header(entry, value);
  }
  return known ? known : "inline";
}

enum { LINK_SECONDS = 900 }; /* a client that got the URL has begun within that time */

/* Sends the client to S3. 0: it is to get the bytes. */
static int reply_redirect(request *r, object_kind kind) {
  char url[BUCKET_LINK];
  if (strcmp(r->srv->options->assets, "redirect") != 0 || r->head ||
      !objects_link(r->srv->store, kind, r->id, LINK_SECONDS, "response-content-type=model%2Fgltf-binary", url)) {
    return 0;
  }
  reply_empty(r, 307);
  reply_header(r, "Location", url);
  reply_header(r, "Cache-Control", "no-store");
  return 1;
}

int reply_stored_asset(request *r, const cached *entry) {
  char link[128];
  int stored = r->profile - 1; /* −1: the asset itself */
  const char *sha = stored < 0 ? entry->row.sha : entry->row.profiles[stored];
  memcpy(r->id, entry->row.id, sizeof r->id);
  object_kind kind = stored < 0 ? OBJECT_ASSET : object_of_profile(stored);
  int done = sha[0] && reply_redirect(r, kind);
  done = done || (sha[0] && object_is_ready(r, kind, sha) &&
                  reply_object(r, kind, r->id, sha, "model/gltf-binary", disposition_of(entry)));
  if (done && r->route->id == ROUTE_MORPH && r->status < 400) {
    stpcpy(stpcpy(stpcpy(link, "</v1/supermeshes/"), r->id), ">; rel=\"describedby\"");
    reply_header(r, "Link", link);
  }
  cache_release(r->srv->descriptions, entry);
  return done;
}

resource_kind object_owner(const request *r) {
  return r->route->id == ROUTE_MESH_FILE          ? RESOURCE_MESH
         : r->route->id == ROUTE_EMBEDDING_SPHERE ? RESOURCE_EMBEDDING
                                                  : RESOURCE_SUPERMESH;
}

/* Supermeshes of older engines may have no places and no spheres. */
static int may_lack(const request *r) {
  return r->route->id == ROUTE_SUPERMESH_PLACES || r->route->id == ROUTE_SUPERMESH_SPHERE;
}

void reply_lost(request *r) {
  resource row = {0};
  objects_settle(r->srv->store);
  if (!may_lack(r) && catalogue_get(r->srv->cat, object_owner(r), r->id, &row) == STORE_OK) {
    log_error("the file of %s %s is lost: --check-data lists all damage", r->route->path, r->id);
    reply_refuse(r, "internal", "The server has lost this file. DELETE the resource, then upload or request it again.");
  } else {
    reply_store(r, STORE_NOT_FOUND);
  }
  resource_free(&row);
}
