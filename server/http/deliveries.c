/* GET /v1/jobs/{job}/deliveries and POST …/deliveries/{k}/retry: the messages to the webhooks of a job. */
#include <stdlib.h>
#include <time.h>

#include "deliver/deliver.h"
#include "http/http.h"
#include "store/deliveries.h"

/* Whether the caller sees the job; 0 with a response. */
static int sees_job(request *r) {
  job_row row;
  store_result result = catalogue_job_get(r->srv->cat, r->id, &row);
  if (result == STORE_OK && !access_sees(r, row.owner)) {
    result = STORE_NOT_FOUND;
    job_row_free(&row);
  } else if (result == STORE_OK) {
    job_row_free(&row);
    return 1;
  }
  reply_store(r, result);
  return 0;
}

static void write_row(const delivery_row *row, api_text *out) {
  api_delivery_write(&(api_delivery_view){.job = row->job,
                                          .webhook = row->webhook[0] == '@' ? "" : row->webhook,
                                          .url = row->url,
                                          .type = row->type,
                                          .error = row->error,
                                          .state = row->state,
                                          .number = row->number,
                                          .attempts = row->attempts,
                                          .status = row->status,
                                          .created = row->created,
                                          .next = row->next,
                                          .ended = row->ended},
                     out);
}

/* All deliveries of the job, or the one with this number. */
static void reply_rows(request *r, unsigned status, int number) {
  api_text json = {0};
  delivery_row *rows = calloc(DELIVERIES_OF_JOB, sizeof *rows);
  int count = rows ? catalogue_deliveries_of(r->srv->cat, r->id, DELIVERIES_OF_JOB, rows) : -1;
  if (number == 0) {
    api_json_open(&json, '{');
    api_json_key(&json, "deliveries");
    api_json_open(&json, '[');
  }
  for (int i = 0; i < count; i++) {
    if (number == 0 || rows[i].number == number) {
      write_row(&rows[i], &json);
    }
  }
  if (number == 0) {
    api_json_close(&json, ']');
    api_json_close(&json, '}');
  }
  free(rows);
  if (count < 0) {
    api_text_free(&json);
    reply_store(r, STORE_ERROR);
  } else {
    reply_json(r, status, &json);
  }
}

static void list_away(request *r) {
  if (sees_job(r)) {
    reply_rows(r, 200, 0);
  }
}

enum MHD_Result handle_delivery_list(request *r) {
  return request_go_away(r, r->srv->io, list_away);
}

static void retry_away(request *r) {
  if (!sees_job(r)) {
    return;
  }
  store_result result = catalogue_delivery_retry(r->srv->cat, r->id, r->shape, (int64_t)time(NULL) * 1000);
  if (result != STORE_OK) {
    reply_store(r, result);
    return;
  }
  reply_rows(r, 202, r->shape);
  deliver_wake(r->srv->outbox);
}

enum MHD_Result handle_delivery_retry(request *r) {
  return request_go_away(r, r->srv->io, retry_away);
}
