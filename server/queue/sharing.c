/* A node's thread: it renews the lease, receives the notices of other nodes, and polls each second, because notices are
 * lost with their connection. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "log.h"
#include "queue/internal.h"
#include "queue/shared.h"

enum { TICK_MS = 1000, AWAY_MS = 200, PAUSE_MS = 250, RENEWALS = 3 /* in the time of a lease */ };

void shared_look(queue *q, int fetches) {
  for (int lane = 0; lane < LANES; lane++) {
    q->shared->look[lane] |= lane != QUEUE_FETCHES || fetches;
  }
}

void shared_count(const queue *q, int64_t now, queue_numbers *out) {
  const shared_numbers *all = &q->shared->numbers;
  out->queued = (int)all->ready;
  out->waiting = (int)all->waiting;
  out->oldest_ms = all->oldest && all->ready > 0 && now > all->oldest ? now - all->oldest : 0;
}

void shared_hold(queue *q, int64_t ms) {
  pthread_mutex_lock(&q->lock);
  q->shared->hold_until = orb_clock_ms() + ms;
  pthread_mutex_unlock(&q->lock);
}

int shared_pause(queue *q) {
  nanosleep(&(struct timespec){.tv_nsec = PAUSE_MS * 1000000L}, NULL);
  pthread_mutex_lock(&q->lock);
  int goes_on = !q->stopping_now;
  pthread_mutex_unlock(&q->lock);
  return goes_on;
}

int queue_does_housekeeping(queue *q) {
  return !q->shared || __atomic_load_n(&q->shared->house, __ATOMIC_ACQUIRE);
}

static void look_at(queue *q, queue_lane first, queue_lane last) {
  pthread_mutex_lock(&q->lock);
  for (int lane = (int)first; lane <= (int)last; lane++) {
    q->shared->look[lane] = 1;
  }
  pthread_cond_broadcast(&q->work);
  pthread_mutex_unlock(&q->lock);
}

static void heard(void *user, const char *text) {
  queue *q = user;
  const sharing *s = q->shared;
  switch (text[0]) {
    case 'q':
      look_at(q, QUEUE_COMPUTES, QUEUE_GUESTS);
      break;
    case 'f':
      look_at(q, QUEUE_FETCHES, QUEUE_FETCHES);
      break;
    case 'j':
    case 'e':
      shared_refresh(q, text + 1);
      break;
    case 'c':
      shared_cancelled(q, text + 1);
      break;
    default:
      if (s->options.changed) {
        s->options.changed(s->options.user, text);
      }
  }
}

/* Queues the jobs of nodes that are gone. That is hardly ever the fault of a job that has a process of its own, which
 * the kernel limits: nodes are killed, paused or starved. Waits for nothing: this thread must renew its own lease. */
static void take_over(queue *q) {
  api_text text = {0};
  crash_problem(&text);
  if (!text.failed) {
    catalogue_recover_lost(q->cat, CRASHES_MOST, q->isolated ? ATTEMPTS_BORNE : 1, unix_ms(), text.data);
  }
  api_text_free(&text);
}

/* Looks for changes whose notices were lost. */
static void look_around(queue *q) {
  sharing *s = q->shared;
  shared_numbers numbers;
  look_at(q, QUEUE_COMPUTES, QUEUE_FETCHES);
  shared_refresh_all(q);
  if (catalogue_lost_jobs(q->cat, s->options.lease_ms)) {
    take_over(q);
  }
  if (catalogue_shared_numbers(q->cat, &numbers) == STORE_OK) {
    pthread_mutex_lock(&q->lock);
    s->numbers = numbers;
    pthread_mutex_unlock(&q->lock);
  }
}

static int renew(const queue *q) {
  const sharing *s = q->shared;
  return notices_renew(s->bell, s->node, s->options.works ? q->options.workers : 0, s->options.lease_ms);
}

static void *thread_main(void *argument) {
  queue *q = argument;
  sharing *s = q->shared;
  int64_t renewed = 0, looked = 0;
  while (!__atomic_load_n(&s->stop, __ATOMIC_ACQUIRE)) {
    int fresh, connected = notices_connect(s->bell, &fresh);
    int64_t now = orb_clock_ms();
    if (fresh && s->options.changed) { /* notices were lost */
      s->options.changed(s->options.user, "*");
    }
    if (connected && (fresh || now - renewed >= s->options.lease_ms / RENEWALS) && renew(q)) {
      renewed = now;
    }
    const int looks = connected && (fresh || now - looked >= TICK_MS);
    if (looks || !connected) {
      __atomic_store_n(&s->house, connected && notices_does_housekeeping(s->bell), __ATOMIC_RELEASE);
    }
    if (looks) {
      looked = now;
      look_around(q);
    }
    int64_t left = looked + TICK_MS - orb_clock_ms();
    notices_wait(s->bell, !connected ? AWAY_MS : left < 1 ? 1 : left < TICK_MS ? (int)left : TICK_MS, heard, q);
  }
  return NULL;
}

/* The data folder remembers the name, so that the next process at once queues what this one leaves behind. Each
 * process has a new name: a copy of the folder is another node. */
static int name_node(sharing *s) {
  char path[PATH_MAX];
  api_random_id(s->node);
  snprintf(path, sizeof path, "%s/node", s->options.data);
  int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) {
    return 0;
  }
  if (read(fd, s->last_life, NODE_NAME - 1) != NODE_NAME - 1) {
    s->last_life[0] = 0;
  }
  int fine = pwrite(fd, s->node, NODE_NAME - 1, 0) == NODE_NAME - 1;
  close(fd);
  return fine;
}

int shared_create(queue *q, const queue_sharing *options) {
  q->shared = calloc(1, sizeof *q->shared);
  if (!q->shared) {
    return 0;
  }
  q->shared->options = *options;
  q->shared->bell = notices_open(options->url);
  return q->shared->bell != NULL;
}

store_result shared_start(queue *q) {
  sharing *s = q->shared;
  int fresh;
  if (!name_node(s)) {
    log_error("the name of this node cannot be written into the folder %s", s->options.data);
    return STORE_ERROR;
  }
  store_result result = catalogue_recover_own(q->cat, s->last_life);
  if (result == STORE_OK && !(notices_connect(s->bell, &fresh) && renew(q))) {
    result = STORE_ERROR;
  }
  if (result == STORE_OK) {
    s->started = pthread_create(&s->thread, NULL, thread_main, q) == 0;
    result = s->started ? STORE_OK : STORE_ERROR;
    log_info("node %s", s->node);
  }
  return result;
}

void shared_stop(queue *q) {
  sharing *s = q->shared;
  if (!s) {
    return;
  }
  __atomic_store_n(&s->stop, 1, __ATOMIC_RELEASE);
  if (s->started) {
    pthread_join(s->thread, NULL);
    notices_leave(s->bell, s->node);
  }
  notices_close(s->bell);
  free(s);
  q->shared = NULL;
}
