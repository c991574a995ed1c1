#include "store/move_rows.h"

#include <sodium.h>
#include <stdlib.h>
#include <string.h>

#include "api/text.h"
#include "faults.h"
#include "log.h"

enum { COLUMNS = 40, BATCH = 200, HASH = crypto_hash_sha256_BYTES };

/* The tables in their order, with the columns of the key. tenant: its sums come from the rows of owner
 * and job. */
typedef struct table {
  const char *name, *keys[3];
  const char *skip[4]; /* columns that triggers fill */
  const char *conflict;
  int numbered; /* the database numbers new rows itself */
} table;
/* A job that was running when its process died waits again, as after a start. */
static const struct {
  const char *column, *value;
} requeued[] = {{"state", "CASE state WHEN 1 THEN 0 ELSE state END"},
                {"alone", "CASE state WHEN 1 THEN 0 ELSE alone END"},
                {"node", "CASE state WHEN 1 THEN '' ELSE node END"}};
static const table tables[] = {
    {"resource", {"seq"}, {0}, "", 1},
    {"owner", {"seq"}, {0}, "", 1},
    {"tenant",
     {"name"},
     {"bytes", "derived", "requests"},
     " ON CONFLICT(name) DO UPDATE SET worker_ms=excluded.worker_ms",
     0},
    {"job", {"seq"}, {0}, "", 1},
    {"event", {"job", "number"}, {0}, "", 0},
    {"job_webhook", {"job", "url"}, {0}, "", 0},
    {"delivery", {"seq"}, {0}, "", 1},
    {"receiver", {"name"}, {0}, "", 0},
    {"webhook", {"name"}, {0}, "", 0},
    {"token", {"hash"}, {0}, "", 0},
    {"signing_key", {"name"}, {0}, "", 0},
    {"crash", {"key", "tenant"}, {0}, "", 0},
    {"need", {"job", "key"}, {0}, "", 0}, /* of nodes that share a catalogue in PostgreSQL */
};
enum { TABLES = sizeof tables / sizeof tables[0] };
/* Tables that triggers fill, that are copied separately, or that only one database has. */
static const char *const others[] = {"total", "shape", "secret", "catalogue", "migrating", "sqlite_sequence", NULL};
/* Tables of a target in PostgreSQL that triggers or running nodes fill. */
static const char *const cleared[] = {"shape", "turn", "node", NULL};

typedef struct column {
  char name[64];
  int is_number;
} column;

typedef struct columns {
  column of[COLUMNS];
  int count;
} columns;

/* Of a table: how many rows, and the sum modulo 2 of their hashes, which does not depend on their order. */
typedef struct digest {
  int64_t rows;
  unsigned char sum[HASH];
} digest;

typedef struct copy {
  database *from, *to;
  const table *t;
  columns columns;
  digest read;
  void (*tell)(void *user, int64_t rows);
  void *user;
  int64_t rows; /* of all tables so far */
} copy;

static store_result failed(database *db, const char *what, const char *name, int code) {
  log_error("migrate: %s %s: %s", what, name, db->connection.driver->message(&db->connection));
  return code == SQL_FULL ? STORE_FULL : STORE_ERROR;
}

static int prepare(database *db, const char *sql, sql_statement *out) {
  int code = db->connection.driver->prepare(&db->connection, sql, out);
  if (code == SQL_OK) {
    sql_reset(out); /* as database_statement() does before each use */
  }
  return code;
}

static void finish(sql_statement *st) {
  if (st->driver && st->native) {
    st->driver->finish(st);
  }
}

static int is_in(const char *name, const char *const *list) {
  while (*list && strcmp(*list, name) != 0) {
    list++;
  }
  return *list != NULL;
}

