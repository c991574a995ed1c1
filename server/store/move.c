#include "store/move.h"

#include <errno.h>
#include <sodium.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"
#include "store/move_mark.h"
#include "store/move_rows.h"
#include "store/rows.h"

struct move {
  store_place from, to;
  database source, target;
  depot have, want;
  char mark[PLACE_MARK]; /* of the deployment */
  char spare[PATH_MAX];
  int marked;                   /* the catalogue of the target has the mark */
  char owner[BUCKET_OWNER + 1]; /* of the target's bucket */
};

static store_result unfit(int code) {
  return code == SQL_OK                                                                               ? STORE_OK
         : code == SQL_SCHEMA || code == SQL_READONLY || code == SQL_NOTADB || code == SQL_UNFINISHED ? STORE_UNFIT
         : code == SQL_FULL                                                                           ? STORE_FULL
                                                                                                      : STORE_ERROR;
}

/* Opens the catalogue of a place for writing, which no other process does then. *version: of its schema. */
static store_result open_database(const store_place *p, database *out, int *version) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/catalogue.sqlite", p->data);
  int code = database_open(p->catalogue ? p->catalogue : path, 1, out);
  code = code == SQL_OK ? out->connection.driver->version(&out->connection, version) : code;
  if (code != SQL_OK && !p->catalogue) { /* for a server, the driver has logged why */
    log_error("migrate: the catalogue %s cannot be opened: %s", path, sql_reason(code));
  }
  return unfit(code);
}

static int is_whole(database *db) {
  sql_statement *st = db->connection.driver == &sql_postgresql ? NULL : database_statement(db, "PRAGMA quick_check(1)");
  int whole = db->connection.driver == &sql_postgresql ||
              (st && sql_step(st) == SQL_ROW && sql_text(st, 0) && strcmp(sql_text(st, 0), "ok") == 0);
  sql_reset(st);
  return whole;
}

static store_result mark_of(database *db, char out[PLACE_MARK]) {
  unsigned char secret[CATALOGUE_SECRET];
  if (resource_secret(db, secret) != SQL_OK) {
    log_error("migrate: the catalogue has no secret: it is damaged");
    return STORE_ERROR;
  }
  place_hash(secret, out);
  sodium_memzero(secret, sizeof secret);
  return STORE_OK;
}

/* Whether the options name what the source's data folder says. */
static store_result match_source(const store_place *p, const char *rows, const char *files) {
  if (!p->catalogue && *rows) {
    log_error("the catalogue of %s is in PostgreSQL: name its URL with --from-catalogue", p->data);
    return STORE_UNFIT;
  }
  if (!p->catalogue && !place_has_catalogue(p->data)) {
    log_error("%s is not a data folder: name that of the service with --from-data", p->data);
    return STORE_UNFIT;
  }
  if (p->catalogue && place_has_catalogue(p->data)) {
    log_error("%s has a catalogue in SQLite: omit --from-catalogue", p->data);
    return STORE_UNFIT;
  }
  if (!p->bucket.url && *files) {
    log_error("the objects of %s are in S3: name their bucket with --from-objects", p->data);
    return STORE_UNFIT;
  }
  if (p->bucket.url && place_has_files(p->data)) {
    log_error("the objects of %s are files: omit --from-objects", p->data);
    return STORE_UNFIT;
  }
  return STORE_OK;
}

static store_result open_source_rows(move *m) {
  char half[MOVE_MARK];
  int version = 0;
  store_result result = open_database(&m->from, &m->source, &version);
  if (result != STORE_OK) {
    return result;
  }
  result = unfit(move_mark_read(&m->source, half));
  if (result == STORE_OK && *half) {
    log_error("migrate: the source is itself a copy that has not ended: run the migrate that fills it again");
    return STORE_UNFIT;
  }
  if (result == STORE_OK && version == 0) {
    log_error("migrate: the source has no catalogue: correct --from-data or --from-catalogue");
    return STORE_UNFIT;
  }
  if (result == STORE_OK && !is_whole(&m->source)) {
    log_error("the catalogue of %s is damaged: restore a backup, or see orbmorphd --check-data", m->from.data);
    return STORE_ERROR;
  }
  result = result == STORE_OK ? unfit(database_migrate(&m->source)) : result;
  return result == STORE_OK ? mark_of(&m->source, m->mark) : result;
}

