#include <inttypes.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "admin/kinds.h"
#include "net/url.h"
#include "store/webhooks.h"

/* Accepts every address: the owner of the data folder may name any, and the daemon checks the address when it
 * connects. */
static int read_url(const char *value, char word[ADMIN_WORD]) {
  static const char everything[] = "0.0.0.0/0,::/0";
  char wrong[NETWORKS_WRONG];
  const char *why;
  networks all;
  net_url url;
  if (!networks_read(everything, &all, wrong) || net_url_read(value, &all, &url, &why) != NET_URL_FINE ||
      strlen(url.text) >= ADMIN_WORD) {
    return 0;
  }
  strcpy(word, url.text);
  return 1;
}

static int read_event_list(const char *value, char word[ADMIN_WORD]) {
  unsigned events;
  char text[API_EVENTS_TEXT];
  if (!api_events_parse(value, &events)) {
    return 0;
  }
  api_events_write(events, text);
  snprintf(word, ADMIN_WORD, "%s", text);
  return 1;
}

static int list(catalogue *cat, api_text *reply) {
  int count;
  int64_t now = (int64_t)time(NULL);
  webhook_row *rows = catalogue_webhooks(cat, &count);
  for (int i = 0; i < count; i++) {
    const webhook_row *row = &rows[i];
    char events[API_EVENTS_TEXT];
    api_events_write(row->events, events);
    api_text_printf(reply, "%s tenant=%s url=%s events=%s", row->name, row->tenant, row->url, events);
    if (row->old_until > now) {
      api_text_printf(reply, " old-secret-valid-for=%llds", (long long)(row->old_until - now));
    }
    api_text_add(reply, "\n");
  }
  free(rows);
  return count < 0;
}

static int show_secret(catalogue *cat, const char *tenant, api_text *reply) {
  char secret[WEBHOOK_SECRET];
  store_result result = catalogue_webhook_secret(cat, tenant, secret);
  if (result == STORE_OK) {
    api_text_printf(reply, "%s\n", secret);
  }
  sodium_memzero(secret, sizeof secret);
  return admin_answer(result, &admin_webhook, tenant, "", reply);
}

static int add(catalogue *cat, webhook_row *row, api_text *reply) {
  static const char everything[] = "0.0.0.0/0,::/0";
  char wrong[NETWORKS_WRONG];
  const char *why;
  networks all;
  net_url url;
  row->created = (int64_t)time(NULL) * 1000;
  if (!networks_read(everything, &all, wrong) || net_url_read(row->url, &all, &url, &why) != NET_URL_FINE) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  snprintf(row->origin, sizeof row->origin, "%s", url.origin);
  return admin_answer(catalogue_webhook_add(cat, row), &admin_webhook, row->name,
                      "give it a new secret with rotate, or remove it; a tenant has at most 64", reply);
}

static int apply(catalogue *cat, const char *line, api_text *reply) {
  char verb[8], events[API_EVENTS_TEXT];
  int64_t overlap;
  webhook_row row = {0};
  if (sscanf(line, "webhook %7s %63s %511s %39s %" SCNd64 " %63s %63s", verb, row.name, row.url, events, &overlap,
             row.tenant, row.secret) != 7 ||
      !api_events_parse(events, &row.events)) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  if (strcmp(row.tenant, "-") == 0) {
    row.tenant[0] = 0;
  }
  int status = 2;
  if (strcmp(verb, "list") == 0) {
    status = list(cat, reply);
  } else if (strcmp(verb, "secret") == 0) {
    status = show_secret(cat, row.tenant, reply);
  } else if (strcmp(verb, "add") == 0) {
    status = add(cat, &row, reply);
  } else if (strcmp(verb, "rotate") == 0) {
    status = admin_answer(catalogue_webhook_rotate(cat, row.name, row.secret, (int64_t)time(NULL) + overlap),
                          &admin_webhook, row.name, "", reply);
  } else if (strcmp(verb, "remove") == 0) {
    status = admin_answer(catalogue_webhook_remove(cat, row.name), &admin_webhook, row.name, "", reply);
  }
  sodium_memzero(row.secret, sizeof row.secret);
  return status;
}

static void make_secret(const char *name, char shown[ADMIN_WORD], char word[ADMIN_SECRET]) {
  (void)name;
  webhook_new_secret(word);
  snprintf(shown, ADMIN_WORD, "%s", word);
}

enum { ADD = 1, ROTATE = 2, SECRET = 16 }; /* bits of verbs */

const admin_kind admin_webhook = {
    .name = "webhook",
    .usage =
        "  orbmorphd webhook add NAME --url URL [--events succeeded,failed,cancelled] [--tenant NAME]\n"
        "  orbmorphd webhook rotate NAME [--overlap 7d]\n"
        "  orbmorphd webhook secret [--tenant NAME]\n"
        "  orbmorphd webhook list | webhook remove NAME\n",
    .holder = "--tenant", /* whose secret it is */
    .verbs = {{"add", 1, 1, 1}, {"rotate", 1, 1, 0}, {"remove", 1, 0, 0}, {"list", 0, 0, 0}, {"secret", 0, 0, 1}},
    .flags = {{"--url", ADD, ADD, "-", read_url, "an https:// or http:// URL of at most 511 bytes"},
              {"--events", ADD, 0, "succeeded,failed,cancelled", read_event_list,
               "succeeded, failed and cancelled, separated by commas"},
              {"--overlap", ROTATE, 0, ADMIN_OVERLAP, admin_read_span, "a time such as 7d or 12h"},
              {"--tenant", ADD | SECRET, 0, "-", admin_read_name,
               "a name of 1 to 63 letters, digits, '-', '_' and '.'"},
              {.name = ADMIN_SECRET_WORD}},
    .make_secret = make_secret,
    .apply = apply,
};
