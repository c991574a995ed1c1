/* The memory that requests hold: shares of owners, and kept answers that give way. Expected values follow from the
 * contract in server/http/held.h. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "http/encoded.h"
#include "http/held.h"

static int take_all(held *h, uint64_t owner) {
  int taken = 0;
  while (held_take(h, owner, 1)) {
    taken++;
  }
  return taken;
}

/* Each owner gets two thirds of what the others left. */
static void shares(void **state) {
  held *h = held_create(900);
  (void)state;
  assert_int_equal(take_all(h, 1), 600);
  assert_int_equal(take_all(h, 2), 200);
  assert_int_equal(take_all(h, HELD_OWNERS + 2), 0); /* shares the part of 2 */
  assert_int_equal(take_all(h, 3), 66);
  assert_int_equal(held_bytes(h), 866);
  held_give(h, 1, 600);
  assert_int_equal(held_take(h, 2, 201), 1); /* 401 beside 433 */
  assert_int_equal(held_take(h, 4, 601), 0);
  held_give(h, 2, 401);
  held_give(h, 3, 66);
  assert_int_equal(held_bytes(h), 0);
  assert_int_equal(held_take(h, 4, 601), 0); /* more than any may have */
  assert_int_equal(held_take(h, 4, 600), 1);
  assert_int_equal(held_take(NULL, 4, 1000), 1);
  held_destroy(h);
}

/* Small parts are free up to a sixteenth of the budget, those of an owner up to a 64th of it. Then they count. */
static void allowance(void **state) {
  enum { KILOBYTE = 1 << 10, MOST = 1024 * KILOBYTE, SMALL = 4 * KILOBYTE, PARTS = 64 };
  held *h = held_create(MOST);
  held_part mine[PARTS] = {{0}}, others[PARTS] = {{0}}, large = {0}, none = {0};
  (void)state;
  for (int i = 0; i < 4; i++) {
    assert_true(held_set(h, 1, &mine[i], SMALL));
    assert_int_equal(mine[i].free, SMALL);
  }
  assert_int_equal(held_bytes(h), 0);
  assert_true(held_set(h, 1, &mine[4], SMALL)); /* 20 KB of 16 */
  assert_int_equal(mine[4].counted, SMALL);
  assert_int_equal(held_bytes(h), SMALL);
  for (int i = 0; i < 13; i++) { /* other owners have 48 of 64 KB together */
    assert_true(held_set(h, 2 + (uint64_t)i, &others[i], SMALL));
    assert_int_equal(others[i].counted, i < 12 ? 0 : SMALL);
  }
  assert_int_equal(held_bytes(h), 2 * SMALL);
  assert_true(held_set(h, 1, &mine[0], 2 * HELD_FREE)); /* grows out of the allowance, and leaves it to another */
  assert_int_equal(mine[0].free, 0);
  assert_int_equal(held_bytes(h), 2 * HELD_FREE + 2 * SMALL);
  assert_true(held_set(h, 1, &mine[4], SMALL + 1)); /* no: the owner has 12 + 4 KB and a byte */
  assert_int_equal(mine[4].counted, SMALL + 1);
  assert_true(held_set(h, 20, &others[13], SMALL));
  assert_int_equal(others[13].free, SMALL);
  assert_true(held_set(h, 30, &large, 600 * KILOBYTE)); /* two thirds are 660 */
  assert_false(held_set(h, 30, &none, 200 * KILOBYTE));
  assert_int_equal(none.counted + none.free, 0);
  assert_false(held_set(h, 30, &none, HELD_FREE + 1 + 60 * KILOBYTE));
  assert_true(held_set(h, 30, &large, SMALL)); /* what becomes smaller fits, as counted: the allowance is used up */
  assert_int_equal(large.counted, SMALL);
  for (int i = 0; i < PARTS; i++) {
    assert_true(held_set(h, 1, &mine[i], 0));
    assert_true(held_set(h, i == 13 ? 20 : 2 + (uint64_t)i, &others[i], 0));
  }
  assert_true(held_set(h, 30, &large, 0));
  assert_int_equal(held_bytes(h), 0);
  assert_true(held_set(h, 1, &none, HELD_FREE)); /* the whole allowance is there again */
  assert_int_equal(none.free, HELD_FREE);
  assert_true(held_set(NULL, 1, &none, MOST));
  held_destroy(h);
}

/* So many small parts that stall use up the budget, and no more than that and the allowance. */
static void many_small(void **state) {
  enum { MOST = 1 << 20, SMALL = 1000, PARTS = 4000 };
  held *h = held_create(MOST);
  held_part *parts = calloc(PARTS, sizeof *parts), other = {0};
  int64_t taken = 0;
  (void)state;
  assert_non_null(parts);
  for (int i = 0; i < PARTS; i++) {
    taken += held_set(h, 1, &parts[i], SMALL) ? SMALL : 0;
  }
  assert_in_range(taken, MOST * 2 / 3, MOST * 2 / 3 + MOST / 64);
  assert_true(held_set(h, 2, &other, HELD_FREE)); /* another owner finds room */
  assert_int_equal(other.free, HELD_FREE);
  for (int i = 0; i < PARTS; i++) {
    held_set(h, 1, &parts[i], 0);
  }
  assert_int_equal(held_bytes(h), 0);
  free(parts);
  held_destroy(h);
}

/* Kept answers leave for a request, the oldest first; one that is being sent counts until it was sent. */
static void kept_answers(void **state) {
  enum { EACH = 100000 };
  char *bytes = malloc(EACH), tag[16];
  held *h = held_create(9 * EACH);
  encoded_cache *c = encoded_open(20 * EACH, h);
  (void)state;
  memset(bytes, 7, EACH);
  for (int i = 0; i < 6; i++) {
    snprintf(tag, sizeof tag, "%d", i);
    const encoded *e = encoded_make(c, tag, CODING_NONE, bytes, EACH);
    assert_non_null(e);
    encoded_release(e);
  }
  assert_int_equal(held_bytes(h), 6 * EACH);
  assert_false(held_take(h, 1, 7 * EACH)); /* more than its two thirds: no answer leaves in vain */
  assert_int_equal(held_bytes(h), 6 * EACH);
  const encoded *sent = encoded_find(c, "0", CODING_NONE); /* the newest now */
  assert_non_null(sent);
  assert_true(held_take(h, 1, 4 * EACH)); /* leaves 2 of 9 beside 3 kept */
  assert_null(encoded_find(c, "1", CODING_NONE));
  assert_int_equal(held_bytes(h), 7 * EACH);
  assert_false(held_take(h, 1, 2 * EACH)); /* 6 could leave 3 only if nothing is sent */
  assert_null(encoded_find(c, "5", CODING_NONE));
  assert_int_equal(held_bytes(h), 5 * EACH);
  encoded_release(sent);
  assert_int_equal(held_bytes(h), 4 * EACH);
  assert_true(held_take(h, 1, 2 * EACH));
  assert_null(encoded_make(c, "7", CODING_NONE, bytes, 3 * EACH)); /* no room: it is not kept */
  held_give(h, 1, 6 * EACH);
  encoded_close(c);
  assert_int_equal(held_bytes(h), 0);
  held_destroy(h);
  free(bytes);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(shares), cmocka_unit_test(allowance),
                                     cmocka_unit_test(many_small), cmocka_unit_test(kept_answers)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
