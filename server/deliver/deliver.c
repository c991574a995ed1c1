#include "deliver/deliver.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "deliver/sign.h"
#include "faults.h"
#include "log.h"
#include "metrics.h"
#include "net/client.h"
#include "store/deliveries.h"

enum { ANSWER_MS = 15000, POLL_MS = 1000, GONE = 410, RETRY_AFTER_MOST_S = 3600 };

/* A message in flight. */
typedef struct flight {
  delivery_row row;
  net_url url;
  char id[80], timestamp[64], signature[160];
  const char *headers[5];
  net_transfer *transfer;
} flight;

struct deliverer {
  deliver_options options;
  catalogue *cat;
  CURLM *multi;
  pthread_t thread;
  int stopping, woken; /* __atomic */
  flight *flights[DELIVER_MOST];
  int count;
  delivery_row ended[DELIVER_MOST]; /* to be recorded, without bodies */
  int ended_count;
  int told_denied; /* which has been logged */
};

static int64_t now_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int64_t deliver_wait_ms(int64_t retry_ms, int failed, double chance) {
  if (failed >= DELIVER_ATTEMPTS) {
    return -1;
  }
  return (int64_t)((double)(retry_ms << (failed - 1)) * (0.95 + 0.1 * chance));
}

static double chance(void) {
  return (double)randombytes_uniform(1 << 20) / (1 << 20);
}

static void drop_flight(flight *f) {
  net_transfer_free(f->transfer);
  delivery_row_free(&f->row);
  sodium_memzero(f, sizeof *f);
  free(f);
}

/* Notes the result of an attempt. why "": delivered. */
static void note(deliverer *d, delivery_row *row, int status, const char *why, int64_t retry_after) {
  int64_t wait = status == GONE ? -1 : deliver_wait_ms(d->options.retry_ms, row->tried + 1, chance());
  int64_t asked = 1000 * (retry_after < RETRY_AFTER_MOST_S ? retry_after : RETRY_AFTER_MOST_S);
  row->status = status;
  snprintf(row->error, sizeof row->error, "%s", why);
  row->state = !why[0] ? API_DELIVERY_DELIVERED : wait < 0 ? API_DELIVERY_FAILED : API_DELIVERY_PENDING;
  row->next = now_ms() + (wait > asked ? wait : asked);
  metrics_webhook(row->state == API_DELIVERY_DELIVERED);
  if (row->state == API_DELIVERY_FAILED) {
    log_warn("delivery %d of job %s failed for good: %s", row->number, row->job, why);
  }
  delivery_row *kept = &d->ended[d->ended_count++];
  *kept = *row;
  kept->body = NULL;
}

static int prepare(const deliverer *d, flight *f, const char **why) {
  char id[API_MESSAGE_ID], first[WEBHOOK_SIGNATURE], second[WEBHOOK_SIGNATURE] = "";
  delivery_row *row = &f->row;
  int64_t now = now_ms() / 1000;
  size_t size = strlen(row->body);
  if (net_url_read(row->url, &d->options.allowed, &f->url, why) != NET_URL_FINE) {
    return 0;
  }
  api_message_id(row->job, row->number, id);
  int old = row->old_secret[0] && row->old_until > now;
  if (!webhook_sign(row->secret, id, now, row->body, size, first) ||
      (old && !webhook_sign(row->old_secret, id, now, row->body, size, second))) {
    *why = "the webhook was removed";
    return 0;
  }
  snprintf(f->id, sizeof f->id, "webhook-id: %s", id);
  snprintf(f->timestamp, sizeof f->timestamp, "webhook-timestamp: %" PRId64, now);
  snprintf(f->signature, sizeof f->signature, "webhook-signature: %s%s%s", first, old ? " " : "", second);
  f->headers[0] = "Content-Type: application/json";
  f->headers[1] = f->id;
  f->headers[2] = f->timestamp;
  f->headers[3] = f->signature;
  f->transfer = net_transfer_create(&(net_request){.url = &f->url,
                                                   .allowed = &d->options.allowed,
                                                   .authorities = d->options.authorities,
                                                   .headers = f->headers,
                                                   .body = row->body,
                                                   .body_size = size,
                                                   .total_ms = ANSWER_MS});
  *why = "the server has no memory left";
  return f->transfer && curl_multi_add_handle(d->multi, net_transfer_handle(f->transfer)) == CURLM_OK;
}

/* Takes over the row. */
static void send_row(deliverer *d, delivery_row *row) {
  flight *f = calloc(1, sizeof *f);
  const char *why = "";
  if (!f) {
    note(d, row, 0, "the server has no memory left", 0);
    delivery_row_free(row);
    return;
  }
  f->row = *row;
  if (!prepare(d, f, &why)) {
    note(d, &f->row, 0, why, 0);
    drop_flight(f);
    return;
  }
  d->flights[d->count++] = f;
}

