/* A store in a folder of its own, made before each test and removed after it. */
#ifndef SUPPORT_STORE_H
#define SUPPORT_STORE_H

#include <stdint.h>

#include "store/catalogue.h"
#include "store/objects.h"

typedef struct stored {
  char data[64];
  objects *store;
  catalogue *cat;
  int64_t number; /* 0 at first; for a test's own use */
} stored;

/* For cmocka_unit_test_setup_teardown(): *state is the stored one. */
int stored_setup(void **state);
int stored_teardown(void **state);

#endif
