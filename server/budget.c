#include "budget.h"

#include <pthread.h>
#include <stdlib.h>

#include "wake.h"

/* Bytes of memory per byte of the file. FILE_BYTES: real files take up to 5.4 in the budget of the check, and its
 * process takes some more. A larger figure would let fewer checks run side by side. */
enum { FILE_BASE = 4 << 20, FILE_BYTES = 9, DENSEST_BYTES = 200 };
/* Filling holes makes up to 24 triangles for each edge of a hole, of which a file has one in 4 bytes, and 131,072 in
 * all. Each takes 1.2 KB while the fill is made fair. */
enum { FILL_BYTES = 7200, FILL_MOST = 160 << 20 };

/* Bytes per byte of the asset: real ones take up to 3.5 (bench-profile). */
enum { PROFILE_BYTES = 4 };
/* How soon one that waits sees that it is no longer wanted. */
enum { LOOK_MS = 200 };

struct memory_budget {
  pthread_mutex_t lock;
  pthread_cond_t freed;
  int64_t total, kept;                             /* of all parts; of that, for BUDGET_SMALL alone */
  int64_t most[BUDGET_PARTS], taken[BUDGET_PARTS]; /* by part */
  unsigned shortages[BUDGET_PARTS];                /* of all kinds */
  unsigned full[BUDGET_PARTS], others;             /* by kind: BUDGET_FULL, BUDGET_OTHERS */
  unsigned told_full[BUDGET_PARTS], told_others;   /* how many there were when the listeners were called */
  budget_claim *claims;                            /* those with bytes, oldest first */
  struct {
    void (*freed)(void *user);
    void *user;
  } listeners[BUDGET_LISTENERS];
  int listener_count;
};

static int64_t least(int64_t a, int64_t b) {
  return a < b ? a : b;
}

memory_budget *budget_create(int64_t job_memory) {
  memory_budget *b = calloc(1, sizeof *b);
  if (b) {
    b->most[BUDGET_JOBS] = job_memory;
    b->most[BUDGET_CHECKS] = job_memory / 2;
    b->most[BUDGET_SMALL] = job_memory / 4;
    b->total = job_memory + least(BUDGET_BESIDE, b->most[BUDGET_CHECKS] + b->most[BUDGET_SMALL]);
    b->kept = least(BUDGET_KEPT, b->most[BUDGET_SMALL]);
    pthread_mutex_init(&b->lock, NULL);
    wake_init(&b->freed);
  }
  return b;
}

void budget_destroy(memory_budget *b) {
  if (b) {
    pthread_mutex_destroy(&b->lock);
    pthread_cond_destroy(&b->freed);
  }
  free(b);
}

void budget_listen(memory_budget *b, void (*freed)(void *user), void *user) {
  b->listeners[b->listener_count].freed = freed;
  b->listeners[b->listener_count++].user = user;
}

int64_t budget_most(const memory_budget *b, budget_part part) {
  return b->most[part];
}

/* The bytes that other parts claim and could take if this part left them, claims newer than `own` excepted. Claims of
 * one part are met one after another. */
static int64_t claimed_by_others(const memory_budget *b, budget_part part, const budget_claim *own) {
  int64_t claimed[BUDGET_PARTS] = {0}, sum = 0;
  for (const budget_claim *c = b->claims; c && c != own; c = c->next) {
    if (c->part != part && c->bytes <= b->most[c->part] - b->taken[c->part] && c->bytes > claimed[c->part]) {
      sum += c->bytes - claimed[c->part];
      claimed[c->part] = c->bytes;
    }
  }
  return sum;
}

/* Of all memory, what the part may still take. */
static int64_t left_of_all(const memory_budget *b, budget_part part, const budget_claim *own) {
  int64_t left = b->total;
  for (int p = 0; p < BUDGET_PARTS; p++) {
    left -= b->taken[p];
  }
  const int64_t kept = b->kept > b->taken[BUDGET_SMALL] ? b->kept - b->taken[BUDGET_SMALL] : 0;
  left -= kept + claimed_by_others(b, part, own);
  if (part != BUDGET_SMALL) {
    return left;
  }
  return kept + (left > 0 ? left : 0);
}

/* Under the lock. */
static budget_room look(memory_budget *b, budget_part part, int64_t bytes, const budget_claim *own) {
  const budget_room room = bytes > b->most[part] - b->taken[part] ? BUDGET_FULL
                           : bytes > left_of_all(b, part, own)    ? BUDGET_OTHERS
                                                                  : BUDGET_FREE;
  b->shortages[part] += room != BUDGET_FREE;
  b->full[part] += room == BUDGET_FULL;
  b->others += room == BUDGET_OTHERS;
  return room;
}

budget_room budget_look(memory_budget *b, budget_part part, int64_t bytes, const budget_claim *own) {
  pthread_mutex_lock(&b->lock);
  const budget_room room = look(b, part, bytes, own);
  pthread_mutex_unlock(&b->lock);
  return room;
}

