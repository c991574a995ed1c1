#include "store/webhooks.h"

#include <string.h>
#include <time.h>

#include "store/rows.h"

void webhook_new_secret(char out[WEBHOOK_SECRET]) {
  static const char prefix[] = "whsec_";
  unsigned char bytes[32];
  memcpy(out, prefix, sizeof prefix);
  randombytes_buf(bytes, sizeof bytes);
  sodium_bin2base64(out + sizeof prefix - 1, WEBHOOK_SECRET - (sizeof prefix - 1), bytes, sizeof bytes,
                    sodium_base64_VARIANT_ORIGINAL);
  sodium_memzero(bytes, sizeof bytes);
}

static void own_name(const char *tenant, char out[WEBHOOK_NAME]) {
  snprintf(out, WEBHOOK_NAME, "@%.63s", tenant);
}

static int add_row(database *db, void *arg) {
  const webhook_row *row = arg;
  sql_statement *st = database_statement(db,
                                         "INSERT INTO webhook(name, tenant, url, origin, events, secret, created)"
                                         " SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7 WHERE ?3='' OR (SELECT count(*) FROM "
                                         "webhook WHERE tenant=?2 AND url<>'') < ?8"
                                         " ON CONFLICT DO NOTHING");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, row->name);
  sql_bind_text(st, 2, row->tenant);
  sql_bind_text(st, 3, row->url);
  sql_bind_text(st, 4, row->origin);
  sql_bind_integer(st, 5, row->events);
  sql_bind_text(st, 6, row->secret);
  sql_bind_integer(st, 7, row->created);
  sql_bind_integer(st, 8, WEBHOOKS_OF_TENANT);
  int code = database_run(db, st);
  return code == SQL_OK && sql_changes(db) == 0 ? SQL_CONSTRAINT : code;
}

store_result catalogue_webhook_add(catalogue *cat, const webhook_row *row) {
  return catalogue_write(cat, add_row, (void *)(uintptr_t)row);
}

int webhook_ensure_secret(database *db, const char *tenant) {
  webhook_row row = {.created = (int64_t)time(NULL) * 1000};
  own_name(tenant, row.name);
  snprintf(row.tenant, sizeof row.tenant, "%s", tenant);
  webhook_new_secret(row.secret);
  int code = add_row(db, &row);
  sodium_memzero(row.secret, sizeof row.secret);
  return code == SQL_CONSTRAINT ? SQL_OK : code; /* the row exists */
}

store_result catalogue_webhook_rotate(catalogue *cat, const char *name, const char *secret, int64_t old_until) {
  return rows_rotate(cat, "UPDATE webhook SET old_secret=secret, old_until=?3, secret=?2 WHERE name=?1", name, secret,
                     old_until);
}

static int remove_row(database *db, void *arg) {
  sql_statement *st = database_statement(db, "DELETE FROM webhook WHERE name=?1");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, arg);
  int code = database_run(db, st);
  if (code != SQL_OK || sql_changes(db) == 0) {
    return code == SQL_OK ? SQL_NOTFOUND : code;
  }
  st = database_statement(db,
                          "UPDATE delivery SET state=2, error='the webhook was removed', ended=?2"
                          " WHERE webhook=?1 AND state=0");
  if (!st) {
    return SQL_ERROR;
  }
  sql_bind_text(st, 1, arg);
  sql_bind_integer(st, 2, (int64_t)time(NULL) * 1000);
  code = database_run(db, st);
  static const char *const steps[] = {
      "DELETE FROM receiver WHERE NOT EXISTS(SELECT 1 FROM delivery WHERE state=0 AND receiver=receiver.name)",
      "UPDATE receiver SET next=(SELECT min(next) FROM delivery WHERE state=0 AND receiver=receiver.name)"};
  for (int i = 0; i < 2 && code == SQL_OK; i++) {
    code = database_run(db, database_statement(db, steps[i]));
  }
  return code;
}

store_result catalogue_webhook_remove(catalogue *cat, const char *name) {
  return catalogue_write(cat, remove_row, (void *)(uintptr_t)name);
}

typedef struct secret_arg {
  const char *tenant;
  char *secret;
} secret_arg;

static int own_secret(database *db, void *arg) {
  secret_arg *own = arg;
  char name[WEBHOOK_NAME];
  own_name(own->tenant, name);
  int code = webhook_ensure_secret(db, own->tenant);
  sql_statement *st = code == SQL_OK ? database_statement(db, "SELECT secret FROM webhook WHERE name=?1") : NULL;
  if (!st) {
    return code == SQL_OK ? SQL_ERROR : code;
  }
  sql_bind_text(st, 1, name);
  code = sql_step(st);
  if (code == SQL_ROW) {
    row_text(st, 0, own->secret, WEBHOOK_SECRET);
  }
  sql_reset(st);
  return code == SQL_ROW ? SQL_OK : code == SQL_DONE ? SQL_ERROR : code;
}

store_result catalogue_webhook_secret(catalogue *cat, const char *tenant, char out[WEBHOOK_SECRET]) {
  secret_arg own = {.tenant = tenant, .secret = out};
  out[0] = 0;
  return catalogue_write(cat, own_secret, &own);
}

static int read_row(sql_statement *st, void *to) {
  webhook_row *row = to;
  memset(row, 0, sizeof *row);
  row_text(st, 0, row->name, sizeof row->name);
  row_text(st, 1, row->tenant, sizeof row->tenant);
  row_text(st, 2, row->url, sizeof row->url);
  row->events = (unsigned)sql_int(st, 3);
  row->old_until = sql_integer(st, 4);
  row->created = sql_integer(st, 5);
  return 1;
}

webhook_row *catalogue_webhooks(catalogue *cat, int *count) {
  static const row_kind kind = {.read = read_row, .size = sizeof(webhook_row)};
  database *db = catalogue_reader(cat);
  return rows_all(cat, db,
                  database_statement(db,
                                     "SELECT name, tenant, url, events, old_until, created FROM webhook"
                                     " WHERE url<>'' ORDER BY name"),
                  &kind, count);
}
