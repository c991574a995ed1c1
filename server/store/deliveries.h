/* The outbox: messages that announce the ends of jobs to webhooks.
 *
 * The transaction that ends a job adds a delivery for each webhook, so a crash loses none. A delivery is pending until
 * a receiver has answered 2xx or the last attempt has failed; a crash between the answer and its record repeats the
 * message with the same id. A receiver is an origin to which one tenant's messages go. Its row has the time of its next
 * attempt, so that the deliveries that are due are found without looking at those that wait.
 */
#ifndef ORB_STORE_DELIVERIES_H
#define ORB_STORE_DELIVERIES_H

#include "store/webhooks.h"

enum { DELIVERY_RECEIVER = 64 + WEBHOOK_RECEIVER, DELIVERY_ERROR = 160, DELIVERIES_OF_JOB = 96, JOB_WEBHOOKS = 16 };

typedef struct delivery_row {
  int64_t seq;
  char job[API_JOB_ID_SIZE];
  int number; /* among those of the job, from 1 */
  char webhook[WEBHOOK_NAME];
  char receiver[DELIVERY_RECEIVER]; /* tenant and origin */
  char url[API_WEBHOOK_URL], type[24];
  api_delivery_state state;
  int attempts;
  int tried;                    /* attempts since the delivery was made, or since it was retried by hand */
  int status;                   /* of the last answer; 0: none */
  char error[DELIVERY_ERROR];   /* of the last attempt */
  int64_t next, created, ended; /* Unix time in ms; next: of the next attempt */
  char *body;                   /* of malloc(); NULL in lists */
  char secret[WEBHOOK_SECRET], old_secret[WEBHOOK_SECRET]; /* "" in lists */
  int64_t old_until;
} delivery_row;
void delivery_row_free(delivery_row *row);

/* A webhook that a request names. */
typedef struct job_webhook {
  const char *url, *origin;
  unsigned events;
} job_webhook;

/* These two run inside a transaction of the writer. */
/* Adds the webhook to the job, unless the job has it. SQL_CONSTRAINT: the job has JOB_WEBHOOKS others. */
int delivery_subscribe(database *db, const char *job, const job_webhook *hook);
/* The job has ended: adds the deliveries. json: the job. */
int delivery_announce(database *db, const char *job, api_job_state state, const char *json, int64_t now);

/* The same webhook for a job that exists; if the job has ended, its end is announced at once. STORE_CONFLICT: the job
 * has JOB_WEBHOOKS. */
store_result catalogue_job_subscribe(catalogue *cat, const char *job, const job_webhook *hook);

/* For the deliverer: lists the next delivery of each receiver that is due. It takes at most `share` receivers of a
 * tenant, and tenants take turns. */
int catalogue_deliveries_due(catalogue *cat, int64_t now, int share, int limit, delivery_row *out);
/* When the next delivery is due, Unix time in ms; INT64_MAX: none is pending; −1: it cannot be read. */
int64_t catalogue_deliveries_next(catalogue *cat);
/* Records attempts: of each row seq, receiver, state, status, error and next. */
store_result catalogue_deliveries_record(catalogue *cat, const delivery_row *rows, int count, int64_t now);

/* Lists the deliveries of a job by number. */
int catalogue_deliveries_of(catalogue *cat, const char *job, int limit, delivery_row *out);
/* Makes a delivery pending and due now. STORE_NOT_FOUND: there is no such delivery. */
store_result catalogue_delivery_retry(catalogue *cat, const char *job, int number, int64_t now);
int64_t catalogue_deliveries_pending(catalogue *cat); /* −1: cannot be read */

#endif
