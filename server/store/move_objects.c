#include "store/move_objects.h"

#include <errno.h>
#include <fcntl.h>
#include <sodium.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"
#include "store/object_removal.h"
#include "store/rows.h"
#include "store/several.h"
#include "store/spheres.h"

enum {
  BATCH = 64,         /* rows; each has at most RESOURCE_OBJECTS objects */
  BLOCK = 1 << 18,    /* bytes read at a time */
  AWAY_SECONDS = 300, /* how long S3 may be unreachable before the move gives up */
};

/* An object of a batch, and the result of moving it. */
typedef struct item {
  const resource *row;
  named_object object;
  store_result result;
  const char *why; /* damaged or missing; NULL: neither */
  int there;
  uint64_t bytes;
} item;

typedef struct batch {
  const object_move *m;
  resource rows[BATCH];
  item items[BATCH * RESOURCE_OBJECTS];
  int row_count, count;
} batch;

/* The hash of an object. A bucket gives it without sending the object. */
static store_result hash_of(const depot *d, object_kind kind, const char *id, char sha[65]) {
  char name[OBJECT_NAME];
  int fd;
  uint64_t size;
  if (d->bucket) {
    objects_name(kind, id, name);
    return bucket_look(d->bucket, name, sha, NULL);
  }
  store_result result = objects_read(d->files, kind, id, &fd, &size);
  if (result == STORE_OK) {
    result = bucket_hash(fd, 0, size, sha) ? STORE_OK : STORE_ERROR;
    close(fd);
  }
  return result;
}

/* Makes a temporary file that has no name. */
static int open_spare(const char *folder) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/move-XXXXXX", folder);
  int fd = mkostemp(path, O_CLOEXEC);
  if (fd < 0) {
    log_error("create %s: %s", path, strerror(errno));
  } else {
    unlink(path);
  }
  return fd;
}

/* Opens the bytes of an object. STORE_CONFLICT: those of a bucket do not match the hash beside them. */
static store_result fetch(const object_move *m, const item *i, int *fd, uint64_t *size) {
  char name[OBJECT_NAME];
  if (!m->from.bucket) {
    return objects_read(m->from.files, i->object.kind, i->row->id, fd, size);
  }
  *fd = open_spare(m->spare);
  if (*fd < 0) {
    return STORE_ERROR;
  }
  objects_name(i->object.kind, i->row->id, name);
  store_result result = bucket_get(m->from.bucket, name, *fd, size);
  if (result != STORE_OK) {
    close(*fd);
    *fd = -1;
  }
  return result;
}

/* Writes the bytes as an object of a folder, and hashes what it writes. */
static store_result put_file(objects *to, const item *i, int fd, uint64_t size, const char *sha) {
  object_temp temp;
  char written[65];
  unsigned char *block = malloc(BLOCK);
  store_result result = block ? objects_begin(to, &temp) : STORE_ERROR;
  if (result != STORE_OK) {
    free(block);
    return result;
  }
  for (uint64_t at = 0; at < size && result == STORE_OK;) {
    ssize_t n = pread(fd, block, size - at < BLOCK ? (size_t)(size - at) : BLOCK, (off_t)at);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    result = n > 0 ? objects_append(&temp, block, (size_t)n) : STORE_ERROR;
    at += n > 0 ? (uint64_t)n : 0;
  }
  free(block);
  if (result == STORE_OK) {
    result = bucket_hash(temp.fd, 0, size, written) && strcmp(written, sha) == 0 ? STORE_OK : STORE_ERROR;
  }
  result = result == STORE_OK ? objects_publish(to, &temp, i->object.kind, i->row->id) : result;
  objects_abandon(&temp);
  return result;
}

static store_result put(const object_move *m, const item *i, int fd, uint64_t size, const char *sha) {
  char name[OBJECT_NAME];
  if (m->to.files) {
    return put_file(m->to.files, i, fd, size, sha);
  }
  objects_name(i->object.kind, i->row->id, name);
  return bucket_put(m->to.bucket, name, fd);
}

