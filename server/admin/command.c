#include "admin/command.h"

#include <inttypes.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "audit.h"
#include "control.h"
#include "store/place.h"

enum { ADMIN_LINE = 1024 }; /* as long as a line that control.c reads */

const admin_kind *admin_kind_named(const admin_kind *const *kinds, const char *name) {
  while (*kinds && strcmp((*kinds)->name, name) != 0) {
    kinds++;
  }
  return *kinds;
}

int admin_read_name(const char *value, char word[ADMIN_WORD]) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  snprintf(word, ADMIN_WORD, "%s", value);
  return *value && *value != '-' && strlen(value) < 64 && value[strspn(value, letters)] == 0;
}

int admin_read_number(const char *value, char word[ADMIN_WORD]) {
  int64_t number;
  int fine = config_number(value, &number);
  if (fine) {
    snprintf(word, ADMIN_WORD, "%" PRId64, number);
  }
  return fine;
}

int admin_read_span(const char *value, char word[ADMIN_WORD]) {
  char *end;
  long long number = *value >= '0' && *value <= '9' ? strtoll(value, &end, 10) : -1;
  if (number < 0 || number > 36500) {
    return 0;
  }
  int64_t unit = strcmp(end, "d") == 0 ? 86400 : strcmp(end, "h") == 0 ? 3600 : strcmp(end, "m") == 0 ? 60 : 1;
  snprintf(word, ADMIN_WORD, "%lld", number * unit);
  return unit > 1 || strcmp(end, "s") == 0 || *end == 0;
}

static int wrong(const admin_kind *kind, const char *subject, const char *why) {
  fprintf(stderr, "orbmorphd %s: %s%s\n%s", kind->name, subject, why, kind->usage);
  return 0;
}

static int wrong_value(const admin_kind *kind, const admin_flag *flag, const char *value) {
  fprintf(stderr, "orbmorphd %s: %s takes %s, not \"%s\"\n%s", kind->name, flag->name, flag->takes, value, kind->usage);
  return 0;
}

static int wrong_verb(const admin_kind *kind) {
  char why[128] = "the command must be ";
  for (const admin_verb *verb = kind->verbs; verb->name; verb++) {
    size_t n = strlen(why);
    snprintf(why + n, sizeof why - n, "%s%s", verb == kind->verbs ? "" : verb[1].name ? ", " : " or ", verb->name);
  }
  return wrong(kind, "", why);
}

/* The row of a flag that the verb takes, or −1. */
static int find_flag(const admin_command *command, const char *name) {
  const admin_flag *flags = command->kind->flags;
  unsigned verb = 1U << (command->verb - command->kind->verbs);
  for (int i = 0; i < ADMIN_FLAGS && flags[i].name; i++) {
    if (*name && strcmp(flags[i].name, name) == 0 && flags[i].taken & verb) {
      return i;
    }
  }
  return -1;
}

/* Words of flags that were not given. 0: one of them is needed. */
static int fill_words(admin_command *command) {
  const admin_flag *flags = command->kind->flags;
  unsigned verb = 1U << (command->verb - command->kind->verbs);
  for (int i = 0; i < ADMIN_FLAGS && flags[i].name; i++) {
    if (!command->words[i][0] && flags[i].needed & verb) {
      return wrong(command->kind, flags[i].name, " is required");
    }
    if (!command->words[i][0] && *flags[i].name) {
      snprintf(command->words[i], ADMIN_WORD, "%s", flags[i].standard);
    }
  }
  return 1;
}

int admin_command_needs_data(const admin_command *command) {
  return command->kind && !command->verb->makes;
}

int admin_command_read(admin_command *out, const admin_kind *kind, int *argc, char **argv) {
  const admin_verb *verb = kind->verbs;
  char word[ADMIN_WORD];
  int kept = 1, from = 3;
  while (verb->name && (*argc < 3 || strcmp(argv[2], verb->name) != 0)) {
    verb++;
  }
  if (!verb->name) {
    return wrong_verb(kind);
  }
  *out = (admin_command){.kind = kind, .verb = verb, .name = "-"};
  if (verb->named) {
    out->name = *argc > from ? argv[from++] : "";
    const int is_id =
        kind->takes_ids && strlen(out->name) == 64 && out->name[strspn(out->name, "0123456789abcdef")] == 0;
    if (!is_id && !admin_read_name(out->name, word)) {
      return wrong(kind, "NAME", " must have 1 to 63 letters, digits, '-', '_' and '.', and not begin with '-'");
    }
  }
  for (int i = from; i < *argc; i++) {
    int flag = find_flag(out, argv[i]);
    if (flag < 0) {
      argv[kept++] = argv[i];
    } else if (++i == *argc) {
      return wrong(kind, argv[i - 1], " needs a value");
    } else if (!kind->flags[flag].read(argv[i], out->words[flag])) {
      return wrong_value(kind, &kind->flags[flag], argv[i]);
    }
  }
  *argc = kept;
  return fill_words(out);
}

