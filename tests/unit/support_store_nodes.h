/* Two nodes on one new schema in PostgreSQL. Needs tests/tools/with_postgresql.sh. */
#ifndef SUPPORT_STORE_NODES_H
#define SUPPORT_STORE_NODES_H

#include "store/catalogue.h"
#include "store/notices.h"

enum { NODES_URL = 256 };

typedef struct nodes {
  char url[NODES_URL];
  catalogue *cat[2];
  notices *bell[2];
} nodes;

extern const char *const node_names[2];

/* For cmocka_unit_test_setup_teardown(): *state points to the struct above. */
int nodes_setup(void **state);
int nodes_teardown(void **state);

/* The URL of a new, empty schema; 0: it could not be created. */
int nodes_new_catalogue(char url[NODES_URL]);

/* An id of one repeated digit. */
void nodes_fill(char *out, char digit);

#endif
