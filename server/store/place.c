#include "store/place.h"

#include <errno.h>
#include <fcntl.h>
#include <sodium.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "log.h"

enum { MARK = 2 * CATALOGUE_SECRET + 1 };

static void path_in(const char *data, const char *name, char out[PATH_MAX]) {
  snprintf(out, PATH_MAX, "%s/%s", data, name);
}

/* A hash that identifies a catalogue. */
static store_result mark_of(catalogue *cat, char out[MARK]) {
  unsigned char secret[CATALOGUE_SECRET], hash[crypto_hash_sha256_BYTES];
  store_result result = catalogue_secret(cat, secret);
  crypto_hash_sha256(hash, secret, sizeof secret);
  sodium_bin2hex(out, MARK, hash, CATALOGUE_SECRET);
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
  path_in(data, "catalogue.postgresql.new", temporary);
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

static store_result open_url(const char *data, const char *url, const char *path, const char *mark, catalogue **out) {
  char own[PATH_MAX];
  path_in(data, "catalogue.sqlite", own);
  if (access(own, F_OK) == 0) {
    log_error(
        "%s has a catalogue in SQLite, which names its objects: start without --catalogue, or name a new data folder",
        data);
    return STORE_UNFIT;
  }
  store_result result = catalogue_open(url, out);
  if (result == STORE_OK) {
    result = match(data, path, mark, *out);
    if (result != STORE_OK) {
      catalogue_close(*out);
      *out = NULL;
    }
  }
  return result;
}

store_result catalogue_open_at(const char *data, const char *url, catalogue **out) {
  char path[PATH_MAX], mark[MARK];
  path_in(data, "catalogue.postgresql", path);
  if (read_mark(path, mark) != STORE_OK) {
    log_error("%s cannot be read, or is damaged", path);
    return STORE_ERROR;
  }
  if (url) {
    return open_url(data, url, path, mark, out);
  }
  if (*mark) {
    log_error("the catalogue of %s is in PostgreSQL: name its URL with --catalogue", data);
    return STORE_UNFIT;
  }
  return catalogue_open(data, out);
}
