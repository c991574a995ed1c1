/* Lists with a filter. Each query reads only rows that match, through an index: (kind, id) for a prefix of the id, and
 * the table "shape" for a mesh or a name. */
#include <stdio.h>

#include "store/rows.h"

enum { KEY_MOST = 128 }; /* bytes of an id or of a name, with its end */

#define ALL_COLUMNS "r.seq, r.kind, r.id, r.sha, " ROW_SUMMARY("r.kind", "r.json") ", r.bytes, r.created, r.places"
#define OWN_COLUMNS \
  "o.seq, r.kind, r.id, r.sha, " ROW_SUMMARY("r.kind", "coalesce(o.json, r.json)") ", r.bytes, o.created, r.places"
/* ?1 kind, ?2 before, ?3 limit, ?4 view, ?5 prefix; ?6 and ?7 keys of shapes, ?7 or NULL. */
#define PREFIXED " r.kind=?1 AND r.id>=?5 AND r.id<?5 || 'g'"
#define SHAPED                                                                                          \
  " s.view=?4 AND s.key=?6 AND s.seq<?2 AND substr(r.id, 1, length(?5))=?5"                             \
  " AND (?7 IS NULL OR EXISTS(SELECT 1 FROM shape t WHERE t.view=s.view AND t.key=?7 AND t.seq=s.seq))" \
  " ORDER BY s.seq DESC LIMIT ?3"

static const char *query_of(int shaped, int owned) {
  if (shaped) {
    return owned ? "SELECT " OWN_COLUMNS
                   " FROM shape s JOIN owner o ON o.seq=s.seq"
                   " JOIN resource r ON r.kind=o.kind AND r.id=o.id WHERE" SHAPED
                 : "SELECT " ALL_COLUMNS " FROM shape s JOIN resource r ON r.seq=s.seq WHERE" SHAPED;
  }
  return owned ? "SELECT " OWN_COLUMNS
                 " FROM resource r CROSS JOIN owner o" /* CROSS JOIN makes SQLite keep this order */
                 " WHERE o.kind=r.kind AND o.id=r.id AND o.tenant=?4 AND" PREFIXED
                 " AND o.seq<?2 ORDER BY o.seq DESC LIMIT ?3"
               : "SELECT " ALL_COLUMNS " FROM resource r WHERE" PREFIXED " AND r.seq<?2 ORDER BY r.seq DESC LIMIT ?3";
}

int catalogue_list_some(catalogue *cat, resource_kind kind, const char *view, const list_filter *filter, int64_t before,
                        int limit, resource *out) {
  char keys[2][5 + KEY_MOST];
  int count = 0, shaped = filter->mesh || filter->name;
  if (filter->mesh) {
    snprintf(keys[count++], sizeof keys[0], "mesh:%s", filter->mesh);
  }
  if (filter->name) {
    snprintf(keys[count++], sizeof keys[0], "name:%s", filter->name);
  }
  database *db = catalogue_reader(cat);
  sql_statement *st = database_statement(db, query_of(shaped, view[0] != 0));
  if (st) {
    sql_bind_integer(st, 1, (int)kind);
    sql_bind_integer(st, 2, before > 0 ? before : INT64_MAX);
    sql_bind_integer(st, 3, limit);
    sql_bind_text(st, 4, view);
    sql_bind_text(st, 5, filter->prefix ? filter->prefix : "");
    for (int i = 0; shaped && i < count; i++) {
      sql_bind_text(st, 6 + i, keys[i]);
    }
  }
  return rows_many(cat, db, st, &resource_rows, out, limit);
}