static store_result open_source_objects(move *m) {
  char owner[BUCKET_OWNER + 1];
  if (!m->from.bucket.url) {
    return objects_open_read_only(m->from.data, &m->have.files);
  }
  store_result result = bucket_open(&m->from.bucket, owner, &m->have.bucket);
  if (result == STORE_OK && strcmp(owner, m->mark) != 0) {
    log_error("the bucket of --from-objects has none of the objects of this catalogue: correct --from-objects");
    result = STORE_UNFIT;
  }
  return result;
}

static store_result open_source(move *m) {
  char rows[PLACE_MARK], files[PLACE_MARK];
  store_result result = place_read_mark(m->from.data, place_catalogue, rows);
  result = result == STORE_OK ? place_read_mark(m->from.data, place_objects, files) : result;
  result = result == STORE_OK ? match_source(&m->from, rows, files) : result;
  result = result == STORE_OK ? open_source_rows(m) : result;
  if (result == STORE_OK && ((*rows && strcmp(rows, m->mark) != 0) || (*files && strcmp(files, m->mark) != 0))) {
    log_error("%s belongs to another catalogue than --from-catalogue names", m->from.data);
    result = STORE_UNFIT;
  }
  return result == STORE_OK ? open_source_objects(m) : result;
}

static store_result refuse(const char *what) {
  log_error("migrate: %s: name a new data folder, and a new database or bucket, for the target", what);
  return STORE_UNFIT;
}

/* What the target's data folder says. */
static store_result match_folder(const move *m) {
  const store_place *p = &m->to;
  char rows[PLACE_MARK], files[PLACE_MARK];
  store_result result = place_read_mark(p->data, place_catalogue, rows);
  result = result == STORE_OK ? place_read_mark(p->data, place_objects, files) : result;
  if (result != STORE_OK) {
    return result;
  }
  if ((*rows && strcmp(rows, m->mark) != 0) || (*files && strcmp(files, m->mark) != 0)) {
    return refuse("the data folder of the target belongs to another deployment");
  }
  if (place_is_unfinished(p->data)) {
    return refuse("a restore into the data folder of the target has not ended");
  }
  if ((*rows && !p->catalogue) || (*files && !p->bucket.url)) {
    return refuse("the data folder of the target has its catalogue or its objects elsewhere than the options say");
  }
  if ((p->catalogue && place_has_catalogue(p->data)) || (p->bucket.url && place_has_files(p->data))) {
    return refuse("the data folder of the target has a catalogue or objects of its own");
  }
  return STORE_OK;
}

/* What the target's catalogue says, unless there is none yet. */
static store_result match_rows(move *m) {
  char half[MOVE_MARK];
  int version = 0;
  if (!m->to.catalogue && !place_has_catalogue(m->to.data)) {
    return place_has_files(m->to.data) ? refuse("the data folder of the target has objects of its own") : STORE_OK;
  }
  store_result result = open_database(&m->to, &m->target, &version);
  result = result == STORE_OK ? unfit(move_mark_read(&m->target, half)) : result;
  if (result != STORE_OK) {
    return result;
  }
  if (*half && strcmp(half, m->mark) != 0) {
    return refuse("the catalogue of the target is an unfinished copy of another deployment");
  }
  m->marked = *half != 0;
  if (version > 0 && !m->marked) {
    char mark[PLACE_MARK] = "";
    int same = mark_of(&m->target, mark) == STORE_OK && strcmp(mark, m->mark) == 0;
    return refuse(same ? "the target has a whole copy of this deployment already, perhaps an earlier one"
                       : "the catalogue of the target belongs to another deployment");
  }
  return !m->marked && place_has_files(m->to.data) ? refuse("the data folder of the target has objects of its own")
                                                   : STORE_OK;
}

/* The owner that the target's bucket has until the end. */
static void name_unfinished(const move *m, char out[BUCKET_OWNER + 1]) {
  snprintf(out, BUCKET_OWNER + 1, "%s%s", PLACE_MIGRATING, m->mark);
}

