#include "scrub.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "evict.h"
#include "log.h"
#include "orbmorph/context.h"
#include "store/object_removal.h"
#include "store/verify.h"

/* SEEK: what an object costs besides its bytes, in bytes. NAMED: findings that the log names in one round. */
enum { PAGE = 64, SEEK = 4096, NAMED = 20, NICE = 10 };

struct scrub {
  pthread_mutex_t lock;
  pthread_cond_t wake;
  pthread_t thread;
  int stopping;
  catalogue *cat;
  objects *store;
  int64_t rate, every, named;
  double debt; /* seconds to sleep for what has been read */
  scrub_report now, last;
};

/* Sleeps until a time of the monotonic clock in ms; 0: the scrub stops. */
static int sleep_until(scrub *s, int64_t until) {
  pthread_mutex_lock(&s->lock);
  while (!s->stopping && orb_clock_ms() < until) {
    struct timespec at = {.tv_sec = until / 1000, .tv_nsec = until % 1000 * 1000000};
    pthread_cond_timedwait(&s->wake, &s->lock, &at);
  }
  int goes_on = !s->stopping;
  pthread_mutex_unlock(&s->lock);
  return goes_on;
}

/* Sleeps for bytes that were read, in steps long enough to be worth a switch of threads. */
static int pay(void *user, int64_t bytes) {
  scrub *s = user;
  s->now.bytes += bytes;
  s->debt += (double)bytes / (double)s->rate;
  if (s->debt < 0.02) {
    return 1;
  }
  int64_t until = orb_clock_ms() + (int64_t)(1e3 * s->debt);
  s->debt = 0;
  return sleep_until(s, until);
}

static int is_stopping(scrub *s) {
  return !sleep_until(s, 0);
}

static void say(scrub *s, const resource *row, const char *what, const char *found) {
  char fields[160];
  if (s->named++ < NAMED) {
    snprintf(fields, sizeof fields, "\"id\":\"%s\"", row->id);
    log_write(LOG_ERROR, fields, "scrub: %s %s; see Damage in docs/deploy.md", what, found);
  }
}

/* Whether a row names an object that does not exist. A resource may be deleted or replaced meanwhile. */
static int is_missing(scrub *s, const resource *row, const named_object *object) {
  int alone = objects_exclude(s->store);
  store_result found = objects_look(s->store, object->kind, row->id);
  int missing = alone && found == STORE_NOT_FOUND && evict_is_named(s->cat, object->kind, row->id);
  objects_let_go(s->store);
  return missing;
}

static void verify_row(scrub *s, const resource *row) {
  const verify_pace pace = {pay, s};
  named_object named[RESOURCE_OBJECTS];
  int count = resource_objects(row, named);
  for (int i = 0; i < count && pay(s, SEEK); i++) {
    /* Fetching all objects from S3 would cost more than S3's own checks; what is fetched is compared anyway. */
    store_result result = objects_is_near(s->store, named[i].kind, row->id)
                              ? verify_slowly(s->store, named[i].kind, row->id, named[i].sha, &pace)
                              : objects_look(s->store, named[i].kind, row->id);
    s->now.objects++;
    if (result == STORE_NOT_FOUND && is_missing(s, row, &named[i])) {
      s->now.missing++;
      say(s, row, named[i].what, "is missing or was moved to quarantine");
    } else if ((result == STORE_ERROR || result == STORE_AWAY) && !is_stopping(s)) {
      s->now.unreadable++;
      say(s, row, named[i].what, "cannot be read");
    }
  }
}

static void verify_rows(scrub *s, resource_kind kind) {
  resource rows[PAGE];
  int64_t before = 0;
  for (int n = PAGE; n == PAGE && !is_stopping(s);) {
    n = catalogue_list(s->cat, kind, before, PAGE, rows);
    s->now.unreadable += n < 0;
    for (int i = 0; i < n; i++) {
      before = rows[i].seq;
      verify_row(s, &rows[i]);
      resource_free(&rows[i]);
    }
  }
}

