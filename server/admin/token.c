#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "admin/kinds.h"
#include "api/routes.h"
#include "store/tokens.h"

static const struct {
  const char *name;
  int scope;
} scopes[] = {{"read", SCOPE_READ}, {"write", SCOPE_WRITE}, {"admin", SCOPE_ADMIN}};
enum { SCOPES = sizeof scopes / sizeof scopes[0] };

static int read_scopes(const char *value, char word[ADMIN_WORD]) {
  int found = 0;
  for (const char *at = value; *at;) {
    size_t n = strcspn(at, ","), i = 0;
    while (i < SCOPES && (strlen(scopes[i].name) != n || strncmp(scopes[i].name, at, n) != 0)) {
      i++;
    }
    if (i == SCOPES) {
      return 0;
    }
    found |= scopes[i].scope;
    at += n + (at[n] == ',');
  }
  snprintf(word, ADMIN_WORD, "%d", found);
  return found != 0;
}

static int read_priority(const char *value, char word[ADMIN_WORD]) {
  return admin_read_number(value, word) && strtoll(word, NULL, 10) <= 9;
}

/* A span from now, a day (UTC) on which it ends, or "never". */
static int read_expires(const char *value, char word[ADMIN_WORD]) {
  struct tm day = {0};
  if (strcmp(value, "never") == 0) {
    snprintf(word, ADMIN_WORD, "0");
    return 1;
  }
  const char *end = strptime(value, "%Y-%m-%d", &day);
  if (end && !*end) {
    struct tm given = day;
    if (timegm(&day) <= 0 || day.tm_mday != given.tm_mday || day.tm_mon != given.tm_mon) {
      return 0; /* before 1970, or a day that does not exist */
    }
    snprintf(word, ADMIN_WORD, "%lld", (long long)timegm(&day));
    return 1;
  }
  if (!admin_read_span(value, word)) {
    return 0;
  }
  snprintf(word, ADMIN_WORD, "%lld", (long long)time(NULL) + strtoll(word, NULL, 10));
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
    char expires[TOKEN_INSTANT] = "";
    if (rows[i].expires) {
      token_instant(rows[i].expires, expires);
    }
    api_text_printf(reply, "%s %s uploaded=%lld quota=%lld quota-jobs=%lld priority=%d%s%s%s%s", rows[i].name, names,
                    (long long)rows[i].used, (long long)rows[i].quota, (long long)rows[i].jobs, rows[i].priority,
                    other ? " tenant=" : "", other ? rows[i].tenant : "", expires[0] ? " expires=" : "", expires);
    if (rows[i].derived || rows[i].quota_derived) {
      api_text_printf(reply, " derived=%lld quota-derived=%lld", (long long)rows[i].derived,
                      (long long)rows[i].quota_derived);
    }
    api_text_add(reply, "\n");
  }
  free(rows);
  return count < 0;
}

static int apply(catalogue *cat, const char *line, api_text *reply) {
  char verb[8], hash[TOKEN_TEXT];
  long long quota, jobs, derived, expires;
  token_row row = {.created = (int64_t)time(NULL) * 1000};
  if (sscanf(line, "token %7s %63s %d %lld %lld %d %63s %lld %lld %64s", verb, row.name, &row.scopes, &quota, &jobs,
             &row.priority, row.tenant, &expires, &derived, hash) != 10) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  row.quota = quota;
  row.jobs = jobs;
  row.quota_derived = derived;
  row.expires = expires;
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
    row.quota_derived = derived > 0 ? derived : 0;
    row.priority = row.priority > 0 ? row.priority : 0;
    row.expires = expires > 0 ? expires : 0;
    if (sodium_hex2bin(row.hash, sizeof row.hash, hash, strlen(hash), NULL, NULL, NULL) == 0) {
      result = catalogue_token_add(cat, &row);
    }
  } else if (strcmp(verb, "set") == 0) {
    result = catalogue_token_set(cat, &row);
  } else if (strcmp(verb, "remove") == 0) {
    result = catalogue_token_remove(cat, row.name);
  }
  return admin_answer(result, &admin_token, row.name, "change it with set, or remove it", reply);
}

/* Only the hash of the token leaves the process that makes it. */
static void make_token(const char *name, char shown[ADMIN_WORD], char word[ADMIN_SECRET]) {
  unsigned char token[TOKEN_BYTES], hashed[TOKEN_BYTES];
  (void)name;
  randombytes_buf(token, sizeof token);
  crypto_hash_sha256(hashed, token, sizeof token);
  sodium_bin2hex(shown, ADMIN_WORD, token, sizeof token);
  sodium_bin2hex(word, ADMIN_SECRET, hashed, sizeof hashed);
  sodium_memzero(token, sizeof token);
}

enum { ADD = 1, SET = 2 }; /* bits of verbs */

const admin_kind admin_token = {
    .name = "token",
    .usage =
        "  orbmorphd token add NAME --scope read,write,admin [--tenant NAME] [--quota BYTES]"
        " [--quota-derived BYTES]\n"
        "                      [--quota-jobs N] [--priority 0..9] [--expires 30d|YYYY-MM-DD|never]\n"
        "  orbmorphd token set NAME [--scope …] [--quota …] [--quota-derived …] [--quota-jobs …] [--priority …]"
        " [--expires …]\n"
        "  orbmorphd token list | token remove NAME\n",
    .verbs = {{"add", 1, 1, 1}, {"set", 1, 0, 0}, {"list", 0, 0, 0}, {"remove", 1, 0, 0}},
    .flags = {{"--scope", ADD | SET, ADD, "-1", read_scopes, "read, write and admin, separated by commas"},
              {"--quota", ADD | SET, 0, "-1", admin_read_number, "a number of bytes, such as 500M or 20G"},
              {"--quota-jobs", ADD | SET, 0, "-1", admin_read_number, "a whole number"},
              {"--priority", ADD | SET, 0, "-1", read_priority, "a number from 0 to 9"},
              {"--tenant", ADD, 0, "-", admin_read_name, "a name of 1 to 63 letters, digits, '-', '_' and '.'"},
              {"--expires", ADD | SET, 0, "-1", read_expires, "a time such as 30d, a day such as 2027-01-31, or never"},
              {"--quota-derived", ADD | SET, 0, "-1", admin_read_number, "a number of bytes, such as 500M or 20G"},
              {.name = ADMIN_SECRET_WORD}},
    .make_secret = make_token,
    .apply = apply,
};
