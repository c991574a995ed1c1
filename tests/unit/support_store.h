/* A store in its own folder, created before each test and removed after it. Its catalogue is in PostgreSQL if the test
 * runs under tests/tools/with_postgresql.sh. */
#ifndef SUPPORT_STORE_H
#define SUPPORT_STORE_H

#include <stdint.h>

#include "store/catalogue.h"
#include "store/objects.h"

typedef struct stored {
  char data[64];
  char url[256]; /* of the catalogue in PostgreSQL; "": it is in SQLite */
  objects *store;
  catalogue *cat;
  int64_t number; /* starts at 0; free for the test to use */
} stored;

/* Opens the catalogue, which is closed. */
store_result stored_open(stored *s);
/* For cmocka_unit_test_setup_teardown(): *state points to the struct above. */
int stored_setup(void **state);
int stored_teardown(void **state);

#endif
