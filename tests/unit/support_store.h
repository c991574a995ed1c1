/* A store in its own folder, created before each test and removed after it. */
#ifndef SUPPORT_STORE_H
#define SUPPORT_STORE_H

#include <stdint.h>

#include "store/catalogue.h"
#include "store/objects.h"

typedef struct stored {
  char data[64];
  objects *store;
  catalogue *cat;
  int64_t number; /* starts at 0; free for the test to use */
} stored;

/* For cmocka_unit_test_setup_teardown(): *state points to the struct above. */
int stored_setup(void **state);
int stored_teardown(void **state);

#endif
