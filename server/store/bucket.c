#include "store/bucket.h"

#include <errno.h>
#include <pthread.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "api/sha256.h"
#include "api/text.h"
#include "log.h"
#include "orbmorph/context.h"
#include "store/s3_keys.h"
#include "wake.h"

enum {
  TRIES =
      4, /* of a request. The pauses between them take 0.7 s on average, longer than the usual interruptions of S3 */
  PROBE_MS = 1000, /* between two checks whether S3 is back */
  READ_TRIES = 3,  /* of an object that arrived with wrong bytes */
  BLOCK = 1 << 18,
  UPLOAD = 1200, /* bytes of the id of an upload in parts, encoded */
};
static const char owner_name[] = "orbmorph-owner";

struct object_bucket {
  s3 *store;
  s3_options options;
  char keys[4096], authorities[4096];
  uint64_t part;
  pthread_mutex_t lock;
  pthread_cond_t wake;
  pthread_t watcher;
  int watches, away, closing;
  int64_t away_at; /* when it was last known to be unreachable, as orb_clock_ms(); 0: never. __atomic */
};

int bucket_hash(int fd, uint64_t from, uint64_t size, char out[65]) {
  unsigned char digest[crypto_hash_sha256_BYTES], *block = malloc(BLOCK);
  crypto_hash_sha256_state state;
  ssize_t n = block ? 1 : -1;
  crypto_hash_sha256_init(&state);
  for (uint64_t done = 0; n > 0 && done < size; done += (uint64_t)n) {
    size_t left = size - done < BLOCK ? (size_t)(size - done) : BLOCK;
    do {
      n = pread(fd, block, left, (off_t)(from + done));
    } while (n < 0 && errno == EINTR);
    if (n > 0) {
      api_sha256_add(&state, block, (size_t)n);
    }
  }
  crypto_hash_sha256_final(&state, digest);
  sodium_bin2hex(out, 65, digest, sizeof digest);
  free(block);
  return n > 0;
}

int bucket_is_away(object_bucket *b) {
  return __atomic_load_n(&b->away, __ATOMIC_ACQUIRE);
}

int bucket_was_away(object_bucket *b, int64_t since) {
  return bucket_is_away(b) || __atomic_load_n(&b->away_at, __ATOMIC_ACQUIRE) >= since;
}

static void set_away(object_bucket *b, int away, const char *why) {
  pthread_mutex_lock(&b->lock);
  int changes = b->away != away;
  if (changes || away) {
    __atomic_store_n(&b->away_at, orb_clock_ms(), __ATOMIC_RELEASE);
  }
  __atomic_store_n(&b->away, away, __ATOMIC_RELEASE);
  if (changes) {
    pthread_cond_signal(&b->wake);
  }
  pthread_mutex_unlock(&b->lock);
  if (changes && away) {
    log_error("S3 is unreachable: bucket %s: %s; requests that need it are answered 503 until it is back",
              b->options.place.bucket, why);
  } else if (changes) {
    log_warn("S3 is back");
  }
}

/* STORE_UNFIT: S3 refuses. */
static store_result meaning(const s3_answer *a) {
  if (a->status >= 200 && a->status < 300) {
    return STORE_OK;
  }
  if (a->status == 404 && !(a->text && strstr(a->text, "NoSuchBucket"))) {
    return STORE_NOT_FOUND;
  }
  if (a->status == 507) {
    return STORE_FULL;
  }
  if (a->status == 0 || a->status == 429 || a->status >= 500) {
    return STORE_AWAY;
  }
  return STORE_UNFIT;
}

/* Sends a request, unless S3 is unreachable. The caller frees answer->text. */
static store_result ask(object_bucket *b, const s3_request *request, s3_answer *answer) {
  memset(answer, 0, sizeof *answer);
  if (bucket_is_away(b)) {
    return STORE_AWAY;
  }
  s3_send(b->store, request, answer);
  if (request->signed_at && answer->status == 403) {
    return STORE_CONFLICT;
  }
  store_result result = meaning(answer);
  if (result == STORE_AWAY || result == STORE_UNFIT) {
    set_away(b, 1, answer->why);
    return STORE_AWAY;
  }
  return result;
}

