#include "store/sql.h"

const char *sql_reason(int code) {
  static const char *const reasons[SQL_CODES] = {
      [SQL_OK] = "not an error",
      [SQL_ROW] = "another row available",
      [SQL_DONE] = "no more rows available",
      [SQL_ERROR] = "SQL logic error",
      [SQL_CONSTRAINT] = "constraint failed",
      [SQL_NOTFOUND] = "no such row",
      [SQL_LOST] = "the lock of objects was lost",
      [SQL_NOMEM] = "out of memory",
      [SQL_FULL] = "database or disk is full",
      [SQL_IOERR] = "disk I/O error",
      [SQL_BUSY] = "database is locked",
      [SQL_READONLY] = "attempt to write a readonly database",
      [SQL_CANTOPEN] = "unable to open database file",
      [SQL_CORRUPT] = "database disk image is malformed",
      [SQL_NOTADB] = "file is not a database",
      [SQL_SCHEMA] = "the schema is newer than this program",
      [SQL_UNFINISHED] = "orbmorphd migrate has not ended there: run it again",
  };
  return code >= 0 && code < SQL_CODES ? reasons[code] : "unknown error";
}
