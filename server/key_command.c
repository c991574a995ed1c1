#include "key_command.h"

#include <inttypes.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "control.h"
#include "store/keys.h"

enum { KEY_LINE = 1024, DAY_S = 86400 };
static const int64_t OVERLAP_STANDARD = 7 * DAY_S;

static int wrong(const char *why) {
  fprintf(stderr,
          "orbmorphd key: %s\n"
          "  orbmorphd key add NAME [--tenant NAME] [--origin URL]… [--requests-per-day N] [--cpu-seconds-per-day N]\n"
          "  orbmorphd key rotate NAME [--overlap 7d]\n"
          "  orbmorphd key list | key remove NAME\n",
          why);
  return 0;
}

/* A name has 1 to 63 letters, digits, '-', '_' and '.', and does not begin with '-'. */
static int good_name(const char *name) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  return name && *name && *name != '-' && strlen(name) < 64 && name[strspn(name, letters)] == 0;
}

/* A number of seconds, or of minutes, hours or days with m, h or d. */
static int read_span(const char *text, int64_t *out) {
  char *end;
  long long number = text && *text >= '0' && *text <= '9' ? strtoll(text, &end, 10) : -1;
  if (number < 0 || number > 36500) {
    return 0;
  }
  int64_t unit = strcmp(end, "d") == 0 ? DAY_S : strcmp(end, "h") == 0 ? 3600 : strcmp(end, "m") == 0 ? 60 : 1;
  *out = number * unit;
  return unit > 1 || strcmp(end, "s") == 0 || *end == 0;
}

/* An origin as browsers send it: http or https, a host, optionally a port. */
static int add_origin(key_command *out, const char *origin) {
  size_t used = strlen(out->origins), size = origin ? strlen(origin) : 0;
  size_t scheme = !origin ? 0 : strncmp(origin, "http://", 7) == 0 ? 7 : strncmp(origin, "https://", 8) == 0 ? 8 : 0;
  if (!scheme || size <= scheme || strpbrk(origin + scheme, "/, \t\n?#@") || used + size + 2 > sizeof out->origins) {
    return -1;
  }
  snprintf(out->origins + used, sizeof out->origins - used, "%s%s", used ? "," : "", origin);
  return 1;
}

/* Reads one of the command's own flags. 1: read; 0: not one of them; −1: invalid value. */
static int read_flag(key_command *out, const char *flag, const char *value) {
  int adds = strcmp(out->verb, "add") == 0;
  if (!adds) {
    return strcmp(flag, "--overlap") != 0 ? 0 : read_span(value, &out->overlap) ? 1 : -1;
  }
  if (strcmp(flag, "--origin") == 0) {
    return add_origin(out, value);
  }
  if (strcmp(flag, "--tenant") == 0) {
    out->tenant = value;
    return good_name(value) ? 1 : -1;
  }
  int64_t *to = strcmp(flag, "--requests-per-day") == 0      ? &out->requests
                : strcmp(flag, "--cpu-seconds-per-day") == 0 ? &out->cpu_seconds
                                                             : NULL;
  return !to ? 0 : value && config_number(value, to) ? 1 : -1;
}

int key_command_read(key_command *out, int *argc, char **argv) {
  static const char *const verbs[] = {"add", "rotate", "remove", "list"};
  const char *verb = *argc > 2 ? argv[2] : "";
  int from = 3, kept = 1, which = 0;
  while (which < 4 && strcmp(verb, verbs[which]) != 0) {
    which++;
  }
  if (which == 4) {
    return wrong("the command must be add, rotate, list or remove");
  }
  *out = (key_command){.verb = verbs[which], .name = "-", .overlap = OVERLAP_STANDARD};
  if (which < 3) {
    out->name = *argc > 3 ? argv[3] : NULL;
    from = 4;
    if (!good_name(out->name)) {
      return wrong("NAME must have 1 to 63 letters, digits, '-', '_' and '.', and not begin with '-'");
    }
  }
  for (int i = from; i < *argc; i++) {
    int taken = which < 2 ? read_flag(out, argv[i], i + 1 < *argc ? argv[i + 1] : NULL) : 0;
    if (taken < 0) {
      return wrong(
          "--origin takes an origin such as https://app.example.org, --tenant a name, --overlap a time such as "
          "7d or 12h, the others a number");
    }
    if (taken) {
      i++;
    } else {
      argv[kept++] = argv[i];
    }
  }
  *argc = kept;
  return 1;
}

/* What was used today, and the limit if there is one. */
static void write_use(api_text *reply, const char *name, int64_t used, int64_t limit) {
  api_text_printf(reply, " %s=%lld", name, (long long)used);
  if (limit > 0) {
    api_text_printf(reply, "/%lld", (long long)limit);
  }
}