/* An object is published before its row is committed, so what has no row is looked at again while nobody publishes. */
static void look_for_row(void *user, object_kind kind, const char *id, uint64_t size) {
  scrub *s = user;
  (void)size;
  if (evict_is_named(s->cat, kind, id) || !pay(s, SEEK)) {
    return;
  }
  if (objects_exclude(s->store) && !evict_is_named(s->cat, kind, id) && objects_look(s->store, kind, id) == STORE_OK) {
    s->now.without_row++;
  }
  objects_let_go(s->store);
}

static void check_catalogue(scrub *s) {
  char why[512];
  s->now.catalogue_damaged = !catalogue_quick_check(s->cat, why, sizeof why);
  if (s->now.catalogue_damaged && !s->last.catalogue_damaged) {
    why[strcspn(why, "\n")] = 0;
    log_error("scrub: the catalogue is damaged: %s. Stop the daemon and restore a backup", why);
  }
  pthread_mutex_lock(&s->lock);
  s->last.catalogue_damaged = s->now.catalogue_damaged; /* told at once, after the log */
  pthread_mutex_unlock(&s->lock);
}

static void finish_round(scrub *s) {
  if (s->now.without_row && s->now.without_row != s->last.without_row) {
    log_warn(
        "scrub: %lld stored files have no row in the catalogue. A crash leaves one or two; more mean that the "
        "catalogue "
        "has lost rows. --gc moves them to lost+found, and uploading a mesh again restores its row",
        (long long)s->now.without_row);
  }
  if (s->named > NAMED) {
    log_error("scrub: %lld further findings are not listed; --check-data lists all", (long long)s->named - NAMED);
  }
  s->now.rounds++;
  s->now.ended = (int64_t)time(NULL);
  pthread_mutex_lock(&s->lock);
  s->last = s->now;
  pthread_mutex_unlock(&s->lock);
}

static void *run(void *argument) {
  scrub *s = argument;
  setpriority(PRIO_PROCESS, (id_t)gettid(), NICE); /* Linux: of this thread alone */
  for (int64_t began = orb_clock_ms(); !is_stopping(s); sleep_until(s, began += s->every)) {
    s->now = (scrub_report){.rounds = s->last.rounds, .bytes = s->last.bytes};
    s->named = 0;
    began = orb_clock_ms();
    if (s->last.rounds > 0) { /* the daemon has checked it before it started the scrub */
      check_catalogue(s);     /* first: reading all objects may take days */
    }
    if (!objects_backup_runs(s->store)) { /* else deleted objects are still there */
      objects_each(s->store, look_for_row, s);
    }
    for (int kind = 0; kind < RESOURCE_KINDS; kind++) {
      verify_rows(s, (resource_kind)kind);
    }
    if (!is_stopping(s)) {
      finish_round(s);
    }
  }
  return NULL;
}

scrub *scrub_start(catalogue *cat, objects *store, int64_t rate, int64_t every) {
  pthread_condattr_t attributes;
  scrub *s = rate > 0 ? calloc(1, sizeof *s) : NULL;
  if (!s) {
    return NULL;
  }
  *s = (scrub){.cat = cat, .store = store, .rate = rate, .every = every};
  pthread_mutex_init(&s->lock, NULL);
  pthread_condattr_init(&attributes);
  pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
  pthread_cond_init(&s->wake, &attributes);
  pthread_condattr_destroy(&attributes);
  if (pthread_create(&s->thread, NULL, run, s) != 0) {
    log_warn("the scrub could not be started");
    free(s);
    return NULL;
  }
  return s;
}

void scrub_stop(scrub *s) {
  if (!s) {
    return;
  }
  pthread_mutex_lock(&s->lock);
  s->stopping = 1;
  pthread_cond_broadcast(&s->wake);
  pthread_mutex_unlock(&s->lock);
  pthread_join(s->thread, NULL);
  pthread_cond_destroy(&s->wake);
  pthread_mutex_destroy(&s->lock);
  free(s);
}

void scrub_read(scrub *s, scrub_report *out) {
  *out = (scrub_report){0};
  if (s) {
    pthread_mutex_lock(&s->lock);
    *out = s->last;
    pthread_mutex_unlock(&s->lock);
  }
}
