#include "token_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/routes.h"
#include "store/tokens.h"

static const struct {
  const char *name;
  int scope;
} scopes[] = {{"read", SCOPE_READ}, {"write", SCOPE_WRITE}, {"admin", SCOPE_ADMIN}};
enum { SCOPES = sizeof scopes / sizeof scopes[0] };

static int read_scopes(const char *text, int *out) {
  *out = 0;
  for (const char *at = text; *at;) {
    size_t n = strcspn(at, ","), i = 0;
    while (i < SCOPES && (strlen(scopes[i].name) != n || strncmp(scopes[i].name, at, n) != 0)) {
      i++;
    }
    if (i == SCOPES) {
      return 0;
    }
    *out |= scopes[i].scope;
    at += n + (at[n] == ',');
  }
  return *out != 0;
}

static int wrong(const char *why) {
  fprintf(stderr,
          "orbmorphd token: %s\n"
          "  orbmorphd token add NAME --scope read,write,admin [--quota BYTES]\n"
          "  orbmorphd token list | token remove NAME\n",
          why);
  return 0;
}

/* A name is a word of up to 63 letters, digits, '-', '_' and '.'. */
static int good_name(const char *name) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  return name && *name && *name != '-' && strlen(name) < 64 && name[strspn(name, letters)] == 0;
}

int token_command_read(token_command *out, int *argc, char **argv) {
  const char *verb = *argc > 2 ? argv[2] : "";
  int from = 3, kept = 1;
  memset(out, 0, sizeof *out);
  out->verb = strcmp(verb, "add") == 0 ? TOKEN_ADD : strcmp(verb, "remove") == 0 ? TOKEN_REMOVE : TOKEN_LIST;
  if (out->verb == TOKEN_LIST && strcmp(verb, "list") != 0) {
    return wrong("say add, list or remove");
  }
  if (out->verb != TOKEN_LIST) {
    out->name = *argc > 3 ? argv[3] : NULL;
    from = 4;
    if (!good_name(out->name)) {
      return wrong("a NAME is needed, of up to 63 letters, digits, '-', '_' and '.'");
    }
  }
  for (int i = from; i < *argc; i++) {
    int scope = strcmp(argv[i], "--scope") == 0, quota = strcmp(argv[i], "--quota") == 0;
    if (out->verb != TOKEN_ADD || (!scope && !quota)) {
      argv[kept++] = argv[i];
    } else if (++i == *argc || (scope && !read_scopes(argv[i], &out->scopes)) ||
               (quota && !config_number(argv[i], &out->quota))) {
      return wrong(scope ? "--scope takes read, write and admin, comma-separated" : "--quota takes a number of bytes");
    }
  }
  if (out->verb == TOKEN_ADD && !out->scopes) {
    return wrong("--scope is needed");
  }
  *argc = kept;
  return 1;
}

static int add(const token_command *command, catalogue *cat) {
  unsigned char token[TOKEN_BYTES];
  char text[TOKEN_TEXT];
  token_row row = {.scopes = command->scopes, .quota = command->quota, .created = (int64_t)time(NULL) * 1000};
  snprintf(row.name, sizeof row.name, "%s", command->name);
  randombytes_buf(token, sizeof token);
  crypto_hash_sha256(row.hash, token, sizeof token);
  sodium_bin2hex(text, sizeof text, token, sizeof token);
  store_result result = catalogue_token_add(cat, &row);
  if (result == STORE_OK) {
    puts(text); /* shown this once */
  } else if (result == STORE_CONFLICT) {
    fprintf(stderr, "orbmorphd: there is a token \"%s\" already; remove it first\n", row.name);
  }
  return result == STORE_OK ? 0 : 1;
}

static int list(catalogue *cat) {
  int count;
  token_row *rows = catalogue_tokens(cat, &count);
  for (int i = 0; i < count; i++) {
    char names[32] = "";
    for (size_t k = 0; k < SCOPES; k++) {
      if (rows[i].scopes & scopes[k].scope) {
        size_t n = strlen(names);
        snprintf(names + n, sizeof names - n, "%s%s", n ? "," : "", scopes[k].name);
      }
    }
    printf("%s %s uploaded=%lld quota=%lld\n", rows[i].name, names, (long long)rows[i].used, (long long)rows[i].quota);
  }
  free(rows);
  return count < 0;
}

int token_command_run(const token_command *command, const config *options) {
  catalogue *cat = NULL;
  if (catalogue_open(options->data, &cat) != STORE_OK) {
    return 1;
  }
  int result = 1;
  if (command->verb == TOKEN_ADD) {
    result = add(command, cat);
  } else if (command->verb == TOKEN_LIST) {
    result = list(cat);
  } else {
    result = catalogue_token_remove(cat, command->name) != STORE_OK;
    if (result) {
      fprintf(stderr, "orbmorphd: there is no token \"%s\"\n", command->name);
    }
  }
  catalogue_close(cat);
  return result;
}
