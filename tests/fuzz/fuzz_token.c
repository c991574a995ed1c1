/* Lines of the control socket, carried out on a catalogue of tokens as in the daemon, and the token of a request. The
 * target creates the data folder in $TMPDIR; run.sh removes it. */
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "admin/kinds.h"
#include "store/tokens.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerInitialize(int *argc, char ***argv);

static catalogue *cat;

int LLVMFuzzerInitialize(int *argc, char ***argv) {
  char folder[80];
  const char *base = getenv("TMPDIR");
  (void)argc;
  (void)argv;
  snprintf(folder, sizeof folder, "%.60s/fuzz-XXXXXX", base ? base : "/tmp");
  if (sodium_init() < 0 || !mkdtemp(folder) || catalogue_open(folder, &cat) != STORE_OK) {
    abort();
  }
  return 0;
}

/* The catalogue has terminated names, no more than allowed, and each name once. */
static void check_tokens(int clear) {
  int count;
  token_row *rows = catalogue_tokens(cat, &count);
  if (count < 0) {
    abort();
  }
  for (int i = 0; i < count; i++) {
    if (!memchr(rows[i].name, 0, sizeof rows[i].name) || (i > 0 && strcmp(rows[i - 1].name, rows[i].name) >= 0)) {
      abort();
    }
    if (clear && catalogue_token_remove(cat, rows[i].name) != STORE_OK) {
      abort();
    }
  }
  free(rows);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char *text = strndup((const char *)data, size), *at = text;
  for (char *line; at && (line = strsep(&at, "\n"));) {
    unsigned char hash[TOKEN_BYTES];
    api_text reply = {0};
    int status = admin_token.apply(cat, line, &reply);
    if (status < 0 || status > 2 || (status == 2 && reply.size == 0)) {
      abort();
    }
    api_text_free(&reply);
    if (token_hash(line, hash) && strlen(line) != TOKEN_TEXT - 1) {
      abort();
    }
    check_tokens(0);
  }
  check_tokens(1);
  free(text);
  return 0;
}
