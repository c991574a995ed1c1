#include "store/database.h"

#include <stdio.h>
#include <string.h>

#include "faults.h"
#include "log.h"
#include "store/postgresql_schema.h"

/* The schema in SQLite: each entry brings it from version i to i + 1. Add each step to postgresql_schema.c as well. */
static const char *const migrations[] = {
    "CREATE TABLE resource(seq INTEGER PRIMARY KEY AUTOINCREMENT, kind INTEGER NOT NULL, id TEXT NOT NULL,"
    " sha TEXT NOT NULL, json TEXT NOT NULL, bytes INTEGER NOT NULL, created INTEGER NOT NULL, used INTEGER NOT NULL,"
    " UNIQUE(kind, id));"
    "CREATE INDEX resource_used ON resource(used);"
    "CREATE TABLE job(seq INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, key TEXT NOT NULL,"
    " kind INTEGER NOT NULL, state INTEGER NOT NULL, attempt INTEGER NOT NULL, crashes INTEGER NOT NULL DEFAULT 0,"
    " suspect INTEGER NOT NULL DEFAULT 0, alone INTEGER NOT NULL DEFAULT 0, listed INTEGER NOT NULL,"
    " priority INTEGER NOT NULL, cost INTEGER NOT NULL, owner TEXT NOT NULL, request TEXT NOT NULL, problem TEXT,"
    " created INTEGER NOT NULL, started INTEGER NOT NULL DEFAULT 0, finished INTEGER NOT NULL DEFAULT 0);"
    "CREATE INDEX job_state ON job(state, seq);"
    "CREATE TABLE event(job TEXT NOT NULL, number INTEGER NOT NULL, type TEXT NOT NULL, json TEXT NOT NULL,"
    " PRIMARY KEY(job, number)) WITHOUT ROWID;"
    "CREATE TABLE token(hash TEXT PRIMARY KEY, name TEXT NOT NULL UNIQUE, scopes INTEGER NOT NULL,"
    " quota_bytes INTEGER NOT NULL, quota_jobs INTEGER NOT NULL, created INTEGER NOT NULL);",
    "ALTER TABLE token ADD COLUMN used_bytes INTEGER NOT NULL DEFAULT 0;",
    "ALTER TABLE token ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;",
    /* Owners. Existing resources belong to the tenants whose jobs made or named them, all others to "". */
    "CREATE TABLE owner(seq INTEGER PRIMARY KEY AUTOINCREMENT, kind INTEGER NOT NULL, id TEXT NOT NULL,"
    " tenant TEXT NOT NULL, json TEXT, bytes INTEGER NOT NULL, created INTEGER NOT NULL, UNIQUE(kind, id, tenant),"
    " FOREIGN KEY(kind, id) REFERENCES resource(kind, id) ON DELETE CASCADE);"
    "CREATE INDEX owner_tenant ON owner(tenant, kind, seq);"
    "CREATE TABLE tenant(name TEXT PRIMARY KEY, bytes INTEGER NOT NULL DEFAULT 0) WITHOUT ROWID;"
    "CREATE TRIGGER owner_added AFTER INSERT ON owner BEGIN"
    " INSERT INTO tenant(name) SELECT NEW.tenant WHERE NOT EXISTS(SELECT 1 FROM tenant WHERE name=NEW.tenant);"
    " UPDATE tenant SET bytes=bytes+NEW.bytes WHERE name=NEW.tenant; END;"
    "CREATE TRIGGER owner_removed AFTER DELETE ON owner BEGIN"
    " UPDATE tenant SET bytes=bytes-OLD.bytes WHERE name=OLD.tenant; END;"
    "CREATE INDEX job_owner ON job(owner, seq);"
    "ALTER TABLE token ADD COLUMN tenant TEXT NOT NULL DEFAULT '';"
    "UPDATE token SET tenant=name;"
    "ALTER TABLE token DROP COLUMN used_bytes;"
    "CREATE TEMP TABLE claim AS"
    " SELECT kind+1 AS kind, key AS id, owner AS tenant FROM job WHERE state=2 UNION"
    " SELECT 0, json_extract(request, '$.mesh'), owner FROM job WHERE kind=0 AND json_valid(request) UNION"
    " SELECT 0, json_extract(shape.value, '$.mesh'), owner FROM job,"
    "  json_each(iif(json_valid(request), request, '{}'), '$.shapes') AS shape WHERE job.kind=1;"
    "INSERT INTO owner(kind, id, tenant, bytes, created)"
    " SELECT r.kind, r.id, c.tenant, iif(r.kind=0, r.bytes, 0), r.created"
    " FROM resource r JOIN temp.claim c ON c.kind=r.kind AND c.id=r.id ORDER BY r.seq, c.tenant;"
    "INSERT INTO owner(kind, id, tenant, bytes, created)"
    " SELECT kind, id, '', iif(kind=0, bytes, 0), created FROM resource r"
    " WHERE NOT EXISTS(SELECT 1 FROM owner o WHERE o.kind=r.kind AND o.id=r.id) ORDER BY seq;"
    "DROP TABLE temp.claim;",
    /* Stored bytes of each kind, so that no query has to sum over all rows. */
    "CREATE TABLE total(kind INTEGER PRIMARY KEY, bytes INTEGER NOT NULL);"
    "INSERT INTO total(kind, bytes) VALUES(0, 0), (1, 0), (2, 0);"
    "UPDATE total SET bytes=(SELECT coalesce(sum(r.bytes), 0) FROM resource r WHERE r.kind=total.kind);"
    "CREATE TRIGGER resource_added AFTER INSERT ON resource BEGIN"
    " UPDATE total SET bytes=bytes+NEW.bytes WHERE kind=NEW.kind; END;"
    "CREATE TRIGGER resource_removed AFTER DELETE ON resource BEGIN"
    " UPDATE total SET bytes=bytes-OLD.bytes WHERE kind=OLD.kind; END;"
    "CREATE TRIGGER resource_changed AFTER UPDATE OF kind, bytes ON resource BEGIN"
    " UPDATE total SET bytes=bytes-OLD.bytes WHERE kind=OLD.kind;"
    " UPDATE total SET bytes=bytes+NEW.bytes WHERE kind=NEW.kind; END;",
    "CREATE TABLE secret(bytes BLOB NOT NULL);"
    "INSERT INTO secret(bytes) VALUES(randomblob(16));",
    /* The hash of a supermesh's places, for --check-data. */
    "ALTER TABLE resource ADD COLUMN places TEXT NOT NULL DEFAULT '';",
    /* `seed` no longer exists, and the daemon would refuse a request with it: remove it from jobs that still wait. */
    "UPDATE job SET request=json_remove(request, '$.align.options.seed')"
    " WHERE kind=1 AND state IN (0, 1) AND json_valid(request);",
    /* Landmarks. */
    "INSERT INTO total(kind, bytes) VALUES(3, 0);",
    /* Signing keys, and the key that the work of a job counts for. */
    "CREATE TABLE signing_key(name TEXT PRIMARY KEY, tenant TEXT NOT NULL, secret TEXT NOT NULL,"
    " old_secret TEXT NOT NULL DEFAULT '', old_until INTEGER NOT NULL DEFAULT 0, origins TEXT NOT NULL,"
    " requests INTEGER NOT NULL, cpu_seconds INTEGER NOT NULL, created INTEGER NOT NULL,"
    " day INTEGER NOT NULL DEFAULT 0, used_requests INTEGER NOT NULL DEFAULT 0, used_ms INTEGER NOT NULL DEFAULT 0)"
    " WITHOUT ROWID;"
    "ALTER TABLE job ADD COLUMN charged TEXT NOT NULL DEFAULT '';",
    /* For lists of supermeshes by the mesh or the name of a shape: "mesh:ID" and "name:NAME" of each shape in each
     * view. seq is that of the list: of the owner's row, or for the view "" of all, of the resource's. */
    "CREATE VIEW shape_of(seq, key) AS SELECT r.seq, k.column1 || ':' || (s.value->>k.column1)"
    " FROM resource r, json_each(iif(json_valid(r.json), r.json, '{}'), '$.shapes') s, (VALUES('mesh'), ('name')) k"
    " WHERE r.kind=2 AND s.value->>k.column1 NOTNULL;"
    "CREATE TABLE shape(view TEXT NOT NULL, key TEXT NOT NULL, seq INTEGER NOT NULL, PRIMARY KEY(view, key, seq))"
    " WITHOUT ROWID;"
    "CREATE INDEX shape_seq ON shape(view, seq);"
    "CREATE TRIGGER shape_added AFTER INSERT ON resource WHEN NEW.kind=2 BEGIN"
    " INSERT OR IGNORE INTO shape(view, key, seq) SELECT '', key, seq FROM shape_of WHERE seq=NEW.seq; END;"
    "CREATE TRIGGER shape_removed AFTER DELETE ON resource WHEN OLD.kind=2 BEGIN"
    " DELETE FROM shape WHERE view='' AND seq=OLD.seq; END;"
    "CREATE TRIGGER shape_owned AFTER INSERT ON owner WHEN NEW.kind=2 AND NEW.tenant!='' BEGIN"
    " INSERT INTO shape(view, key, seq) SELECT NEW.tenant, s.key, NEW.seq"
    "  FROM resource r JOIN shape s ON s.view='' AND s.seq=r.seq WHERE r.kind=NEW.kind AND r.id=NEW.id; END;"
    "CREATE TRIGGER shape_disowned AFTER DELETE ON owner WHEN OLD.kind=2 AND OLD.tenant!='' BEGIN"
    " DELETE FROM shape WHERE view=OLD.tenant AND seq=OLD.seq; END;"
    "INSERT OR IGNORE INTO shape(view, key, seq) SELECT '', key, seq FROM shape_of;"
    "INSERT INTO shape(view, key, seq) SELECT o.tenant, s.key, o.seq FROM owner o"
    " JOIN resource r ON r.kind=o.kind AND r.id=o.id JOIN shape s ON s.view='' AND s.seq=r.seq"
    " WHERE o.kind=2 AND o.tenant!='';",
    /* The hashes of the profiles of a supermesh's asset. */
    "ALTER TABLE resource ADD COLUMN quantized TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE resource ADD COLUMN meshopt TEXT NOT NULL DEFAULT '';",
    /* Meshes from URLs, whose ids only the end of the job knows; webhooks and their outbox. */
    "ALTER TABLE job ADD COLUMN result TEXT NOT NULL DEFAULT '';"
    "CREATE TABLE webhook(name TEXT PRIMARY KEY, tenant TEXT NOT NULL, url TEXT NOT NULL, origin TEXT NOT NULL,"
    " events INTEGER NOT NULL, secret TEXT NOT NULL, old_secret TEXT NOT NULL DEFAULT '',"
    " old_until INTEGER NOT NULL DEFAULT 0, created INTEGER NOT NULL) WITHOUT ROWID;"
    "CREATE INDEX webhook_tenant ON webhook(tenant);"
    "CREATE TABLE job_webhook(job TEXT NOT NULL, url TEXT NOT NULL, origin TEXT NOT NULL, events INTEGER NOT NULL,"
    " PRIMARY KEY(job, url)) WITHOUT ROWID;"
    "CREATE TABLE delivery(seq INTEGER PRIMARY KEY AUTOINCREMENT, job TEXT NOT NULL, number INTEGER NOT NULL,"
    " webhook TEXT NOT NULL, receiver TEXT NOT NULL, url TEXT NOT NULL, type TEXT NOT NULL, body TEXT NOT NULL,"
    " state INTEGER NOT NULL DEFAULT 0, attempts INTEGER NOT NULL DEFAULT 0, tried INTEGER NOT NULL DEFAULT 0,"
    " status INTEGER NOT NULL DEFAULT 0, error TEXT NOT NULL DEFAULT '', next INTEGER NOT NULL,"
    " created INTEGER NOT NULL, ended INTEGER NOT NULL DEFAULT 0, UNIQUE(job, number));"
    "CREATE INDEX delivery_pending ON delivery(receiver, next) WHERE state=0;"
    "CREATE INDEX delivery_webhook ON delivery(webhook) WHERE state=0;"
    "CREATE TABLE receiver(name TEXT PRIMARY KEY, tenant TEXT NOT NULL, next INTEGER NOT NULL) WITHOUT ROWID;"
    "CREATE INDEX receiver_next ON receiver(next);",
    /* Alignments. */
    "INSERT INTO total(kind, bytes) VALUES(4, 0);",
    /* Deaths of processes, by the key of their work. */
    "CREATE TABLE crash(key TEXT PRIMARY KEY, mesh TEXT NOT NULL, tenant TEXT NOT NULL, count INTEGER NOT NULL,"
    " last INTEGER NOT NULL) WITHOUT ROWID;",
    /* When a token expires, as a Unix time in seconds; 0: never. */
    "ALTER TABLE token ADD COLUMN expires INTEGER NOT NULL DEFAULT 0;",
    /* What tenants use: bytes of the derived resources that they own, and time of workers. */
    "ALTER TABLE owner ADD COLUMN derived INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE tenant ADD COLUMN derived INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE tenant ADD COLUMN worker_ms INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE token ADD COLUMN quota_derived INTEGER NOT NULL DEFAULT 0;"
    "UPDATE owner SET derived=(SELECT r.bytes FROM resource r WHERE r.kind=owner.kind AND r.id=owner.id)"
    " WHERE kind IN (1, 2);"
    "UPDATE tenant SET derived=(SELECT coalesce(sum(o.derived), 0) FROM owner o WHERE o.tenant=tenant.name);"
    "DROP TRIGGER owner_added;"
    "DROP TRIGGER owner_removed;"
    "CREATE TRIGGER owner_added AFTER INSERT ON owner BEGIN"
    " INSERT INTO tenant(name) SELECT NEW.tenant WHERE NOT EXISTS(SELECT 1 FROM tenant WHERE name=NEW.tenant);"
    " UPDATE tenant SET bytes=bytes+NEW.bytes, derived=derived+NEW.derived WHERE name=NEW.tenant; END;"
    "CREATE TRIGGER owner_removed AFTER DELETE ON owner BEGIN"
    " UPDATE tenant SET bytes=bytes-OLD.bytes, derived=derived-OLD.derived WHERE name=OLD.tenant; END;"
    "CREATE TRIGGER owner_grown AFTER UPDATE OF derived ON owner BEGIN"
    " UPDATE tenant SET derived=derived+NEW.derived-OLD.derived WHERE name=NEW.tenant; END;"
    "CREATE TRIGGER resource_grown AFTER UPDATE OF bytes ON resource WHEN NEW.kind IN (1, 2, 4) BEGIN"
    " UPDATE owner SET derived=NEW.bytes WHERE kind=NEW.kind AND id=NEW.id; END;",
    /* The span that a job belongs to. */
    "ALTER TABLE job ADD COLUMN trace TEXT NOT NULL DEFAULT '';",
    /* Places may be in the file of spheres (RESOURCE_PLACES_JOINED), which earlier programs do not know. */
    "SELECT 1;",
    /* Each tenant has its own count of a key's deaths. Those so far stay with the tenant of the last one. */
    "ALTER TABLE crash RENAME TO old_crash;"
    "CREATE TABLE crash(key TEXT NOT NULL, mesh TEXT NOT NULL, tenant TEXT NOT NULL, count INTEGER NOT NULL,"
    " last INTEGER NOT NULL, PRIMARY KEY(key, tenant)) WITHOUT ROWID;"
    "INSERT INTO crash(key, mesh, tenant, count, last) SELECT key, mesh, tenant, count, last FROM old_crash;"
    "DROP TABLE old_crash;",
    /* The request of a job is kept until it ends, and counts for its owner. */
    "ALTER TABLE tenant ADD COLUMN requests INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE job ADD COLUMN request_bytes INTEGER NOT NULL DEFAULT 0;"
    "CREATE TRIGGER job_added AFTER INSERT ON job WHEN NEW.request_bytes>0 BEGIN"
    " INSERT INTO tenant(name) SELECT NEW.owner WHERE NOT EXISTS(SELECT 1 FROM tenant WHERE name=NEW.owner);"
    " UPDATE tenant SET requests=requests+NEW.request_bytes WHERE name=NEW.owner; END;"
    "CREATE TRIGGER job_removed AFTER DELETE ON job WHEN OLD.request_bytes>0 BEGIN"
    " UPDATE tenant SET requests=requests-OLD.request_bytes WHERE name=OLD.owner; END;"
    "CREATE TRIGGER job_changed AFTER UPDATE OF request_bytes ON job BEGIN"
    " UPDATE tenant SET requests=requests+NEW.request_bytes-OLD.request_bytes WHERE name=NEW.owner; END;"
    "INSERT INTO tenant(name) SELECT DISTINCT owner FROM job WHERE state<2 AND owner NOT IN (SELECT name FROM tenant);"
    "UPDATE job SET request_bytes=length(CAST(request AS BLOB)) WHERE state<2;"
    "UPDATE job SET request='{}' WHERE state>=2;",
};
enum { SCHEMA = sizeof migrations / sizeof migrations[0] };

