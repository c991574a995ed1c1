#include "support_store.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int stored_setup(void **state) {
  stored *s = calloc(1, sizeof *s);
  strcpy(s->data, access("/dev/shm", W_OK) == 0 ? "/dev/shm/orbmorph-store-XXXXXX" : "/tmp/orbmorph-store-XXXXXX");
  if (!mkdtemp(s->data) || objects_open(s->data, &s->store) != STORE_OK ||
      catalogue_open(s->data, &s->cat) != STORE_OK) {
    return -1;
  }
  *state = s;
  return 0;
}

int stored_teardown(void **state) {
  stored *s = *state;
  char command[128];
  catalogue_close(s->cat);
  objects_close(s->store);
  snprintf(command, sizeof command, "rm -rf %s", s->data);
  int failed = system(command);
  free(s);
  return failed;
}