static store_result read_columns(database *db, const table *t, columns *out) {
  sql_statement *st = database_statement(
      db, database_either(db, "SELECT name, type='INTEGER' FROM pragma_table_info(?1) ORDER BY cid",
                          "SELECT column_name::text, (data_type='bigint')::int FROM information_schema.columns"
                          " WHERE table_schema=current_schema() AND table_name=?1 ORDER BY ordinal_position"));
  int code = SQL_ERROR;
  out->count = 0;
  if (st) {
    sql_bind_text(st, 1, t->name);
    while ((code = sql_step(st)) == SQL_ROW && out->count < COLUMNS) {
      const char *name = sql_text(st, 0);
      if (name && !is_in(name, t->skip)) {
        column *c = &out->of[out->count++];
        snprintf(c->name, sizeof c->name, "%s", name);
        c->is_number = sql_int(st, 1);
      }
    }
    sql_reset(st);
  }
  return code == SQL_DONE ? STORE_OK : failed(db, "the columns cannot be read of", t->name, code);
}

/* The columns that both have: PostgreSQL may have more of its own, with defaults, for nodes that run. */
static store_result match_columns(copy *c) {
  columns there;
  store_result result = read_columns(c->from, c->t, &c->columns);
  result = result == STORE_OK ? read_columns(c->to, c->t, &there) : result;
  int kept = 0;
  for (int i = 0; result == STORE_OK && i < c->columns.count; i++) {
    int k = 0;
    while (k < there.count && strcmp(there.of[k].name, c->columns.of[i].name) != 0) {
      k++;
    }
    if (k < there.count) {
      c->columns.of[kept] = c->columns.of[i];
      c->columns.of[kept++].is_number = there.of[k].is_number;
    } else if (c->from->connection.driver != &sql_postgresql) {
      log_error("migrate: the target's %s has no column %s", c->t->name, c->columns.of[i].name);
      result = STORE_UNFIT;
    }
  }
  c->columns.count = kept;
  return result;
}

static void add_names(api_text *sql, const columns *list) {
  for (int i = 0; i < list->count; i++) {
    api_text_printf(sql, "%s%s", i ? ", " : "", list->of[i].name);
  }
}

static const char *second(const table *t) {
  return t->keys[1] ? t->keys[1] : "";
}

static const char *value_of(const table *t, const char *name) {
  for (size_t i = 0; strcmp(t->name, "job") == 0 && i < sizeof requeued / sizeof requeued[0]; i++) {
    if (strcmp(requeued[i].column, name) == 0) {
      return requeued[i].value;
    }
  }
  return name;
}

/* A page of rows: the first one, or what comes after a key. */
static int prepare_page(database *db, const copy *c, int first, sql_statement *out) {
  const char *comma = c->t->keys[1] ? ", " : "";
  api_text sql = {0};
  api_text_add(&sql, "SELECT ");
  for (int i = 0; i < c->columns.count; i++) {
    api_text_printf(&sql, "%s%s", i ? ", " : "", value_of(c->t, c->columns.of[i].name));
  }
  api_text_printf(&sql, " FROM %s", c->t->name);
  if (!first) {
    api_text_printf(&sql, " WHERE (%s%s%s)>(?1%s)", c->t->keys[0], comma, second(c->t), c->t->keys[1] ? ", ?2" : "");
  }
  api_text_printf(&sql, " ORDER BY %s%s%s LIMIT %d", c->t->keys[0], comma, second(c->t), (int)BATCH);
  int code = sql.failed ? SQL_NOMEM : prepare(db, sql.data, out);
  api_text_free(&sql);
  return code;
}

static int prepare_insert(const copy *c, sql_statement *out) {
  api_text sql = {0};
  api_text_printf(&sql, "INSERT INTO %s(", c->t->name);
  add_names(&sql, &c->columns);
  api_text_add(&sql, ") VALUES(");
  for (int i = 0; i < c->columns.count; i++) {
    api_text_printf(&sql, "%s?%d", i ? ", " : "", i + 1);
  }
  api_text_printf(&sql, ")%s", c->t->conflict);
  int code = sql.failed ? SQL_NOMEM : prepare(c->to, sql.data, out);
  api_text_free(&sql);
  return code;
}

