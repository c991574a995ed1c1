#include "housekeeping.h"

#include <time.h>

#include "evict.h"
#include "log.h"

enum { EVICT_GRACE_MS = 5000 };
enum { FORGET_BATCH = 256, FORGET_ROUNDS = 4, RECOUNT_MS = 60000 };

void housekeeping_budget(const server *srv, housekeeping *done) {
  const int64_t budget = srv->options->derived_bytes;
  const evict_env env = {.cat = srv->cat, .store = srv->store, .descriptions = srv->descriptions, .q = srv->q};
  evict_held(&env);
  if (budget <= 0 || !queue_does_housekeeping(srv->q)) {
    return;
  }
  int64_t succeeded = queue_ended(srv->q, API_JOB_SUCCEEDED) + __atomic_load_n(&srv->profiles_made, __ATOMIC_RELAXED);
  if (succeeded != done->seen || done->over || config_is_shared(srv->options)) { /* other nodes make results, too */
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    done->seen = succeeded;
    done->over = evict_derived(&env, budget, (int64_t)now.tv_sec * 1000 - EVICT_GRACE_MS) > budget;
  }
}

void housekeeping_jobs(const server *srv, housekeeping *done) {
  ended_jobs *jobs = &done->jobs;
  const int64_t keep = srv->options->keep_jobs;
  int64_t since = 0;
  if (keep <= 0 || !queue_does_housekeeping(srv->q)) {
    return;
  }
  if (config_is_shared(srv->options) && orb_clock_ms() - jobs->at >= RECOUNT_MS) { /* jobs end on other nodes, too */
    jobs->counted = 0;
    jobs->at = orb_clock_ms();
  }
  int64_t stored = jobs->counted ? 0 : catalogue_jobs_ended(srv->cat);
  for (int s = API_JOB_SUCCEEDED; s <= API_JOB_CANCELLED; s++) {
    since += queue_ended(srv->q, (api_job_state)s);
  }
  if (!jobs->counted && stored >= 0) {
    *jobs = (ended_jobs){1, stored - since, jobs->at};
  }
  for (int round = 0; round < FORGET_ROUNDS && jobs->counted && jobs->before + since > keep; round++) {
    int64_t many = jobs->before + since - keep;
    many = many < FORGET_BATCH ? many : FORGET_BATCH;
    if (catalogue_jobs_forget(srv->cat, (int)many) != STORE_OK) {
      log_warn("ended jobs could not be removed from the catalogue");
      return;
    }
    jobs->before -= many;
  }
}
