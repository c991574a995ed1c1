/* Moves a request to another thread and back. */
#include <string.h>

#include "faults.h"
#include "hash.h"
#include "http/http.h"

static _Thread_local int handed_over;

void request_handed_over(void) {
  handed_over = 1;
}

static void run_away(task *t) {
  request *r = (request *)(void *)t;
  handed_over = 0;
  r->away(r);
  if (handed_over) {
    return;
  }
  if (r->next_pool) {
    tasks *pool = r->next_pool;
    r->next_pool = NULL;
    t->memory = r->next_memory;
    t->part = BUDGET_CHECKS;
    tasks_add(pool, t);
    return;
  }
  FAULT_POINT("before-reply");
  if (r->phase == PHASE_AWAY) {
    r->phase = PHASE_SEND; /* the task could not make a response: reply_send() closes the connection */
  }
  MHD_resume_connection(r->connection);
}

static int task_is_wanted(task *t) {
  return request_is_wanted(t);
}

void request_go_on(request *r, tasks *pool, int64_t memory, void (*fn)(request *r)) {
  r->away = fn;
  r->next_pool = pool;
  r->next_memory = memory;
  r->phase = PHASE_AWAY;
}

enum MHD_Result request_go_away(request *r, tasks *pool, void (*fn)(request *r)) {
  r->away = fn;
  r->away_task.run = run_away;
  r->away_task.is_wanted = task_is_wanted;
  const char *tenant = access_tenant(r);
  r->away_task.owner = tenant[0] ? keyed_hash(tenant, strlen(tenant)) : 0;
  r->phase = PHASE_AWAY;
  MHD_suspend_connection(r->connection);
  tasks_add(pool, &r->away_task);
  return REQUEST_AWAY;
}