/* A key, as text: where the next page begins. */
typedef struct key {
  char *part[2];
} key;

static void free_key(key *k) {
  free(k->part[0]);
  free(k->part[1]);
  memset(k, 0, sizeof *k);
}

static int find_column(const columns *list, const char *name) {
  int i = 0;
  while (i < list->count && strcmp(list->of[i].name, name) != 0) {
    i++;
  }
  return i < list->count ? i : -1;
}

static int note_key(const copy *c, sql_statement *row, key *out) {
  int fine = 1;
  free_key(out);
  for (int i = 0; i < 2 && c->t->keys[i]; i++) {
    int at = find_column(&c->columns, c->t->keys[i]);
    const char *text = at >= 0 ? sql_text(row, at) : NULL;
    out->part[i] = text ? strdup(text) : NULL;
    fine = fine && out->part[i];
  }
  return fine;
}

static void bind_key(const copy *c, sql_statement *st, const key *k) {
  for (int i = 0; i < 2 && c->t->keys[i]; i++) {
    int at = find_column(&c->columns, c->t->keys[i]);
    if (at >= 0 && c->columns.of[at].is_number) {
      sql_bind_integer(st, i + 1, strtoll(k->part[i], NULL, 10));
    } else {
      sql_bind_text(st, i + 1, k->part[i]);
    }
  }
}

static int add_to_digest(const copy *c, sql_statement *row, digest *sum) {
  crypto_hash_sha256_state state;
  unsigned char hash[HASH];
  int fine = 1;
  crypto_hash_sha256_init(&state);
  for (int i = 0; i < c->columns.count; i++) {
    int is_null = sql_is_null(row, i);
    const char *text = is_null ? "" : sql_text(row, i);
    const uint64_t length = text ? (uint64_t)strlen(text) : 0, head[2] = {is_null ? 1 : 0, length};
    fine = fine && text;
    crypto_hash_sha256_update(&state, (const unsigned char *)head, sizeof head);
    crypto_hash_sha256_update(&state, (const unsigned char *)text, length);
  }
  crypto_hash_sha256_final(&state, hash);
  for (int i = 0; i < HASH; i++) {
    sum->sum[i] ^= hash[i];
  }
  sum->rows++;
  return fine;
}

static int insert(const copy *c, sql_statement *row, sql_statement *st) {
  st->driver->clear(st);
  for (int i = 0; i < c->columns.count; i++) {
    if (sql_is_null(row, i)) {
      continue;
    }
    if (c->columns.of[i].is_number) {
      sql_bind_integer(st, i + 1, sql_integer(row, i));
    } else {
      sql_bind_text(st, i + 1, sql_text(row, i));
    }
  }
  int code = sql_step(st);
  sql_reset(st);
  return code == SQL_DONE || code == SQL_ROW ? SQL_OK : code;
}

/* Reads a page, adds it to the digest and, unless `to` is NULL, inserts it. *rows: how many. */
static store_result take_page(copy *c, database *db, sql_statement *page, sql_statement *to, key *last, digest *sum,
                              int *rows) {
  int code;
  *rows = 0;
  while ((code = sql_step(page)) == SQL_ROW) {
    int inserted = SQL_OK;
    if (!add_to_digest(c, page, sum) || !note_key(c, page, last) ||
        (to && (inserted = insert(c, page, to)) != SQL_OK)) {
      return to && inserted != SQL_OK ? failed(c->to, "a row cannot be written to", c->t->name, inserted)
                                      : failed(db, "a row cannot be read from", c->t->name, SQL_NOMEM);
    }
    ++*rows;
  }
  return code == SQL_DONE ? STORE_OK : failed(db, "rows cannot be read from", c->t->name, code);
}