static int in_flight(const deliverer *d, const char *receiver) {
  int i = 0;
  while (i < d->count && strcmp(d->flights[i]->row.receiver, receiver) != 0) {
    i++;
  }
  return i < d->count;
}

/* Starts what is due. Returns when to look again at the latest, in ms from now. */
static int send_due(deliverer *d, delivery_row *rows) {
  if (d->options.may && !d->options.may(d->options.user)) {
    return POLL_MS;
  }
  int64_t now = now_ms();
  int found = catalogue_deliveries_due(d->cat, now, DELIVER_MOST / 2, DELIVER_MOST, rows),
      room = DELIVER_MOST - d->count;
  for (int i = 0; i < found; i++) {
    if (room > 0 && !in_flight(d, rows[i].receiver)) {
      room--;
      send_row(d, &rows[i]);
    } else {
      delivery_row_free(&rows[i]);
    }
  }
  int64_t next = catalogue_deliveries_next(d->cat);
  return next > now && next - now < POLL_MS ? (int)(next - now) : POLL_MS;
}

static void end_flight(deliverer *d, CURL *handle, CURLcode code) {
  int i = 0;
  char why[DELIVERY_ERROR] = "";
  net_answer answer;
  while (i < d->count && net_transfer_handle(d->flights[i]->transfer) != handle) {
    i++;
  }
  if (i == d->count) {
    return;
  }
  flight *f = d->flights[i];
  net_transfer_end(f->transfer, code, &answer);
  if (answer.end == NET_DENIED && !d->told_denied) {
    log_warn("webhooks cannot be delivered: %s; docs/deploy.md has a drop-in for the unit, outgoing.conf", answer.why);
    d->told_denied = 1;
  }
  if (answer.end != NET_ANSWERED) {
    snprintf(why, sizeof why, "%s", answer.why);
  } else if (answer.status < 200 || answer.status > 299) {
    snprintf(why, sizeof why, "the receiver answered %d", answer.status);
  }
  note(d, &f->row, answer.status, why, answer.retry_after);
  curl_multi_remove_handle(d->multi, handle);
  d->flights[i] = d->flights[--d->count];
  drop_flight(f);
}

/* Records what has ended; until that is committed, the receivers get nothing else. */
static void record(deliverer *d) {
  FAULT_POINT("webhook-answered");
  if (catalogue_deliveries_record(d->cat, d->ended, d->ended_count, now_ms()) != STORE_OK) {
    log_error("the results of %d deliveries could not be stored; they are repeated", d->ended_count);
  }
  sodium_memzero(d->ended, sizeof d->ended);
  d->ended_count = 0;
}

static void collect(deliverer *d) {
  int left;
  for (CURLMsg *message; (message = curl_multi_info_read(d->multi, &left));) {
    if (message->msg == CURLMSG_DONE) {
      end_flight(d, message->easy_handle, message->data.result);
    }
  }
}

static void *thread_main(void *argument) {
  deliverer *d = argument;
  delivery_row *rows = calloc(DELIVER_MOST, sizeof *rows);
  int64_t look = 0;
  while (rows && !__atomic_load_n(&d->stopping, __ATOMIC_ACQUIRE)) {
    int running = 0;
    if (__atomic_exchange_n(&d->woken, 0, __ATOMIC_ACQ_REL) || now_ms() >= look || look > now_ms() + POLL_MS) {
      look = now_ms() + send_due(d, rows);
    }
    curl_multi_perform(d->multi, &running);
    collect(d);
    if (d->ended_count > 0) {
      record(d);
      look = 0;
      continue;
    }
    int64_t wait = look - now_ms();
    curl_multi_poll(d->multi, NULL, 0, wait > 0 ? (int)wait : 0, NULL);
  }
  free(rows);
  return NULL;
}

deliverer *deliver_start(const deliver_options *options, catalogue *cat) {
  deliverer *d = calloc(1, sizeof *d);
  if (!d) {
    return NULL;
  }
  d->options = *options;
  d->cat = cat;
  d->multi = curl_multi_init();
  if (!d->multi || pthread_create(&d->thread, NULL, thread_main, d) != 0) {
    curl_multi_cleanup(d->multi);
    free(d);
    return NULL;
  }
  return d;
}

void deliver_wake(void *user) {
  deliverer *d = user;
  __atomic_store_n(&d->woken, 1, __ATOMIC_RELEASE);
  curl_multi_wakeup(d->multi);
}

void deliver_stop(deliverer *d) {
  if (!d) {
    return;
  }
  __atomic_store_n(&d->stopping, 1, __ATOMIC_RELEASE);
  curl_multi_wakeup(d->multi);
  pthread_join(d->thread, NULL);
  while (d->count > 0) {
    flight *f = d->flights[--d->count];
    curl_multi_remove_handle(d->multi, net_transfer_handle(f->transfer));
    drop_flight(f);
  }
  curl_multi_cleanup(d->multi);
  free(d);
}
