#include "store/tokens.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "store/rows.h"

int token_hash(const char *text, unsigned char hash[TOKEN_BYTES]) {
  unsigned char token[TOKEN_BYTES];
  size_t size = 0;
  if (strlen(text) != TOKEN_TEXT - 1 ||
      sodium_hex2bin(token, sizeof token, text, TOKEN_TEXT - 1, NULL, &size, NULL) != 0 || size != sizeof token) {
    return 0;
  }
  crypto_hash_sha256(hash, token, sizeof token);
  sodium_memzero(token, sizeof token);
  return 1;
}

void token_instant(int64_t seconds, char out[TOKEN_INSTANT]) {
  time_t at = (time_t)seconds;
  struct tm parts;
  if (!gmtime_r(&at, &parts) || !strftime(out, TOKEN_INSTANT, "%Y-%m-%dT%H:%M:%SZ", &parts)) {
    out[0] = 0;
  }
}

static int add_row(database *db, void *arg) {
  const token_row *row = arg;
  char hash[TOKEN_TEXT];
  sql_statement *st =
      database_statement(db,
                         "INSERT INTO token(hash, name, scopes, quota_bytes, quota_jobs, created, priority, tenant,"
                         " expires, quota_derived)"
                         " VALUES(?1, ?2, ?3, ?4, ?6, ?5, ?7, ?8, ?9, ?10) ON CONFLICT DO NOTHING");
  if (!st) {
    return SQL_ERROR;
  }
  sodium_bin2hex(hash, sizeof hash, row->hash, sizeof row->hash);
  sql_bind_text(st, 1, hash);
  sql_bind_text(st, 2, row->name);
  sql_bind_integer(st, 3, row->scopes);
  sql_bind_integer(st, 4, row->quota);
  sql_bind_integer(st, 5, row->created);
  sql_bind_integer(st, 6, row->jobs);
  sql_bind_integer(st, 7, row->priority);
  sql_bind_text(st, 8, row->tenant);
  sql_bind_integer(st, 9, row->expires);
  sql_bind_integer(st, 10, row->quota_derived);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_CONSTRAINT : code;
}

store_result catalogue_token_add(catalogue *cat, const token_row *row) {
  return catalogue_write(cat, add_row, (void *)(uintptr_t)row);
}

static int set_row(database *db, void *arg) {
  const token_row *row = arg;
  sql_statement *st =
      database_statement(db,
                         "UPDATE token SET scopes=iif(?2<0, scopes, ?2),"
                         " quota_bytes=iif(?3<0, quota_bytes, ?3), quota_jobs=iif(?4<0, quota_jobs, ?4),"
                         " priority=iif(?5<0, priority, ?5), expires=iif(?6<0, expires, ?6),"
                         " quota_derived=iif(?7<0, quota_derived, ?7) WHERE name=?1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, row->name);
  sql_bind_integer(st, 2, row->scopes);
  sql_bind_integer(st, 3, row->quota);
  sql_bind_integer(st, 4, row->jobs);
  sql_bind_integer(st, 5, row->priority);
  sql_bind_integer(st, 6, row->expires);
  sql_bind_integer(st, 7, row->quota_derived);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

store_result catalogue_token_set(catalogue *cat, const token_row *row) {
  return catalogue_write(cat, set_row, (void *)(uintptr_t)row);
}

static int remove_row(database *db, void *arg) {
  sql_statement *st = database_statement(db, "DELETE FROM token WHERE name=?1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, arg);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_NOTFOUND : code;
}

store_result catalogue_token_remove(catalogue *cat, const char *name) {
  return catalogue_write(cat, remove_row, (void *)(uintptr_t)name);
}

static int read_row(sql_statement *st, void *out) {
  token_row *row = out;
  char hash[TOKEN_TEXT];
  row_text(st, 0, hash, sizeof hash);
  sodium_hex2bin(row->hash, sizeof row->hash, hash, strlen(hash), NULL, NULL, NULL);
  row_text(st, 1, row->name, sizeof row->name);
  row->scopes = sql_int(st, 2);
  row->quota = sql_integer(st, 3);
  row->used = sql_integer(st, 4);
  row->created = sql_integer(st, 5);
  row->jobs = sql_integer(st, 6);
  row->priority = sql_int(st, 7);
  row_text(st, 8, row->tenant, sizeof row->tenant);
  row->expires = sql_integer(st, 9);
  row->quota_derived = sql_integer(st, 10);
  row->derived = sql_integer(st, 11);
  return 1;
}

token_row *catalogue_tokens(catalogue *cat, int *count) {
  static const row_kind kind = {.read = read_row, .size = sizeof(token_row)};
  database *db = catalogue_reader(cat);
  sql_statement *st =
      database_statement(db,
                         "SELECT hash, token.name, scopes, quota_bytes, coalesce(bytes, 0), created,"
                         " quota_jobs, priority, tenant, expires, quota_derived, coalesce(derived+requests, 0)"
                         " FROM token"
                         " LEFT JOIN tenant ON tenant.name=token.tenant ORDER BY token.name");
  return rows_all(cat, db, st, &kind, count);
}