/* Goes through all rows of the table in `db`, page by page. */
static store_result each_page(copy *c, database *db, sql_statement *to, digest *sum) {
  store_result result = STORE_OK;
  key last = {{NULL, NULL}};
  sql_statement page[2] = {{NULL, NULL}, {NULL, NULL}}; /* the first one, all others */
  if (prepare_page(db, c, 1, &page[0]) != SQL_OK || prepare_page(db, c, 0, &page[1]) != SQL_OK) {
    result = failed(db, "rows cannot be read from", c->t->name, SQL_ERROR);
  }
  for (int rows = BATCH, first = 1; result == STORE_OK && rows == BATCH; first = 0) {
    sql_statement *st = &page[!first];
    if (!first) {
      sql_reset(st);
      bind_key(c, st, &last);
    }
    if (to && database_execute(c->to, "BEGIN") != SQL_OK) {
      result = STORE_ERROR;
      break;
    }
    result = take_page(c, db, st, to, &last, sum, &rows);
    FAULT_POINT("move-batch");
    int code = !to ? SQL_OK : database_execute(c->to, result == STORE_OK ? "COMMIT" : "ROLLBACK");
    result = result == STORE_OK && code != SQL_OK ? (code == SQL_FULL ? STORE_FULL : STORE_ERROR) : result;
    if (to && result == STORE_OK) {
      c->rows += rows;
      c->tell(c->user, c->rows);
    }
  }
  sql_reset(&page[0]);
  sql_reset(&page[1]);
  finish(&page[0]);
  finish(&page[1]);
  free_key(&last);
  return result;
}

static store_result copy_table(copy *c) {
  sql_statement to = {NULL, NULL};
  memset(&c->read, 0, sizeof c->read);
  store_result result = match_columns(c);
  if (result == STORE_OK && prepare_insert(c, &to) != SQL_OK) {
    result = failed(c->to, "rows cannot be written to", c->t->name, SQL_ERROR);
  }
  result = result == STORE_OK ? each_page(c, c->from, &to, &c->read) : result;
  finish(&to);
  return result;
}

static store_result compare_table(copy *c) {
  digest there = {0};
  store_result result = each_page(c, c->to, NULL, &there);
  if (result == STORE_OK && (there.rows != c->read.rows || memcmp(there.sum, c->read.sum, HASH) != 0)) {
    log_error("migrate: the %lld rows of %s differ after they were copied (%lld rows there): run migrate again",
              (long long)c->read.rows, c->t->name, (long long)there.rows);
    result = STORE_ERROR;
  }
  return result;
}

/* New rows get numbers beyond all that were ever used, so cursors and event ids of clients stay valid. */
static store_result copy_number(copy *c) {
  char read[160], write[256];
  const char *name = c->t->name;
  sql_statement st = {NULL, NULL};
  int64_t number = 0;
  snprintf(read, sizeof read,
           database_either(c->from, "SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name='%s'",
                           "SELECT CASE WHEN is_called THEN last_value ELSE 0 END FROM %s_seq_seq"),
           name);
  int code = prepare(c->from, read, &st);
  code = code == SQL_OK ? sql_step(&st) : code;
  number = code == SQL_ROW ? sql_integer(&st, 0) : 0;
  finish(&st);
  if (code != SQL_ROW) {
    return failed(c->from, "the last number cannot be read of", name, code);
  }
  if (number <= 0) {
    return STORE_OK;
  }
  if (c->to->connection.driver == &sql_postgresql) {
    snprintf(write, sizeof write, "SELECT setval('%s_seq_seq', %lld)", name, (long long)number);
  } else {
    snprintf(write, sizeof write,
             "DELETE FROM sqlite_sequence WHERE name='%s'; INSERT INTO sqlite_sequence(name, seq) VALUES('%s', %lld)",
             name, name, (long long)number);
  }
  code = database_execute(c->to, write);
  return code == SQL_OK ? STORE_OK : STORE_ERROR;
}

static int has_table(database *db, const char *name) {
  sql_statement *st =
      database_statement(db, database_either(db, "SELECT 1 FROM sqlite_master WHERE type='table' AND name=?1",
                                             "SELECT 1 FROM information_schema.tables"
                                             " WHERE table_schema=current_schema() AND table_name=?1"));
  if (st) {
    sql_bind_text(st, 1, name);
  }
  int has = st && sql_step(st) == SQL_ROW;
  sql_reset(st);
  return has;
}

