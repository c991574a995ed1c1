#include "store/place.h"

#include <errno.h>
#include <fcntl.h>
#include <sodium.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "log.h"
#include "store/object_lock.h"

enum { MARK = PLACE_MARK };
const char place_catalogue[] = "catalogue.postgresql", place_objects[] = "objects.s3";
const char place_new_catalogue[] = "catalogue.new", place_backup_mark[] = "backup";

static void path_in(const char *data, const char *name, char out[PATH_MAX]) {
  snprintf(out, PATH_MAX, "%s/%s", data, name);
}

void place_hash(const unsigned char secret[CATALOGUE_SECRET], char out[PLACE_MARK]) {
  unsigned char hash[crypto_hash_sha256_BYTES];
  crypto_hash_sha256(hash, secret, CATALOGUE_SECRET);
  sodium_bin2hex(out, PLACE_MARK, hash, CATALOGUE_SECRET);
}

/* A hash that identifies a catalogue. */
static store_result mark_of(catalogue *cat, char out[MARK]) {
  unsigned char secret[CATALOGUE_SECRET];
  store_result result = catalogue_secret(cat, secret);
  place_hash(secret, out);
  sodium_memzero(secret, sizeof secret);
  return result;
}

/* The mark of a folder; "": it has none. */
static store_result read_mark(const char *path, char out[MARK]) {
  memset(out, 0, MARK);
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) {
    return errno == ENOENT ? STORE_OK : STORE_ERROR;
  }
  ssize_t size = read(fd, out, MARK - 1);
  close(fd);
  return size == MARK - 1 ? STORE_OK : STORE_ERROR;
}