int database_execute(database *db, const char *sql) {
  return db->connection.driver->execute(&db->connection, sql);
}

int database_is_url(const char *where) {
  return strncmp(where, "postgresql://", 13) == 0;
}

int database_open(const char *where, int writer, database *out) {
  memset(out, 0, sizeof *out);
  const sql_driver *driver = database_is_url(where) ? &sql_postgresql : &sql_sqlite;
  int code = driver->open(where, writer, &out->connection);
  if (code != SQL_OK) {
    database_close(out);
  }
  return code;
}

void database_close(database *db) {
  for (int i = 0; i < DATABASE_STATEMENTS; i++) {
    if (db->cached[i].statement.driver) {
      db->cached[i].statement.driver->finish(&db->cached[i].statement);
    }
  }
  if (db->connection.driver) {
    db->connection.driver->close(&db->connection);
  }
  memset(db, 0, sizeof *db);
}

sql_statement *database_statement(database *db, const char *sql) {
  const sql_driver *driver = db->connection.driver;
  int i = 0;
  while (i < DATABASE_STATEMENTS - 1 && db->cached[i].sql && db->cached[i].sql != sql) {
    i++;
  }
  sql_statement *st = &db->cached[i].statement;
  if (db->cached[i].sql != sql) {
    if (st->driver) {
      driver->finish(st);
    }
    db->cached[i].sql = NULL;
    if (driver->prepare(&db->connection, sql, st) != SQL_OK) {
      log_error("catalogue: %s: %s", sql, driver->message(&db->connection));
      return NULL;
    }
    db->cached[i].sql = sql;
  }
  driver->reset(st);
  driver->clear(st);
  return st;
}