/* STORE_CONFLICT: the bytes are not those of the row. The file of aligned spheres has its hash within itself. */
static store_result check(const item *i, int fd, uint64_t size, char sha[65]) {
  if (!bucket_hash(fd, 0, size, sha)) {
    return STORE_ERROR;
  }
  if (i->object.kind == OBJECT_SPHERES) {
    return spheres_check_file(fd, size);
  }
  return !i->object.sha[0] || strcmp(sha, i->object.sha) == 0 ? STORE_OK : STORE_CONFLICT;
}

/* Whether the target has the object with the right hash. */
static store_result look(const object_move *m, const item *i, int *there) {
  char wanted[65] = "", found[65] = "";
  store_result result = hash_of(&m->to, i->object.kind, i->row->id, found);
  *there = 0;
  if (result != STORE_OK) {
    return result == STORE_NOT_FOUND ? STORE_OK : result;
  }
  if (i->object.kind == OBJECT_SPHERES || !i->object.sha[0]) {
    result = hash_of(&m->from, i->object.kind, i->row->id, wanted);
  } else {
    snprintf(wanted, sizeof wanted, "%s", i->object.sha);
  }
  *there = result == STORE_OK && strcmp(wanted, found) == 0;
  return result == STORE_NOT_FOUND ? STORE_OK : result;
}

static store_result move_once(const object_move *m, item *i) {
  int fd = -1;
  char sha[65];
  store_result result = m->again ? look(m, i, &i->there) : STORE_OK;
  if (result != STORE_OK || i->there) {
    return result;
  }
  result = fetch(m, i, &fd, &i->bytes);
  if (result == STORE_OK) {
    result = check(i, fd, i->bytes, sha);
  }
  if (result == STORE_NOT_FOUND || result == STORE_CONFLICT) {
    i->why = result == STORE_NOT_FOUND ? "is missing" : "does not match its hash";
    result = STORE_OK;
  } else if (result == STORE_OK) {
    FAULT_POINT("move-object");
    result = put(m, i, fd, i->bytes, sha);
  }
  if (fd >= 0) {
    close(fd);
  }
  return result;
}

static int is_away(const depot *d) {
  return d->bucket && bucket_is_away(d->bucket);
}

/* Waits while S3 is unreachable. */
static store_result move_item(const object_move *m, item *i) {
  store_result result = move_once(m, i);
  for (int waited = 0; result == STORE_AWAY && waited < AWAY_SECONDS; waited++) {
    const struct timespec second = {.tv_sec = 1};
    nanosleep(&second, NULL);
    if (!is_away(&m->from) && !is_away(&m->to)) {
      result = move_once(m, i);
    }
  }
  return result;
}

static int move_one(void *user, int k) {
  batch *b = user;
  b->items[k].result = move_item(b->m, &b->items[k]);
  return b->items[k].result == STORE_OK;
}

/* Moves all objects of a batch at once. */
static store_result move_batch(batch *b) {
  several_run(b->count, move_one, b);
  for (int k = 0; k < b->count; k++) {
    if (b->items[k].result != STORE_OK) {
      return b->items[k].result;
    }
  }
  return STORE_OK;
}

/* Reads the rows after `seq`. */
static store_result read_batch(batch *b, int64_t seq) {
  sql_statement *st = database_statement(b->m->rows,
                                         "SELECT seq, kind, id, sha, json, bytes, created, places, quantized, meshopt"
                                         " FROM resource WHERE seq>?1 ORDER BY seq LIMIT ?2");
  int code = SQL_ERROR;
  b->row_count = b->count = 0;
  if (st) {
    sql_bind_integer(st, 1, seq);
    sql_bind_integer(st, 2, BATCH);
    while (b->row_count < BATCH && (code = sql_step(st)) == SQL_ROW) {
      resource *row = &b->rows[b->row_count];
      if (!resource_rows.read(st, row) || row->kind < 0 || row->kind >= RESOURCE_KINDS) {
        resource_free(row);
        code = SQL_CORRUPT;
        break;
      }
      named_object named[RESOURCE_OBJECTS];
      int count = resource_objects(row, named);
      b->row_count++;
      for (int i = 0; i < count; i++) {
        b->items[b->count++] = (item){.row = row, .object = named[i], .result = STORE_OK};
      }
    }
    sql_reset(st);
  }
  if (code != SQL_DONE && code != SQL_ROW) {
    log_error("migrate: the rows of resources cannot be read: %s", sql_reason(code));
    return STORE_ERROR;
  }
  return STORE_OK;
}

