/* Webhooks: the URLs to which the ends of a tenant's jobs are announced, and the secrets that sign the messages. The
 * catalogue stores secrets as they are, because the daemon has to compute signatures.
 *
 * A tenant's own secret, which signs the webhooks that its requests name, is a row with the name "@" and the tenant,
 * and without a URL.
 */
#ifndef ORB_STORE_WEBHOOKS_H
#define ORB_STORE_WEBHOOKS_H

#include "api/webhook_codec.h"
#include "store/catalogue.h"
#include "store/database.h"

enum { WEBHOOK_NAME = 72, WEBHOOK_SECRET = 64, WEBHOOK_RECEIVER = 400, WEBHOOKS_OF_TENANT = 64 };

typedef struct webhook_row {
  char name[WEBHOOK_NAME], tenant[64];
  char url[API_WEBHOOK_URL], origin[WEBHOOK_RECEIVER]; /* origin: scheme, host and port of the URL */
  unsigned events;
  char secret[WEBHOOK_SECRET], old_secret[WEBHOOK_SECRET]; /* "whsec_" and base64; old_secret "": none */
  int64_t old_until;                                       /* Unix time in seconds to which both secrets sign */
  int64_t created;                                         /* Unix time in ms */
} webhook_row;

/* A new random secret. */
void webhook_new_secret(char out[WEBHOOK_SECRET]);

/* STORE_CONFLICT: the name is taken, or the tenant has WEBHOOKS_OF_TENANT already. */
store_result catalogue_webhook_add(catalogue *cat, const webhook_row *row);
/* Gives a webhook a new secret; the old one also signs until a Unix time in seconds. */
store_result catalogue_webhook_rotate(catalogue *cat, const char *name, const char *secret, int64_t old_until);
/* Also fails its pending deliveries. */
store_result catalogue_webhook_remove(catalogue *cat, const char *name);
/* The tenant's own secret, which is created if there is none. */
store_result catalogue_webhook_secret(catalogue *cat, const char *tenant, char out[WEBHOOK_SECRET]);
/* All webhooks by name, without the tenants' own secrets, allocated with malloc(); NULL with *count −1 on error. */
webhook_row *catalogue_webhooks(catalogue *cat, int *count);

/* Inside a transaction of the writer: creates the tenant's own secret if there is none. */
int webhook_ensure_secret(database *db, const char *tenant);

#endif