static store_result ask_only(object_bucket *b, const s3_request *request) {
  s3_answer answer;
  store_result result = ask(b, request, &answer);
  free(answer.text);
  return result;
}

static void probe(object_bucket *b) {
  s3_answer answer;
  s3_keys keys;
  const char *why;
  if (*b->keys && s3_keys_read(b->keys, &keys, &why)) { /* temporary keys may have been replaced */
    s3_use_keys(b->store, &keys);
    sodium_memzero(&keys, sizeof keys);
  }
  const s3_request request = {.method = "GET", .key = owner_name, .to = -1, .tries = 1};
  s3_send(b->store, &request, &answer);
  if (meaning(&answer) == STORE_OK) {
    set_away(b, 0, "");
  }
  free(answer.text);
}

static void *watch(void *user) {
  object_bucket *b = user;
  pthread_mutex_lock(&b->lock);
  while (!b->closing) {
    if (!b->away) {
      pthread_cond_wait(&b->wake, &b->lock);
      continue;
    }
    wake_wait_ms(&b->wake, &b->lock, PROBE_MS);
    if (b->away && !b->closing) {
      pthread_mutex_unlock(&b->lock);
      probe(b);
      pthread_mutex_lock(&b->lock);
    }
  }
  pthread_mutex_unlock(&b->lock);
  return NULL;
}

static store_result read_options(const bucket_options *options, object_bucket *b) {
  const char *why;
  if (!s3_url_read(options->url, &b->options.place, &why)) {
    log_error("objects: %s", why);
    return STORE_UNFIT;
  }
  if (!s3_keys_read(options->keys, &b->options.keys, &why)) {
    log_error("objects in S3 need keys: %s", why);
    return STORE_UNFIT;
  }
  snprintf(b->keys, sizeof b->keys, "%s", options->keys);
  snprintf(b->authorities, sizeof b->authorities, "%s", options->authorities);
  b->options.authorities = b->authorities;
  b->part = (uint64_t)b->options.place.part_mib << 20;
  return STORE_OK;
}

store_result bucket_owner(object_bucket *b, char owner[BUCKET_OWNER + 1]) {
  s3_answer answer;
  const s3_place *p = &b->options.place;
  const s3_request request = {.method = "GET", .key = owner_name, .to = -1, .tries = TRIES};
  s3_send(b->store, &request, &answer);
  store_result result = meaning(&answer);
  owner[0] = 0;
  if (result == STORE_OK && answer.text) {
    snprintf(owner, BUCKET_OWNER + 1, "%s", answer.text);
  } else if (result == STORE_NOT_FOUND) {
    result = STORE_OK;
  } else if (result == STORE_UNFIT && answer.status == 404) {
    log_error("the bucket %s does not exist at %s: create it, or correct --objects", p->bucket, p->host);
  } else if (result == STORE_UNFIT) {
    log_error(
        "S3 at %s refuses the bucket %s: %s. Check the keys, the region, the clock and what the keys may do "
        "(GetObject, "
        "PutObject, DeleteObject, ListBucket)",
        p->host, p->bucket, answer.why);
  } else {
    log_error("S3 at %s does not answer: %s", p->host, answer.why);
  }
  free(answer.text);
  return result;
}

store_result bucket_open(const bucket_options *options, char owner[BUCKET_OWNER + 1], object_bucket **out) {
  object_bucket *b = calloc(1, sizeof *b);
  store_result result = b ? read_options(options, b) : STORE_ERROR;
  if (result == STORE_OK) {
    pthread_mutex_init(&b->lock, NULL);
    wake_init(&b->wake);
    b->store = s3_open(&b->options);
    result = b->store ? bucket_owner(b, owner) : STORE_ERROR;
    b->watches = result == STORE_OK && pthread_create(&b->watcher, NULL, watch, b) == 0;
    if (!b->watches) {
      bucket_close(b);
      return result == STORE_OK ? STORE_ERROR : result;
    }
    *out = b;
    return STORE_OK;
  }
  free(b);
  return result;
}

