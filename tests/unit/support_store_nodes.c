#include "support_store_nodes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const char *const node_names[2] = {"11111111111111111111111111111111", "22222222222222222222222222222222"};

int nodes_new_catalogue(char url[NODES_URL]) {
  static int count;
  char command[256];
  snprintf(command, sizeof command, "%s shared-%d-%d", getenv("ORB_NEW_CATALOGUE"), (int)getpid(), ++count);
  FILE *out = popen(command, "r");
  int fine = out && fgets(url, NODES_URL, out);
  return out && pclose(out) == 0 && fine;
}

int nodes_setup(void **state) {
  nodes *n = calloc(1, sizeof *n);
  if (!nodes_new_catalogue(n->url)) {
    return -1;
  }
  for (int i = 0; i < 2; i++) {
    int fresh;
    if (catalogue_open_shared(n->url, 1, &n->cat[i]) != STORE_OK || !(n->bell[i] = notices_open(n->url)) ||
        !notices_connect(n->bell[i], &fresh) || !notices_renew(n->bell[i], node_names[i], 1, 60000)) {
      return -1;
    }
  }
  *state = n;
  return 0;
}

int nodes_teardown(void **state) {
  nodes *n = *state;
  for (int i = 0; i < 2; i++) {
    catalogue_close(n->cat[i]);
    notices_close(n->bell[i]);
  }
  free(n);
  return 0;
}

void nodes_fill(char *out, char digit) {
  memset(out, digit, API_ID_SIZE - 1);
  out[API_ID_SIZE - 1] = 0;
}