static void free_batch(batch *b) {
  for (int i = 0; i < b->row_count; i++) {
    resource_free(&b->rows[i]);
  }
}

static store_result leave_out(const object_move *m, const resource *row) {
  sql_statement *st = database_statement(m->rows, "DELETE FROM resource WHERE kind=?1 AND id=?2");
  if (st) {
    sql_bind_integer(st, 1, (int)row->kind);
    sql_bind_text(st, 2, row->id);
  }
  return database_run(m->rows, st) == SQL_OK ? STORE_OK : STORE_ERROR;
}

static store_result count_batch(const batch *b, object_counts *counts) {
  store_result result = STORE_OK;
  counts->rows += b->row_count;
  counts->objects += b->count;
  for (int k = 0; k < b->count && result == STORE_OK; k++) {
    const item *i = &b->items[k];
    if (!i->why) {
      counts->there += i->there;
      counts->sent += !i->there;
      counts->bytes += i->there ? 0 : (int64_t)i->bytes;
      continue;
    }
    b->m->wrong(b->m->user, i->row, i->object.what, i->why);
    if (i->row->kind == RESOURCE_ALIGNMENT) {
      counts->left_out++;
      result = leave_out(b->m, i->row);
    } else {
      counts->wrong++;
    }
  }
  return result;
}

/* Removes objects that no row names. An earlier run sent them, and the source has deleted them since. */
typedef struct sweep {
  const object_move *m;
  object_counts *counts;
  store_result result;
} sweep;

static void sweep_object(void *user, object_kind kind, const char *id, uint64_t size) {
  sweep *s = user;
  sql_statement *st = database_statement(s->m->rows, "SELECT 1 FROM resource WHERE kind=?1 AND id=?2");
  char name[OBJECT_NAME];
  (void)size;
  if (!st) {
    s->result = STORE_ERROR;
    return;
  }
  sql_bind_integer(st, 1, (int)resource_of_object(kind));
  sql_bind_text(st, 2, id);
  int code = sql_step(st);
  sql_reset(st);
  if (code == SQL_DONE) {
    objects_name(kind, id, name);
    store_result deleted =
        s->m->to.files ? objects_delete(s->m->to.files, kind, id) : bucket_delete(s->m->to.bucket, name, 0);
    s->counts->removed += deleted == STORE_OK;
    s->result = deleted == STORE_OK ? s->result : deleted;
  }
}

static void sweep_name(void *user, const char *name, uint64_t size) {
  object_kind kind;
  const char *id;
  if (objects_read_name(name, &kind, &id)) {
    sweep_object(user, kind, id, size);
  }
}

static store_result remove_others(const object_move *m, object_counts *counts) {
  sweep s = {m, counts, STORE_OK};
  store_result result =
      m->to.files ? objects_each(m->to.files, sweep_object, &s) : bucket_each(m->to.bucket, sweep_name, &s);
  return result == STORE_OK ? s.result : result;
}

store_result move_objects(const object_move *m, object_counts *counts) {
  store_result result = STORE_OK;
  batch *b = calloc(1, sizeof *b);
  memset(counts, 0, sizeof *counts);
  if (!b) {
    return STORE_ERROR;
  }
  b->m = m;
  int64_t seq = INT64_MIN;
  for (int more = 1; more && result == STORE_OK;) {
    result = read_batch(b, seq);
    result = result == STORE_OK ? move_batch(b) : result;
    result = result == STORE_OK ? count_batch(b, counts) : result;
    more = b->row_count == BATCH;
    seq = b->row_count ? b->rows[b->row_count - 1].seq : seq;
    free_batch(b);
    if (result == STORE_OK) {
      m->tell(m->user, counts);
    }
  }
  free(b);
  return result == STORE_OK && m->again ? remove_others(m, counts) : result;
}