static store_result match_bucket(move *m) {
  char unfinished[BUCKET_OWNER + 1];
  name_unfinished(m, unfinished);
  if (!m->to.bucket.url) {
    return STORE_OK;
  }
  store_result result = bucket_open(&m->to.bucket, m->owner, &m->want.bucket);
  if (result == STORE_OK && *m->owner && strcmp(m->owner, unfinished) != 0 && strcmp(m->owner, m->mark) != 0) {
    return refuse("the bucket of the target belongs to another deployment");
  }
  return result == STORE_OK ? bucket_check_writes(m->want.bucket) : result;
}

/* Only a move that was killed during its last steps leaves both the final owner and the mark. */
static store_result match_both(const move *m) {
  return *m->owner && strcmp(m->owner, m->mark) == 0 && !m->marked
             ? refuse("the bucket of the target is that of the source, or of a whole copy")
             : STORE_OK;
}

static store_result make_spare(move *m) {
  int n = snprintf(m->spare, sizeof m->spare, "%s/tmp", m->to.data);
  if (n < (int)sizeof m->spare && (mkdir(m->spare, 0700) == 0 || errno == EEXIST)) {
    return STORE_OK;
  }
  log_error("mkdir %s: %s", m->spare, strerror(errno));
  return STORE_ERROR;
}

/* The first writes. From here on, the target belongs to this move. */
static store_result mark_target(move *m) {
  char unfinished[BUCKET_OWNER + 1];
  int version;
  store_result result = STORE_OK;
  name_unfinished(m, unfinished);
  if (m->to.catalogue) {
    result = place_write_mark(m->to.data, place_catalogue, m->mark);
  }
  if (result == STORE_OK && m->to.bucket.url) {
    result = place_write_mark(m->to.data, place_objects, m->mark);
  }
  FAULT_POINT("move-folder");
  if (result == STORE_OK && !m->target.connection.driver) {
    result = open_database(&m->to, &m->target, &version);
  }
  if (result == STORE_OK && !m->marked) {
    result = unfit(move_mark_set(&m->target, m->mark));
  }
  FAULT_POINT("move-marked");
  result = result == STORE_OK ? unfit(database_migrate(&m->target)) : result;
  if (result == STORE_OK && m->to.bucket.url && !*m->owner) {
    result = bucket_claim(m->want.bucket, unfinished);
  }
  FAULT_POINT("move-claimed");
  if (result == STORE_OK && !m->to.bucket.url) {
    result = objects_open(m->to.data, &m->want.files);
  }
  return result == STORE_OK ? make_spare(m) : result;
}

store_result move_open(const store_place *from, const store_place *to, move **out) {
  move *m = calloc(1, sizeof *m);
  if (!m) {
    return STORE_ERROR;
  }
  m->from = *from;
  m->to = *to;
  store_result result = open_source(m);
  result = result == STORE_OK ? match_folder(m) : result;
  result = result == STORE_OK ? match_bucket(m) : result;
  result = result == STORE_OK ? match_rows(m) : result;
  result = result == STORE_OK ? match_both(m) : result;
  result = result == STORE_OK ? mark_target(m) : result;
  if (result != STORE_OK) {
    move_close(m);
    return result;
  }
  *out = m;
  return STORE_OK;
}

static void close_depot(depot *d) {
  objects_close(d->files);
  bucket_close(d->bucket);
}

void move_close(move *m) {
  if (!m) {
    return;
  }
  database_close(&m->source);
  database_close(&m->target);
  close_depot(&m->have);
  close_depot(&m->want);
  free(m);
}

int move_goes_on(const move *m) {
  return m->marked;
}

static store_result finish(move *m) {
  store_result result = STORE_OK;
  FAULT_POINT("move-done");
  if (m->to.bucket.url) {
    result = bucket_claim(m->want.bucket, m->mark);
  }
  FAULT_POINT("move-owned");
  result = result == STORE_OK ? unfit(move_mark_clear(&m->target)) : result;
  return result;
}

store_result move_run(move *m, const move_listener *listener, object_counts *counts) {
  const object_move all = {.from = m->have,
                           .to = m->want,
                           .rows = &m->target,
                           .spare = m->spare,
                           .again = m->marked,
                           .tell = listener->objects,
                           .wrong = listener->wrong,
                           .user = listener->user};
  store_result result = move_rows(&m->source, &m->target, listener->rows, listener->user);
  result = result == STORE_OK ? move_objects(&all, counts) : result;
  if (result == STORE_OK && counts->wrong) {
    return STORE_CONFLICT;
  }
  return result == STORE_OK ? finish(m) : result;
}
