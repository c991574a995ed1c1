/* The worker time that each owner has used, for fairness between owners. */
#include <string.h>

#include "queue/internal.h"

/* The index of an owner's entry. If the table is full, an owner without unfinished jobs gives up its entry. */
static int owner_at(queue *q, const char *name) {
  int at = 0, free_at = OWNERS - 1;
  while (at < q->owner_count && strcmp(q->owners[at].name, name) != 0) {
    if (q->owners[at].unfinished == 0) {
      free_at = at;
    }
    at++;
  }
  if (at < q->owner_count) {
    return at;
  }
  if (q->owner_count < OWNERS) {
    q->owner_count++;
  } else {
    at = free_at;
  }
  copy_text(q->owners[at].name, sizeof q->owners[at].name, name);
  q->owners[at].service = 0;
  return at;
}

void owner_charge(queue *q, job *j, int64_t ms) {
  q->owners[j->owner].service += ms - j->charged;
  j->charged = ms;
}

void owners_charge(queue *q) {
  int64_t now = orb_clock_ms();
  for (job *j = q->first; j && q->running > 0; j = j->next) {
    if (j->taken_at && !fetches(j) && used_ms(j, now) > j->charged) {
      owner_charge(q, j, used_ms(j, now));
    }
  }
}

/* An owner without unfinished jobs does not save up service: it starts level with the least served of the others. */
void owner_enter(queue *q, job *j) {
  j->owner = owner_at(q, j->row.owner);
  if (q->owners[j->owner].unfinished++ > 0) {
    return;
  }
  owners_charge(q);
  int64_t least = -1, *mine = &q->owners[j->owner].service;
  for (int i = 0; i < q->owner_count; i++) {
    if (i != j->owner && q->owners[i].unfinished > 0 && (least < 0 || q->owners[i].service < least)) {
      least = q->owners[i].service;
    }
  }
  *mine = *mine > least ? *mine : least;
}

void owner_leave(queue *q, const job *j) {
  q->owners[j->owner].unfinished--;
}