void bucket_close(object_bucket *b) {
  if (!b) {
    return;
  }
  if (b->watches) {
    pthread_mutex_lock(&b->lock);
    b->closing = 1;
    pthread_cond_signal(&b->wake);
    pthread_mutex_unlock(&b->lock);
    pthread_join(b->watcher, NULL);
  }
  s3_close(b->store);
  pthread_cond_destroy(&b->wake);
  pthread_mutex_destroy(&b->lock);
  sodium_memzero(&b->options.keys, sizeof b->options.keys);
  free(b);
}

static store_result put_text(object_bucket *b, const char *name, const char *text) {
  char sha[65];
  unsigned char digest[crypto_hash_sha256_BYTES];
  crypto_hash_sha256(digest, (const unsigned char *)text, strlen(text));
  sodium_bin2hex(sha, sizeof sha, digest, sizeof digest);
  const s3_request request = {
      .method = "PUT", .key = name, .body = text, .size = strlen(text), .sha = sha, .to = -1, .tries = TRIES};
  return ask_only(b, &request);
}

store_result bucket_claim(object_bucket *b, const char *owner) {
  char there[BUCKET_OWNER + 1];
  store_result result = put_text(b, owner_name, owner);
  if (result == STORE_OK) {
    result = bucket_owner(b, there);
  }
  if (result == STORE_OK && strcmp(there, owner) != 0) {
    log_error("another deployment has just taken the bucket %s: name another bucket or prefix with --objects",
              b->options.place.bucket);
    result = STORE_UNFIT;
  }
  return result;
}

/* The id of an upload in parts that S3 has begun, encoded for a query. */
static store_result read_upload(const s3_answer *answer, char encoded[UPLOAD]) {
  const char *at = answer->text;
  char id[UPLOAD / 3];
  if (at && s3_element(&at, "UploadId", id, sizeof id) && s3_encode(id, encoded, UPLOAD)) {
    return STORE_OK;
  }
  log_error("S3 answered the begin of an upload in parts without an UploadId");
  return STORE_ERROR;
}

/* If this fails too, a lifecycle rule of the bucket removes the parts. */
static void abort_parts(object_bucket *b, const char *name, const char *upload) {
  char query[UPLOAD + 16];
  s3_answer answer;
  snprintf(query, sizeof query, "uploadId=%s", upload);
  const s3_request request = {.method = "DELETE", .key = name, .query = query, .to = -1, .tries = 1};
  s3_send(b->store, &request, &answer);
  free(answer.text);
}

store_result bucket_check_writes(object_bucket *b) {
  const s3_place *p = &b->options.place;
  char upload[UPLOAD];
  s3_answer answer;
  const s3_request begin = {.method = "POST", .key = owner_name, .query = "uploads=", .to = -1, .tries = TRIES};
  s3_send(b->store, &begin, &answer);
  store_result result = meaning(&answer);
  if (result == STORE_OK) {
    result = read_upload(&answer, upload);
  } else if (result == STORE_AWAY) {
    log_error("S3 at %s does not answer: %s", p->host, answer.why);
  } else {
    log_error(
        "S3 at %s refuses to write to the bucket %s: %s. Check what the keys may do (PutObject, DeleteObject, "
        "AbortMultipartUpload)",
        p->host, p->bucket, answer.why);
    result = STORE_UNFIT;
  }
  free(answer.text);
  if (result == STORE_OK) {
    abort_parts(b, owner_name, upload);
  }
  return result;
}

static store_result put_part(object_bucket *b, const char *name, const char *upload, int fd, int number, uint64_t at,
                             uint64_t size, api_text *list) {
  char sha[65], query[UPLOAD + 64];
  s3_answer answer = {0};
  snprintf(query, sizeof query, "partNumber=%d&uploadId=%s", number, upload);
  const s3_request request = {.method = "PUT",
                              .key = name,
                              .query = query,
                              .from = fd,
                              .offset = at,
                              .size = size,
                              .sha = sha,
                              .to = -1,
                              .tries = TRIES};
  store_result result = bucket_hash(fd, at, size, sha) ? ask(b, &request, &answer) : STORE_ERROR;
  if (result == STORE_OK) {
    api_text_printf(list, "<Part><PartNumber>%d</PartNumber><ETag>%s</ETag></Part>", number, answer.tag);
  }
  free(answer.text);
  return result;
}

