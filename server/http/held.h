/* The memory that requests hold for their callers: bodies of JSON that arrive or wait, decoders of compressed bodies,
 * texts of answers until they are sent, and answers that are kept for the next caller (encoded.h). One budget counts
 * all of it.
 *
 * Contract. An owner may hold at most HELD_SHARE times as much as it leaves free: alone two thirds of the budget, a
 * second one two thirds of the rest, and so on. So however much some hold, others find room. Answers that are only kept
 * give way to all. Nobody waits: what does not fit is refused, or done without memory. Any thread may use it.
 *
 * Small parts have an allowance beside the budget, so that a short request passes while others hold all of it. The
 * allowance is small as well: beyond it a small part counts from its first byte, as a connection may stall with one.
 */
#ifndef ORB_HTTP_HELD_H
#define ORB_HTTP_HELD_H

#include <stdint.h>

typedef struct held held;

/* HELD_FREE: bytes of a small part at most. All of them are free while they have no more than this fraction of the
 * budget together, and those of an owner this one of it: 4 MB and 1 MB of 64 MB. */
enum { HELD_FREE = 16 << 10, HELD_FREE_ALL = 16, HELD_FREE_OWN = 64 };
enum { HELD_SHARE = 2 };
/* Owners whose numbers agree modulo this share their part. HELD_KEPT is the owner of kept answers. */
enum { HELD_OWNERS = 256, HELD_KEPT = HELD_OWNERS };

/* What a request holds of one kind. Starts as {0}. */
typedef struct held_part {
  int64_t free, counted; /* bytes: one of them is 0 */
} held_part;

held *held_create(int64_t most); /* NULL: out of memory */
void held_destroy(held *h);
/* Sets a function that frees so many bytes of kept answers, or as many as there are. Before threads start. It calls
 * held_give(). */
void held_on_lack(held *h, void (*give_way)(void *user, int64_t bytes), void *user);
/* owner: a number of any size, or HELD_KEPT. 1, or 0: there is no room. h NULL: there is always room. */
int held_take(held *h, uint64_t owner, int64_t bytes);
void held_give(held *h, uint64_t owner, int64_t bytes);
/* Changes a part of an owner to so many bytes, free ones where the allowance has them. 0: there is no room, and nothing
 * changes. A part that has become smaller always fits. Calls for the same part come one after the other. */
int held_set(held *h, uint64_t owner, held_part *part, int64_t now);
int64_t held_bytes(held *h); /* without the free ones */

#endif
