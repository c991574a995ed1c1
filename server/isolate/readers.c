#include "isolate/readers.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "wake.h"

/* READERS: of all tenants together. IDLE_MS: within it, a client far away that sends file after file sends the next
 * one. LOOK_MS: how soon an idle one ends once others lack memory. */
enum { READERS = 8, IDLE_MS = 250, LOOK_MS = 50 };
enum { FREE, BUSY, IDLE, OVER }; /* over: the thread ends it */

static struct {
  pthread_mutex_t lock;
  pthread_cond_t wake;
  pthread_t thread;
  memory_budget *memory; /* NULL: not started */
  int stopping;
  reader all[READERS];
} own = {.lock = PTHREAD_MUTEX_INITIALIZER};

static void forget(reader *r) {
  const budget_part part = r->part;
  const int64_t memory = r->memory;
  free(r->tenant);
  pthread_mutex_lock(&own.lock);
  *r = (reader){.state = FREE};
  pthread_mutex_unlock(&own.lock);
  budget_give(own.memory, part, memory, NULL);
}

int reader_end(reader *r) {
  int status = isolate_close(&r->process);
  forget(r);
  return status;
}

/* Whether others have asked in vain for memory of this kind since the process started. */
static int is_scarce(const reader *r) {
  return budget_shortages(own.memory, r->part) != r->shortages;
}

/* Under the lock. Returns one to end now, or NULL with the time until the next look; −1: there is none. */
static reader *find_over(int64_t *ms) {
  const int64_t now = orb_clock_ms();
  *ms = -1;
  for (int i = 0; i < READERS; i++) {
    reader *r = &own.all[i];
    if (r->state == FREE) {
      continue;
    }
    *ms = LOOK_MS;
    if (r->state == OVER || (r->state == IDLE && (own.stopping || is_scarce(r) || now - r->began >= IDLE_MS))) {
      r->state = BUSY;
      return r;
    }
  }
  return NULL;
}

static void *thread_main(void *unused) {
  (void)unused;
  pthread_mutex_lock(&own.lock);
  for (;;) {
    int64_t ms;
    reader *r = find_over(&ms);
    if (r) {
      pthread_mutex_unlock(&own.lock);
      reader_end(r);
      pthread_mutex_lock(&own.lock);
    } else if (own.stopping) {
      break;
    } else if (ms < 0) {
      pthread_cond_wait(&own.wake, &own.lock);
    } else {
      wake_wait_ms(&own.wake, &own.lock, ms);
    }
  }
  pthread_mutex_unlock(&own.lock);
  return NULL;
}

int readers_start(memory_budget *memory) {
  if (!isolate_is_on()) {
    return 1;
  }
  wake_init(&own.wake);
  own.stopping = 0;
  own.memory = memory;
  if (pthread_create(&own.thread, NULL, thread_main, NULL) != 0) {
    own.memory = NULL;
  }
  return own.memory != NULL;
}

void readers_stop(void) {
  if (!own.memory) {
    return;
  }
  pthread_mutex_lock(&own.lock);
  own.stopping = 1;
  pthread_cond_signal(&own.wake);
  pthread_mutex_unlock(&own.lock);
  pthread_join(own.thread, NULL);
  pthread_cond_destroy(&own.wake);
  own.memory = NULL;
}

/* Small files get what the densest of them need. */
static int64_t memory_of(budget_part part) {
  return part == BUDGET_SMALL ? budget_for_densest_file(own.memory, part, BUDGET_SMALL_FILE, 0)
                              : budget_for_file(own.memory, part, READER_BYTES);
}

/* Under the lock. Finds a process that has read only files of this tenant, or else a free place; NULL: neither. */
static reader *find(const char *tenant, budget_part part) {
  reader *place = NULL, *oldest = NULL;
  for (int i = 0; i < READERS; i++) {
    reader *r = &own.all[i];
    if (r->state == IDLE && r->part == part && strcmp(r->tenant, tenant) == 0) {
      return r;
    }
    place = r->state == FREE ? r : place;
    oldest = r->state == IDLE && (!oldest || r->began < oldest->began) ? r : oldest;
  }
  if (!place && oldest) {
    oldest->state = OVER;
    pthread_cond_signal(&own.wake);
  }
  return place;
}

/* Fills a place, which is BUSY. */
static reader *start(reader *r, const char *tenant, budget_part part, orb_context *ctx) {
  r->memory = memory_of(part);
  r->part = part;
  r->shortages = budget_shortages(own.memory, part);
  r->tenant = strdup(tenant);
  if (r->tenant && budget_take(own.memory, part, r->memory, NULL) == BUDGET_FREE) {
    if (isolate_open(&r->process, ctx)) {
      return r;
    }
    budget_give(own.memory, part, r->memory, NULL);
  }
  free(r->tenant);
  pthread_mutex_lock(&own.lock);
  *r = (reader){.state = FREE};
  pthread_mutex_unlock(&own.lock);
  return NULL;
}

reader *reader_take(const char *tenant, budget_part part, int64_t bytes, int64_t memory, orb_context *ctx) {
  if (!own.memory || bytes > READER_BYTES || memory > memory_of(part)) {
    return NULL;
  }
  pthread_mutex_lock(&own.lock);
  reader *r = own.stopping ? NULL : find(tenant, part);
  const int is_new = r && r->state == FREE;
  if (r) {
    r->state = BUSY;
  }
  if (is_new) {
    pthread_cond_signal(&own.wake); /* the thread waits without a limit while there is none */
  }
  pthread_mutex_unlock(&own.lock);
  r = is_new ? start(r, tenant, part, ctx) : r;
  if (r) {
    isolate_set_works(&r->process, 1);
    r->process.ctx = ctx;
    r->began = orb_clock_ms();
  }
  return r;
}

void reader_give(reader *r) {
  const int64_t now = orb_clock_ms();
  isolate_set_works(&r->process, 0);
  pthread_mutex_lock(&own.lock);
  r->files++;
  r->work_ms += now - r->began;
  r->began = now;
  r->process.ctx = NULL;
  r->process.wanted = NULL;
  r->state = is_scarce(r) || own.stopping || r->files >= READER_FILES || r->work_ms >= READER_WORK_MS ? OVER : IDLE;
  if (r->state == OVER) {
    pthread_cond_signal(&own.wake);
  }
  pthread_mutex_unlock(&own.lock);
}
