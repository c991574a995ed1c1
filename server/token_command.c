#include "token_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/routes.h"
#include "control.h"
#include "store/tokens.h"

static const struct {
  const char *name;
  int scope;
} scopes[] = {{"read", SCOPE_READ}, {"write", SCOPE_WRITE}, {"admin", SCOPE_ADMIN}};
enum { TOKEN_LINE = 384, SCOPES = sizeof scopes / sizeof scopes[0] };

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
          "  orbmorphd token add NAME --scope read,write,admin [--tenant NAME] [--quota BYTES]"
          " [--quota-jobs N] [--priority 0..9]\n"
          "  orbmorphd token set NAME [--scope …] [--quota …] [--quota-jobs …] [--priority …]\n"
          "  orbmorphd token list | token remove NAME\n",
          why);
  return 0;
}

/* A name has 1 to 63 letters, digits, '-', '_' and '.', and does not begin with '-'. */
static int good_name(const char *name) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  return name && *name && *name != '-' && strlen(name) < 64 && name[strspn(name, letters)] == 0;
}

/* Reads one of the command's own flags. 1: read; 0: not one of them; −1: invalid value. */
static int read_flag(token_command *out, const char *flag, const char *value) {
  int64_t number;
  if (strcmp(flag, "--scope") == 0) {
    return value && read_scopes(value, &out->scopes) ? 1 : -1;
  }
  if (strcmp(flag, "--tenant") == 0 && strcmp(out->verb, "add") == 0) {
    out->tenant = value;
    return good_name(value) ? 1 : -1;
  }
  int64_t *to = strcmp(flag, "--quota") == 0        ? &out->quota
                : strcmp(flag, "--quota-jobs") == 0 ? &out->jobs
                : strcmp(flag, "--priority") == 0   ? &out->priority
                                                    : NULL;
  if (!to) {
    return 0;
  }
  if (!value || !config_number(value, &number) || (to == &out->priority && number > 9)) {
    return -1;
  }
  *to = number;
  return 1;
}

int token_command_read(token_command *out, int *argc, char **argv) {
  static const char *const verbs[] = {"add", "set", "remove", "list"};
  const char *verb = *argc > 2 ? argv[2] : "";
  int from = 3, kept = 1, which = 0;
  while (which < 4 && strcmp(verb, verbs[which]) != 0) {
    which++;
  }
  if (which == 4) {
    return wrong("the command must be add, set, list or remove");
  }
  *out = (token_command){.verb = verbs[which], .name = "-", .scopes = -1, .quota = -1, .jobs = -1, .priority = -1};
  int adds = which == 0, sets = which == 1;
  if (which < 3) {
    out->name = *argc > 3 ? argv[3] : NULL;
    from = 4;
    if (!good_name(out->name)) {
      return wrong("NAME must have 1 to 63 letters, digits, '-', '_' and '.', and not begin with '-'");
    }
  }
  for (int i = from; i < *argc; i++) {
    int taken = adds || sets ? read_flag(out, argv[i], i + 1 < *argc ? argv[i + 1] : NULL) : 0;
    if (taken < 0) {
      return wrong("--scope takes read, write and admin, comma-separated; --tenant takes a name; the others a number");
    }
    if (taken) {
      i++;
    } else {
      argv[kept++] = argv[i];
    }
  }
  if (adds && out->scopes < 0) {
    return wrong("--scope is required");
  }
  *argc = kept;
  return 1;
}

static int list(catalogue *cat, api_text *reply) {
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
    int other = strcmp(rows[i].tenant, rows[i].name) != 0;
    api_text_printf(reply, "%s %s uploaded=%lld quota=%lld quota-jobs=%lld priority=%d%s%s\n", rows[i].name, names,
                    (long long)rows[i].used, (long long)rows[i].quota, (long long)rows[i].jobs, rows[i].priority,
                    other ? " tenant=" : "", other ? rows[i].tenant : "");
  }
  free(rows);
  return count < 0;
}