static store_result write_mark(const char *data, const char *path, const char mark[MARK]) {
  char temporary[PATH_MAX];
  path_in(data, "mark.new", temporary);
  int fd = open(temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  int fine = fd >= 0 && write(fd, mark, MARK - 1) == MARK - 1 && fsync(fd) == 0;
  if (fd >= 0) {
    close(fd);
  }
  fine = fine && rename(temporary, path) == 0;
  int folder = open(data, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  fine = fine && folder >= 0 && fsync(folder) == 0;
  if (folder >= 0) {
    close(folder);
  }
  if (!fine) {
    log_error("%s cannot be written: %s", path, strerror(errno));
  }
  return fine ? STORE_OK : STORE_ERROR;
}

store_result place_read_mark(const char *data, const char *name, char out[PLACE_MARK]) {
  char path[PATH_MAX];
  path_in(data, name, path);
  store_result result = read_mark(path, out);
  if (result != STORE_OK) {
    log_error("%s cannot be read, or is damaged", path);
  }
  return result;
}

store_result place_write_mark(const char *data, const char *name, const char mark[PLACE_MARK]) {
  char path[PATH_MAX];
  path_in(data, name, path);
  return write_mark(data, path, mark);
}

static store_result match(const char *data, const char *path, const char *there, catalogue *cat) {
  char mark[MARK];
  store_result result = mark_of(cat, mark);
  if (result != STORE_OK) {
    return result;
  }
  if (!*there) {
    return write_mark(data, path, mark);
  }
  if (strcmp(there, mark) == 0) {
    return STORE_OK;
  }
  log_error(
      "the objects in %s belong to another catalogue than this one in PostgreSQL: name theirs with --catalogue, "
      "or start with a new data folder and a new database",
      data);
  return STORE_UNFIT;
}

static store_result open_url(const char *data, const char *url, int shared, const char *path, const char *mark,
                             catalogue **out) {
  char own[PATH_MAX];
  path_in(data, "catalogue.sqlite", own);
  if (access(own, F_OK) == 0) {
    log_error(
        "%s has a catalogue in SQLite, which names its objects: start without --catalogue, or name a new data folder",
        data);
    return STORE_UNFIT;
  }
  store_result result = catalogue_open_shared(url, shared, out);
  if (result == STORE_OK) {
    result = match(data, path, mark, *out);
    if (result != STORE_OK) {
      catalogue_close(*out);
      *out = NULL;
    }
  }
  return result;
}

int place_has(const char *data, const char *name) {
  char path[PATH_MAX];
  path_in(data, name, path);
  return access(path, F_OK) == 0;
}

int place_is_unfinished(const char *data) {
  return place_has(data, place_new_catalogue) && !place_has_catalogue(data) && !place_has(data, place_catalogue);
}

/* A daemon would make an empty catalogue there, and then nothing would tell what is missing. */
static store_result refuse_unfinished(const char *data) {
  if (!place_is_unfinished(data)) {
    return STORE_OK;
  }
  log_error(place_has(data, place_backup_mark)
                ? "%s is the folder of a backup that has not ended: name the data folder with --data"
                : "a restore into %s has not ended: run orbmorphd restore again until it ends, or name another folder "
                  "with --data",
            data);
  return STORE_UNFIT;
}

store_result catalogue_open_among(const char *data, const char *url, int shared, catalogue **out) {
  char path[PATH_MAX], mark[MARK];
  if (refuse_unfinished(data) != STORE_OK) {
    return STORE_UNFIT;
  }
  path_in(data, place_catalogue, path);
  if (read_mark(path, mark) != STORE_OK) {
    log_error("%s cannot be read, or is damaged", path);
    return STORE_ERROR;
  }
  if (url) {
    return open_url(data, url, shared, path, mark, out);
  }
  if (*mark) {
    log_error("the catalogue of %s is in PostgreSQL: name its URL with --catalogue", data);
    return STORE_UNFIT;
  }
  return catalogue_open(data, out);
}

static void note_file(void *user, object_kind kind, const char *id, uint64_t size) {
  (void)kind;
  (void)id;
  (void)size;
  *(int *)user = 1;
}

int place_has_files(const char *data) {
  objects *files;
  int found = 0;
  if (objects_open_read_only(data, &files) == STORE_OK) {
    objects_each(files, note_file, &found);
    objects_close(files);
  }
  return found;
}

int place_has_catalogue(const char *data) {
  return place_has(data, "catalogue.sqlite");
}

int place_is_data(const char *data) {
  return place_has_catalogue(data) || place_has(data, place_catalogue) || place_has(data, place_new_catalogue);
}

/* Checks what can be checked before the catalogue is opened, which may create it. here: the mark of the data folder. */
static store_result match_bucket(const store_place *p, const char *here, const char *owner) {
  if (strncmp(owner, PLACE_MIGRATING, strlen(PLACE_MIGRATING)) == 0) {
    log_error("orbmorphd migrate has filled the bucket of --objects in part: run it again until it ends");
    return STORE_UNFIT;
  }
  if (*here && !*owner) {
    log_error("the bucket of --objects has none of the objects of %s: name the bucket and prefix that they are in",
              p->data);
    return STORE_UNFIT;
  }
  if ((*here && strcmp(here, owner) != 0) || (!*here && *owner && !p->catalogue && !place_has_catalogue(p->data))) {
    log_error("the bucket of --objects belongs to another deployment than %s: name another bucket or prefix", p->data);
    return STORE_UNFIT;
  }
  if (!*here && place_has_files(p->data)) {
    log_error("the objects of %s are files: start without --objects, or name a new data folder", p->data);
    return STORE_UNFIT;
  }
  return STORE_OK;
}

static store_result refuse_bucket(void) {
  log_error("the bucket of --objects belongs to another catalogue: name another bucket or prefix, or its catalogue");
  return STORE_UNFIT;
}

/* Checks the same for a catalogue in PostgreSQL, which may be new or another than the owner of the bucket: then the
 * node must not create or migrate it. owner: another node may have claimed the bucket meanwhile. */
static store_result match_catalogue(const char *url, object_bucket *b, char owner[BUCKET_OWNER + 1]) {
  catalogue_glance seen = {.names_objects = 0};
  char mark[MARK];
  store_result result = catalogue_peek(url, &seen);
  if (result == STORE_NOT_FOUND && *owner) {
    log_error(
        "the bucket of --objects belongs to another deployment: the database of --catalogue has no catalogue, or not "
        "where this user looks for it. Name another bucket or prefix, or the catalogue of that deployment");
    return STORE_UNFIT;
  }
  place_hash(seen.secret, mark);
  sodium_memzero(&seen.secret, sizeof seen.secret);
  if (result == STORE_OK && !*owner && seen.names_objects) {
    result = bucket_owner(b, owner);
    if (result == STORE_OK && !*owner) {
      log_error(
          "the bucket of --objects has none of the objects of this catalogue: name the bucket and prefix that "
          "they are in");
      return STORE_UNFIT;
    }
  }
  return result == STORE_OK && *owner && strcmp(owner, mark) != 0 ? refuse_bucket()
         : result == STORE_NOT_FOUND                              ? STORE_OK
                                                                  : result;
}

/* Ties the three together, once all are known. */
static store_result claim(const store_place *p, const char *path, const char *here, const char *owner, object_bucket *b,
                          catalogue *cat) {
  char mark[MARK];
  store_result result = mark_of(cat, mark);
  if (result == STORE_OK && *owner && strcmp(owner, mark) != 0) {
    return refuse_bucket();
  }
  if (result == STORE_OK && !*owner) {
    result = bucket_claim(b, mark);
  }
  return result == STORE_OK && !*here ? write_mark(p->data, path, mark) : result;
}

static store_result open_bucket(const store_place *p, const char *path, const char *here, objects **store,
                                catalogue **cat) {
  char owner[BUCKET_OWNER + 1];
  object_bucket *b;
  store_result result = bucket_open(&p->bucket, owner, &b);
  if (result != STORE_OK) {
    return result;
  }
  result = match_bucket(p, here, owner);
  result = result == STORE_OK ? bucket_check_writes(b) : result;
  result = result == STORE_OK && p->catalogue ? match_catalogue(p->catalogue, b, owner) : result;
  result = result == STORE_OK ? catalogue_open_among(p->data, p->catalogue, p->catalogue != NULL, cat) : result;
  result = result == STORE_OK ? claim(p, path, here, owner, b, *cat) : result;
  if (result != STORE_OK) {
    bucket_close(b);
    return result;
  }
  result = objects_open_bucket(p->data, b, p->cache, store);
  if (result == STORE_OK && catalogue_is_shared(*cat)) {
    object_lock *lock = object_lock_open(p->catalogue);
    result = lock ? STORE_OK : STORE_ERROR;
    objects_share(*store, lock);
  }
  return result;
}

store_place store_place_of(const config *options) {
  return (store_place){.data = options->data,
                       .catalogue = config_catalogue(options),
                       .bucket = {.url = strcmp(options->objects, "files") == 0 ? NULL : options->objects,
                                  .keys = options->s3_keys,
                                  .authorities = options->tls_authorities},
                       .cache = (uint64_t)options->cache_bytes};
}

store_result stores_open(const store_place *place, objects **store, catalogue **cat) {
  char path[PATH_MAX], mark[MARK];
  if (refuse_unfinished(place->data) != STORE_OK) { /* before objects_open(), which writes */
    return STORE_UNFIT;
  }
  path_in(place->data, place_objects, path);
  if (read_mark(path, mark) != STORE_OK) {
    log_error("%s cannot be read, or is damaged", path);
    return STORE_ERROR;
  }
  if (place->bucket.url) {
    return open_bucket(place, path, mark, store, cat);
  }
  if (*mark) {
    log_error("the objects of %s are in S3: name their bucket with --objects", place->data);
    return STORE_UNFIT;
  }
  store_result result = objects_open(place->data, store);
  return result == STORE_OK ? catalogue_open_among(place->data, place->catalogue, 0, cat) : result;
}