/* Whether S3 has the object with this hash. */
static int has(object_bucket *b, const char *name, const char *sha) {
  s3_answer answer;
  const s3_request request = {.method = "HEAD", .key = name, .to = -1, .tries = 1};
  s3_send(b->store, &request, &answer);
  int there = meaning(&answer) == STORE_OK && strcmp(answer.meta, sha) == 0;
  free(answer.text);
  return there;
}

/* Asks S3 to join the parts. If the answer is lost, S3 may have joined them and no longer know the upload. */
static store_result complete(object_bucket *b, const char *name, const char *query, const char *list, const char *sha) {
  char hash[65], why[S3_WHY] = "";
  unsigned char digest[crypto_hash_sha256_BYTES];
  store_result result = STORE_AWAY;
  crypto_hash_sha256(digest, (const unsigned char *)list, strlen(list));
  sodium_bin2hex(hash, sizeof hash, digest, sizeof digest);
  const s3_request request = {.method = "POST",
                              .key = name,
                              .query = query,
                              .body = list,
                              .size = strlen(list),
                              .sha = hash,
                              .to = -1,
                              .tries = 1};
  for (int tried = 0; tried < TRIES && result == STORE_AWAY; tried++) {
    s3_answer answer;
    s3_send(b->store, &request, &answer);
    result = meaning(&answer);
    if (result == STORE_OK && answer.text &&
        strstr(answer.text,
               "<Error>")) { /* S3 sends status 200 before it has joined them, and an error may follow in the text */
      log_warn("S3 could not put the parts of %s together: %.300s", name, answer.text);
      result = STORE_AWAY;
    }
    snprintf(why, sizeof why, "%s", answer.why);
    free(answer.text);
    if ((result == STORE_AWAY || result == STORE_NOT_FOUND) && has(b, name, sha)) {
      result = STORE_OK;
    } else if (result == STORE_AWAY) {
      s3_pause(tried);
    }
  }
  if (result == STORE_AWAY || result == STORE_UNFIT || result == STORE_NOT_FOUND) {
    set_away(b, 1, why);
    return STORE_AWAY;
  }
  return result;
}

static store_result put_parts(object_bucket *b, const char *name, int fd, uint64_t size, const char *sha) {
  char upload[UPLOAD], query[UPLOAD + 16];
  s3_answer answer;
  const s3_request begin = {.method = "POST", .key = name, .query = "uploads=", .meta = sha, .to = -1, .tries = TRIES};
  store_result result = ask(b, &begin, &answer);
  result = result == STORE_OK ? read_upload(&answer, upload) : result;
  free(answer.text);
  if (result != STORE_OK) {
    return result;
  }
  api_text list = {0};
  int number = 0;
  api_text_add(&list, "<CompleteMultipartUpload xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\">");
  for (uint64_t done = 0; result == STORE_OK && done < size; done += b->part) {
    uint64_t left = size - done;
    result = put_part(b, name, upload, fd, ++number, done, left < b->part ? left : b->part, &list);
  }
  api_text_add(&list, "</CompleteMultipartUpload>");
  snprintf(query, sizeof query, "uploadId=%s", upload);
  result = result == STORE_OK && list.failed ? STORE_ERROR : result;
  result = result == STORE_OK ? complete(b, name, query, list.data, sha) : result;
  api_text_free(&list);
  if (result != STORE_OK && !bucket_is_away(b)) {
    abort_parts(b, name, upload);
  }
  return result;
}

store_result bucket_put(object_bucket *b, const char *name, int fd) {
  struct stat info;
  char sha[65];
  if (fstat(fd, &info) != 0 || !bucket_hash(fd, 0, (uint64_t)info.st_size, sha)) {
    log_error("an object cannot be read before its upload: %s", strerror(errno));
    return STORE_ERROR;
  }
  uint64_t size = (uint64_t)info.st_size;
  if (size > b->part) {
    return put_parts(b, name, fd, size, sha);
  }
  const s3_request request = {
      .method = "PUT", .key = name, .from = fd, .size = size, .sha = sha, .meta = sha, .to = -1, .tries = TRIES};
  return ask_only(b, &request);
}

