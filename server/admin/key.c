#include <inttypes.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "admin/kinds.h"
#include "store/keys.h"

enum { DAY_S = 86400 };

/* Appends an origin as browsers send it: http or https, a host, optionally a port. */
static int read_origin(const char *value, char word[ADMIN_WORD]) {
  size_t used = strlen(word), size = strlen(value);
  size_t scheme = strncmp(value, "http://", 7) == 0 ? 7 : strncmp(value, "https://", 8) == 0 ? 8 : 0;
  if (!scheme || size <= scheme || strpbrk(value + scheme, "/, \t\n?#@") || used + size + 2 > KEY_ORIGINS) {
    return 0;
  }
  snprintf(word + used, ADMIN_WORD - used, "%s%s", used ? "," : "", value);
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

static int apply(catalogue *cat, const char *line, api_text *reply) {
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
  return admin_answer(result, &admin_key, row.name, "give it a new secret with rotate, or remove it", reply);
}

static void make_secret(const char *name, char shown[ADMIN_WORD], char word[ADMIN_SECRET]) {
  unsigned char bytes[(KEY_SECRET - 1) / 2];
  randombytes_buf(bytes, sizeof bytes);
  sodium_bin2hex(word, KEY_SECRET, bytes, sizeof bytes);
  sodium_memzero(bytes, sizeof bytes);
  snprintf(shown, ADMIN_WORD, "%s:%s", name, word);
}

enum { ADD = 1, ROTATE = 2 }; /* bits of verbs */

const admin_kind admin_key = {
    .name = "key",
    .usage =
        "  orbmorphd key add NAME [--tenant NAME] [--origin URL]… [--requests-per-day N]"
        " [--cpu-seconds-per-day N]\n"
        "  orbmorphd key rotate NAME [--overlap 7d]\n"
        "  orbmorphd key list | key remove NAME\n",
    .verbs = {{"add", 1, 1, 1}, {"rotate", 1, 1, 0}, {"list", 0, 0, 0}, {"remove", 1, 0, 0}},
    .flags = {{"--requests-per-day", ADD, 0, "0", admin_read_number, "a whole number"},
              {"--cpu-seconds-per-day", ADD, 0, "0", admin_read_number, "a whole number"},
              {"--overlap", ROTATE, 0, ADMIN_OVERLAP, admin_read_span, "a time such as 7d or 12h"},
              {"--tenant", ADD, 0, "-", admin_read_name, "a name of 1 to 63 letters, digits, '-', '_' and '.'"},
              {.name = ADMIN_SECRET_WORD},
              {"--origin", ADD, 0, "-", read_origin, "an origin such as https://app.example.org"}},
    .make_secret = make_secret,
    .apply = apply,
};
