/* The schema of the catalogue in PostgreSQL, as steps: each brings it from a version to the next. */
#ifndef ORB_STORE_POSTGRESQL_SCHEMA_H
#define ORB_STORE_POSTGRESQL_SCHEMA_H

extern const char *const postgresql_migrations[];
extern const int postgresql_schema; /* the latest version */

#endif