store_result bucket_get(object_bucket *b, const char *name, int fd, uint64_t *size) {
  store_result result = STORE_CONFLICT;
  for (int tried = 0; tried < READ_TRIES && result == STORE_CONFLICT; tried++) {
    char sha[65];
    s3_answer answer;
    const s3_request request = {.method = "GET", .key = name, .to = fd, .tries = TRIES};
    result = ask(b, &request, &answer);
    free(answer.text);
    if (result != STORE_OK) {
      break;
    }
    if (!answer.meta[0]) { /* without a hash it is not known to be damaged, so it stays */
      log_error(
          "S3 answers with %s, but without its hash (x-amz-meta-sha256): something else answers in its place, or it "
          "was "
          "copied without its metadata; copy it again with them",
          name);
      return STORE_ERROR;
    }
    *size = answer.size;
    if (ftruncate(fd, (off_t)answer.size) != 0 || !bucket_hash(fd, 0, answer.size, sha)) {
      log_error("an object from S3 cannot be kept: %s", strerror(errno));
      return STORE_ERROR;
    }
    result = strcmp(sha, answer.meta) == 0 ? STORE_OK : STORE_CONFLICT;
  }
  return result;
}

store_result bucket_look(object_bucket *b, const char *name, char sha[65], int64_t *modified) {
  s3_answer answer;
  const s3_request request = {.method = "HEAD", .key = name, .to = -1, .tries = TRIES};
  store_result result = ask(b, &request, &answer);
  free(answer.text);
  if (sha) {
    memcpy(sha, answer.meta, sizeof answer.meta);
  }
  if (modified) {
    *modified = answer.modified;
  }
  return result;
}

int64_t bucket_clock(object_bucket *b) {
  return s3_clock(b->store);
}

store_result bucket_delete(object_bucket *b, const char *name, int64_t signed_at) {
  const s3_request request = {
      .method = "DELETE", .key = name, .to = -1, .tries = 2, .signed_at = signed_at, .seconds = BUCKET_DELETE_S};
  store_result result = ask_only(b, &request);
  if (result == STORE_CONFLICT) {
    log_warn("S3 did not delete %s: the request came too late; it is sent again", name);
  }
  return result == STORE_NOT_FOUND ? STORE_OK : result;
}

/* Calls `each` for one page of a list. */
static void each_of_page(const object_bucket *b, const char *page,
                         void (*each)(void *user, const char *name, uint64_t size), void *user) {
  const char *at = page;
  size_t prefix = strlen(b->options.place.prefix);
  char key[1100], size[32];
  while (s3_element(&at, "Key", key, sizeof key)) {
    const char *of = at;
    if (s3_element(&of, "Size", size, sizeof size) && strlen(key) > prefix && strcmp(key + prefix, owner_name) != 0) {
      each(user, key + prefix, strtoull(size, NULL, 10));
    }
  }
}

store_result bucket_each(object_bucket *b, void (*each)(void *user, const char *name, uint64_t size), void *user) {
  char prefix[3 * S3_PREFIX], token[1024] = "", encoded[3 * sizeof token] = "", query[5000];
  store_result result = STORE_OK;
  s3_encode(b->options.place.prefix, prefix, sizeof prefix);
  for (int more = 1; more && result == STORE_OK;) {
    s3_answer answer;
    snprintf(query, sizeof query, "%s%s%slist-type=2&prefix=%s", *encoded ? "continuation-token=" : "", encoded,
             *encoded ? "&" : "", prefix);
    const s3_request request = {.method = "GET", .query = query, .to = -1, .tries = TRIES};
    result = ask(b, &request, &answer);
    if (result == STORE_OK && answer.text) {
      const char *at = answer.text;
      each_of_page(b, answer.text, each, user);
      more = s3_element(&at, "NextContinuationToken", token, sizeof token) && s3_encode(token, encoded, sizeof encoded);
    }
    free(answer.text);
  }
  return result;
}

int bucket_link(object_bucket *b, const char *name, long seconds, const char *more, char out[BUCKET_LINK]) {
  return s3_link(b->store, name, seconds, more, out, BUCKET_LINK);
}