int token_command_apply(catalogue *cat, const char *line, api_text *reply) {
  char verb[8], hash[TOKEN_TEXT];
  long long quota, jobs;
  token_row row = {.created = (int64_t)time(NULL) * 1000};
  if (sscanf(line, "token %7s %63s %d %lld %lld %d %63s %64s", verb, row.name, &row.scopes, &quota, &jobs,
             &row.priority, row.tenant, hash) != 8) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  row.quota = quota;
  row.jobs = jobs;
  if (strcmp(row.tenant, "-") == 0) {
    memcpy(row.tenant, row.name, sizeof row.tenant);
  }
  if (strcmp(verb, "list") == 0) {
    return list(cat, reply);
  }
  store_result result = STORE_ERROR;
  if (strcmp(verb, "add") == 0) {
    row.quota = quota > 0 ? quota : 0;
    row.jobs = jobs > 0 ? jobs : 0;
    row.priority = row.priority > 0 ? row.priority : 0;
    if (sodium_hex2bin(row.hash, sizeof row.hash, hash, strlen(hash), NULL, NULL, NULL) == 0) {
      result = catalogue_token_add(cat, &row);
    }
  } else if (strcmp(verb, "set") == 0) {
    result = catalogue_token_set(cat, &row);
  } else if (strcmp(verb, "remove") == 0) {
    result = catalogue_token_remove(cat, row.name);
  }
  if (result == STORE_CONFLICT) {
    api_text_printf(reply, "a token \"%s\" already exists; change it with set, or remove it\n", row.name);
  } else if (result == STORE_NOT_FOUND) {
    api_text_printf(reply, "token \"%s\" does not exist\n", row.name);
  } else if (result != STORE_OK) {
    api_text_add(reply, "the catalogue could not be written; the log says why\n");
  }
  return result != STORE_OK;
}

/* Writes the command as a line. A new token is made here; only its hash leaves this process. */
static void write_line(const token_command *command, char line[TOKEN_LINE], char text[TOKEN_TEXT]) {
  unsigned char token[TOKEN_BYTES], hashed[TOKEN_BYTES];
  char hash[TOKEN_TEXT];
  randombytes_buf(token, sizeof token);
  crypto_hash_sha256(hashed, token, sizeof token);
  sodium_bin2hex(text, TOKEN_TEXT, token, sizeof token);
  sodium_bin2hex(hash, sizeof hash, hashed, sizeof hashed);
  sodium_memzero(token, sizeof token);
  snprintf(line, TOKEN_LINE, "token %s %s %d %lld %lld %d %s %s", command->verb, command->name, command->scopes,
           (long long)command->quota, (long long)command->jobs, (int)command->priority,
           command->tenant ? command->tenant : "-", hash);
}

static int show(const token_command *command, int status, const api_text *reply, const char *text) {
  if (status != 0) {
    fprintf(stderr, "orbmorphd: %s", reply->data ? reply->data : "the command failed; the log says why\n");
  } else if (strcmp(command->verb, "add") == 0) {
    puts(text); /* the only time that the token is shown */
  } else {
    fputs(reply->data ? reply->data : "", stdout);
  }
  return status;
}

int token_command_ask(const token_command *command, const config *options) {
  char line[TOKEN_LINE], text[TOKEN_TEXT];
  api_text reply = {0};
  write_line(command, line, text);
  int status = control_ask(options->data, line, &reply);
  if (status >= 0) {
    show(command, status, &reply, text);
  }
  api_text_free(&reply);
  return status;
}

int token_command_run(const token_command *command, const config *options) {
  char line[TOKEN_LINE], text[TOKEN_TEXT];
  catalogue *cat = NULL;
  api_text reply = {0};
  if (catalogue_open(options->data, &cat) != STORE_OK) {
    return 1;
  }
  write_line(command, line, text);
  int status = show(command, token_command_apply(cat, line, &reply), &reply, text);
  api_text_free(&reply);
  catalogue_close(cat);
  return status;
}