/* Every line of a kind that has secrets has a new one; only verbs that show it use it. */
static void write_line(const admin_command *command, char line[ADMIN_LINE], char shown[ADMIN_WORD]) {
  const admin_flag *flags = command->kind->flags;
  char secret[ADMIN_SECRET] = "";
  shown[0] = 0;
  if (command->kind->make_secret) {
    command->kind->make_secret(command->name, shown, secret);
  }
  int n = snprintf(line, ADMIN_LINE, "%s %s %s", command->kind->name, command->verb->name, command->name);
  for (int i = 0; i < ADMIN_FLAGS && flags[i].name && n < ADMIN_LINE; i++) {
    n += snprintf(line + n, (size_t)(ADMIN_LINE - n), " %s", *flags[i].name ? command->words[i] : secret);
  }
  sodium_memzero(secret, sizeof secret);
}

enum { LINE_VERB = 1, LINE_NAME, LINE_FLAGS }; /* words of a line, from 0 on */

static void word_of(const char *line, int n, char out[ADMIN_WORD]) {
  line += strspn(line, " ");
  for (int i = 0; i < n; i++) {
    line += strcspn(line, " ");
    line += strspn(line, " ");
  }
  snprintf(out, ADMIN_WORD, "%.*s", (int)strcspn(line, " "), line);
}

/* "-" if the line has neither a NAME nor the word of the kind's `holder`. */
static void subject_of(const admin_kind *kind, const char *line, char out[ADMIN_WORD]) {
  word_of(line, LINE_NAME, out);
  for (int i = 0; strcmp(out, "-") == 0 && kind->holder && i < ADMIN_FLAGS && kind->flags[i].name; i++) {
    if (strcmp(kind->flags[i].name, kind->holder) == 0) {
      word_of(line, LINE_FLAGS + i, out);
      return;
    }
  }
}

int admin_tell(const admin_kind *kind, const char *line, int status, char out[ADMIN_TOLD]) {
  char verb[ADMIN_WORD], subject[ADMIN_WORD];
  word_of(line, LINE_VERB, verb);
  subject_of(kind, line, subject);
  snprintf(out, ADMIN_TOLD, "%s %.7s: %s%s", kind->name, verb, subject, status ? ", failed" : "");
  return strcmp(verb, "list") != 0;
}

static int show(const admin_command *command, int status, const api_text *reply, const char *shown) {
  if (status != 0) {
    fprintf(stderr, "orbmorphd: %s", reply->data ? reply->data : "the command failed; the log says why\n");
  } else if (command->verb->shows_secret) {
    puts(shown);
  } else {
    fputs(reply->data ? reply->data : "", stdout);
  }
  return status;
}

int admin_command_ask(const admin_command *command, const config *options) {
  char line[ADMIN_LINE], shown[ADMIN_WORD];
  api_text reply = {0};
  if (!command->kind) {
    return -1;
  }
  write_line(command, line, shown);
  int status = control_ask(options->data, line, &reply);
  if (status >= 0) {
    show(command, status, &reply, shown);
  }
  api_text_free(&reply);
  return status;
}

/* Executes a line on the catalogue. */
static int apply(const admin_command *command, const char *data, const char *line, const char *shown, catalogue *cat) {
  char told[ADMIN_TOLD];
  api_text reply = {0};
  const int is_told = admin_tell(command->kind, line, 0, told);
  const int file = is_told ? audit_open(data) : -1;
  if (is_told && file < 0) {
    return 1;
  }
  int status = show(command, command->kind->apply(cat, line, &reply), &reply, shown);
  if (is_told) {
    admin_tell(command->kind, line, status, told);
    status = audit_keep(file, told) ? status : 1;
  }
  api_text_free(&reply);
  return status;
}

int admin_command_run(const admin_command *command, const config *options) {
  char line[ADMIN_LINE], shown[ADMIN_WORD];
  catalogue *cat = NULL;
  store_result opened =
      catalogue_open_among(options->data, config_catalogue(options), strcmp(options->objects, "files") != 0, &cat);
  if (opened != STORE_OK) {
    return opened == STORE_UNFIT ? CONFIG_UNFIT : 1;
  }
  write_line(command, line, shown);
  int status = apply(command, options->data, line, shown, cat);
  catalogue_close(cat);
  return status;
}

int admin_answer(store_result result, const admin_kind *kind, const char *name, const char *instead, api_text *reply) {
  if (result == STORE_CONFLICT) {
    api_text_printf(reply, "a %s \"%s\" already exists; %s\n", kind->name, name, instead);
  } else if (result == STORE_NOT_FOUND) {
    api_text_printf(reply, "%s \"%s\" does not exist\n", kind->name, name);
  } else if (result != STORE_OK) {
    api_text_add(reply, "the catalogue could not be written; the log says why\n");
  }
  return result != STORE_OK;
}