/* The source may have changed since an earlier run copied it. */
static store_result empty(database *to) {
  api_text sql = {0};
  int truncates = to->connection.driver == &sql_postgresql;
  api_text_add(&sql, truncates ? "BEGIN; TRUNCATE resource" : "BEGIN");
  for (int i = 0; truncates && cleared[i]; i++) {
    if (has_table(to, cleared[i])) {
      api_text_printf(&sql, ", %s", cleared[i]);
    }
  }
  for (int i = TABLES - 1; i >= truncates; i--) { /* resource, the first one, is named already */
    if (has_table(to, tables[i].name)) {
      api_text_printf(&sql, truncates ? ", %s" : "; DELETE FROM %s", tables[i].name);
    }
  }
  api_text_add(&sql, "; UPDATE total SET bytes=0; COMMIT");
  int code = sql.failed ? SQL_NOMEM : database_execute(to, sql.data);
  api_text_free(&sql);
  if (code != SQL_OK && sql_in_transaction(to)) {
    database_execute(to, "ROLLBACK");
  }
  return code == SQL_OK ? STORE_OK : STORE_ERROR;
}

/* A catalogue in SQLite has only tables of this program. A table that is missing in the lists above would be left
 * behind. */
static store_result check_tables(database *db) {
  sql_statement *st = db->connection.driver == &sql_postgresql
                          ? NULL
                          : database_statement(db, "SELECT name FROM sqlite_master WHERE type='table'");
  store_result result = STORE_OK;
  while (st && result == STORE_OK && sql_step(st) == SQL_ROW) {
    const char *name = sql_text(st, 0);
    int i = 0;
    while (name && i < TABLES && strcmp(tables[i].name, name) != 0) {
      i++;
    }
    if (!name || (i == TABLES && !is_in(name, others))) {
      log_error("migrate: the catalogue has a table %s, which this program does not know", name ? name : "");
      result = STORE_UNFIT;
    }
  }
  sql_reset(st);
  return result;
}

static store_result copy_secret(database *from, database *to) {
  char hex[2 * HASH + 1] = "", sql[256];
  sql_statement *st = database_statement(from, "SELECT bytes FROM secret");
  int size = 0;
  const void *bytes = st && sql_step(st) == SQL_ROW ? sql_bytes(st, 0, &size) : NULL;
  if (bytes && size > 0 && size <= HASH) {
    sodium_bin2hex(hex, sizeof hex, bytes, (size_t)size);
  }
  sql_reset(st);
  if (!*hex) {
    return failed(from, "the secret cannot be read of", "the catalogue", SQL_CORRUPT);
  }
  /* The log shows the first 60 characters of a statement that fails; the secret comes later. */
  snprintf(sql, sizeof sql, "UPDATE secret SET bytes=%50s%s%s%s", "", database_either(to, "X'", "decode('"), hex,
           database_either(to, "'", "', 'hex')"));
  int code = database_execute(to, sql);
  sodium_memzero(hex, sizeof hex);
  sodium_memzero(sql, sizeof sql);
  return code == SQL_OK ? STORE_OK : STORE_ERROR;
}

store_result move_rows(database *from, database *to, void (*tell)(void *user, int64_t rows), void *user) {
  copy c = {.from = from, .to = to, .tell = tell, .user = user};
  store_result result = check_tables(from);
  result = result == STORE_OK ? empty(to) : result;
  for (int i = 0; i < TABLES && result == STORE_OK; i++) {
    c.t = &tables[i];
    if (!has_table(from, c.t->name) || !has_table(to, c.t->name)) {
      continue;
    }
    result = copy_table(&c);
    result = result == STORE_OK ? compare_table(&c) : result;
    result = result == STORE_OK && tables[i].numbered ? copy_number(&c) : result;
  }
  return result == STORE_OK ? copy_secret(from, to) : result;
}