int64_t budget_left(memory_budget *b, budget_part part) {
  pthread_mutex_lock(&b->lock);
  const int64_t left = least(b->most[part] - b->taken[part], left_of_all(b, part, NULL));
  pthread_mutex_unlock(&b->lock);
  return left;
}

budget_room budget_take(memory_budget *b, budget_part part, int64_t bytes, const budget_claim *own) {
  pthread_mutex_lock(&b->lock);
  const budget_room room = look(b, part, bytes, own);
  b->taken[part] += room == BUDGET_FREE ? bytes : 0;
  pthread_mutex_unlock(&b->lock);
  return room;
}

/* Under the lock. */
static void set_claim(memory_budget *b, budget_claim *claim, int64_t bytes) {
  budget_claim **at = &b->claims;
  while (*at && *at != claim) {
    at = &(*at)->next;
  }
  if (*at && bytes == 0) {
    *at = claim->next;
  } else if (!*at && bytes > 0) {
    claim->next = NULL;
    *at = claim;
  }
  claim->bytes = bytes;
}

void budget_claim_bytes(memory_budget *b, budget_claim *claim, int64_t bytes) {
  pthread_mutex_lock(&b->lock);
  set_claim(b, claim, bytes);
  pthread_mutex_unlock(&b->lock);
}

unsigned budget_shortages(memory_budget *b, budget_part part) {
  pthread_mutex_lock(&b->lock);
  unsigned shortages = b->shortages[part];
  pthread_mutex_unlock(&b->lock);
  return shortages;
}

int budget_wait(memory_budget *b, budget_part part, int64_t bytes, int (*continues)(void *user), void *user) {
  budget_claim claim = {.part = part};
  int goes_on = 1;
  pthread_mutex_lock(&b->lock);
  for (budget_room room; goes_on && (room = look(b, part, bytes, &claim)) != BUDGET_FREE;) {
    if (room == BUDGET_OTHERS) {
      set_claim(b, &claim, bytes);
    }
    wake_wait_ms(&b->freed, &b->lock, LOOK_MS);
    pthread_mutex_unlock(&b->lock);
    goes_on = continues(user);
    pthread_mutex_lock(&b->lock);
  }
  set_claim(b, &claim, 0);
  b->taken[part] += goes_on ? bytes : 0;
  pthread_mutex_unlock(&b->lock);
  if (!goes_on) {
    budget_tell(b, NULL);
  }
  return goes_on;
}

/* Calls the listeners but that of `self`. */
static void tell(memory_budget *b, const void *self) {
  for (int i = 0; i < b->listener_count; i++) {
    if (b->listeners[i].user != self) {
      b->listeners[i].freed(b->listeners[i].user);
    }
  }
}

/* Under the lock. Whether another part's memory or claim was in someone's way since the last time. */
static int others_wait(memory_budget *b) {
  const int wait = b->others != b->told_others;
  b->told_others = b->others;
  pthread_cond_broadcast(&b->freed);
  return wait;
}

void budget_give(memory_budget *b, budget_part part, int64_t bytes, const void *self) {
  pthread_mutex_lock(&b->lock);
  b->taken[part] -= bytes;
  const int wanted = others_wait(b) | (b->full[part] != b->told_full[part]);
  b->told_full[part] = b->full[part];
  pthread_mutex_unlock(&b->lock);
  if (wanted) {
    tell(b, self);
  }
}

void budget_tell(memory_budget *b, const void *self) {
  pthread_mutex_lock(&b->lock);
  const int wanted = others_wait(b);
  pthread_mutex_unlock(&b->lock);
  if (wanted) {
    tell(b, self);
  }
}

static int64_t for_file(const memory_budget *b, budget_part part, int64_t bytes, int64_t multiple, int64_t more) {
  const int64_t most = b->most[part], base = FILE_BASE + more;
  return most <= base || bytes > (most - base) / multiple ? most : base + multiple * bytes;
}

int64_t budget_for_file(const memory_budget *b, budget_part part, int64_t bytes) {
  return for_file(b, part, bytes, FILE_BYTES, 0);
}

int64_t budget_for_densest_file(const memory_budget *b, budget_part part, int64_t bytes, int fills) {
  const int64_t fill = bytes < FILL_MOST / FILL_BYTES ? FILL_BYTES * bytes : FILL_MOST;
  return for_file(b, part, bytes, DENSEST_BYTES, fills ? fill : 0);
}

int64_t budget_for_profile(const memory_budget *b, int64_t bytes) {
  const int64_t most = b->most[BUDGET_CHECKS] / 2;
  return most <= FILE_BASE || bytes > (most - FILE_BASE) / PROFILE_BYTES ? most : FILE_BASE + PROFILE_BYTES * bytes;
}