static int list(catalogue *cat, api_text *reply) {
  int count;
  int64_t now = (int64_t)time(NULL);
  catalogue_key_settle(cat);
  key_row *rows = catalogue_keys(cat, &count);
  for (int i = 0; i < count; i++) {
    const key_row *row = &rows[i];
    int today = row->day == now / DAY_S;
    api_text_printf(reply, "%s tenant=%s origins=%s", row->name, row->tenant, row->origins[0] ? row->origins : "*");
    write_use(reply, "requests", today ? row->used_requests : 0, row->requests);
    write_use(reply, "cpu-seconds", today ? row->used_ms / 1000 : 0, row->cpu_seconds);
    if (row->old_secret[0] && row->old_until > now) {
      api_text_printf(reply, " old-secret-valid-for=%llds", (long long)(row->old_until - now));
    }
    api_text_add(reply, "\n");
  }
  if (rows) {
    sodium_memzero(rows, (size_t)count * sizeof *rows);
  }
  free(rows);
  return count < 0;
}

int key_command_apply(catalogue *cat, const char *line, api_text *reply) {
  char verb[8];
  int64_t overlap;
  key_row row = {.created = (int64_t)time(NULL) * 1000};
  if (sscanf(line, "key %7s %63s %" SCNd64 " %" SCNd64 " %" SCNd64 " %63s %64s %511s", verb, row.name, &row.requests,
             &row.cpu_seconds, &overlap, row.tenant, row.secret, row.origins) != 8) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  if (strcmp(row.tenant, "-") == 0) {
    memcpy(row.tenant, row.name, sizeof row.tenant);
  }
  if (strcmp(row.origins, "-") == 0) {
    row.origins[0] = 0;
  }
  if (strcmp(verb, "list") == 0) {
    return list(cat, reply);
  }
  store_result result = STORE_ERROR;
  if (strcmp(verb, "add") == 0) {
    result = catalogue_key_add(cat, &row);
  } else if (strcmp(verb, "rotate") == 0) {
    result = catalogue_key_rotate(cat, row.name, row.secret, (int64_t)time(NULL) + overlap);
  } else if (strcmp(verb, "remove") == 0) {
    result = catalogue_key_remove(cat, row.name);
  }
  sodium_memzero(row.secret, sizeof row.secret);
  if (result == STORE_CONFLICT) {
    api_text_printf(reply, "a key \"%s\" already exists; give it a new secret with rotate, or remove it\n", row.name);
  } else if (result == STORE_NOT_FOUND) {
    api_text_printf(reply, "key \"%s\" does not exist\n", row.name);
  } else if (result != STORE_OK) {
    api_text_add(reply, "the catalogue could not be written; the log says why\n");
  }
  return result != STORE_OK;
}

/* Writes the command as a line, with a new secret. */
static void write_line(const key_command *command, char line[KEY_LINE], char secret[KEY_SECRET]) {
  unsigned char bytes[(KEY_SECRET - 1) / 2];
  randombytes_buf(bytes, sizeof bytes);
  sodium_bin2hex(secret, KEY_SECRET, bytes, sizeof bytes);
  sodium_memzero(bytes, sizeof bytes);
  snprintf(line, KEY_LINE, "key %s %s %" PRId64 " %" PRId64 " %" PRId64 " %s %s %s", command->verb, command->name,
           command->requests, command->cpu_seconds, command->overlap, command->tenant ? command->tenant : "-", secret,
           command->origins[0] ? command->origins : "-");
}

static int show(const key_command *command, int status, const api_text *reply, const char *secret) {
  if (status != 0) {
    fprintf(stderr, "orbmorphd: %s", reply->data ? reply->data : "the command failed; the log says why\n");
  } else if (strcmp(command->verb, "add") == 0 || strcmp(command->verb, "rotate") == 0) {
    printf("%s:%s\n", command->name, secret); /* the only time that the secret is shown */
  } else {
    fputs(reply->data ? reply->data : "", stdout);
  }
  return status;
}

int key_command_ask(const key_command *command, const config *options) {
  char line[KEY_LINE], secret[KEY_SECRET];
  api_text reply = {0};
  write_line(command, line, secret);
  int status = control_ask(options->data, line, &reply);
  if (status >= 0) {
    show(command, status, &reply, secret);
  }
  api_text_free(&reply);
  return status;
}

int key_command_run(const key_command *command, const config *options) {
  char line[KEY_LINE], secret[KEY_SECRET];
  catalogue *cat = NULL;
  api_text reply = {0};
  if (catalogue_open(options->data, &cat) != STORE_OK) {
    return 1;
  }
  write_line(command, line, secret);
  int status = show(command, key_command_apply(cat, line, &reply), &reply, secret);
  api_text_free(&reply);
  catalogue_close(cat);
  return status;
}