int database_run(database *db, sql_statement *statement) {
  if (!statement) {
    return SQL_ERROR;
  }
  int code = sql_step(statement);
  sql_reset(statement);
  if (code == SQL_DONE || code == SQL_ROW) {
    return SQL_OK;
  }
  log_error("catalogue: %s", db->connection.driver->message(&db->connection));
  return code;
}

/* Logs an error that no caller expects. A lost connection is the business of those who repeat the transaction. */
static int complain(const database *db, int code) {
  const int lost = code == SQL_IOERR && db->connection.driver == &sql_postgresql;
  if (code != SQL_OK && code != SQL_CONSTRAINT && code != SQL_LOST && !lost) {
    log_error("catalogue: %s", db->connection.driver->message(&db->connection));
  }
  return code;
}

int database_run_later(database *db, sql_statement *statement, sql_expect expect) {
  if (!statement) {
    return SQL_ERROR;
  }
  return complain(db, sql_later(statement, expect));
}

int database_settle(database *db) {
  return complain(db, db->connection.driver->settle(&db->connection));
}

int database_begin(database *db) {
  return db->connection.driver->begin(&db->connection);
}

/* One step of the schema in one transaction. */
static int migrate_to(database *db, int version, const char *step) {
  char mark[64];
  FAULT_POINT("migrate");
  snprintf(mark, sizeof mark, "%s%d", database_either(db, "PRAGMA user_version=", "UPDATE catalogue SET schema="),
           version);
  int code = database_execute(db, database_either(db, "BEGIN IMMEDIATE", "BEGIN; SET LOCAL statement_timeout=0"));
  code = code == SQL_OK ? database_execute(db, step) : code;
  code = code == SQL_OK ? database_execute(db, mark) : code;
  code = code == SQL_OK ? database_execute(db, "COMMIT") : code;
  if (code != SQL_OK) {
    database_execute(db, "ROLLBACK");
  }
  return code;
}

int database_migrate(database *db) {
  const sql_driver *driver = db->connection.driver;
  const char *const *steps = driver == &sql_postgresql ? postgresql_migrations : migrations;
  int version = 0, latest = driver == &sql_postgresql ? postgresql_schema : (int)SCHEMA;
  int code = driver->version(&db->connection, &version);
  if (code == SQL_OK && version > latest) {
    log_error("the catalogue has schema %d, but this program supports up to %d: install a newer version", version,
              latest);
    return SQL_SCHEMA;
  }
  if (code == SQL_OK && version > 0 && version < latest) {
    code = driver->exclude(&db->connection);
    if (code == SQL_BUSY) {
      log_error(
          "the catalogue has the older schema %d, and daemons that need it run: stop them before you start this "
          "version, which makes it %d",
          version, latest);
      return SQL_SCHEMA;
    }
  }
  for (; code == SQL_OK && version < latest; version++) {
    code = migrate_to(db, version + 1, steps[version]);
  }
  return code == SQL_OK ? driver->hold(&db->connection) : code;
}
