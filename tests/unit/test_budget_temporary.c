/* Temporary files of meshes that arrive: shares of owners. Expected values follow from the contract in
 * server/temporary.h. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hash.h"
#include "temporary.h"

/* A disk whose room shrinks with each byte that is written. */
typedef struct disk {
  temporary *t;
  int64_t room;
} disk;

static temporary_room take(disk *d, temporary_file *file, int64_t bytes, int64_t most) {
  const temporary_limits limits = {.room = d->room, .most = most};
  const temporary_room looked = temporary_look(d->t, file, bytes, &limits);
  const temporary_room room = temporary_take(d->t, file, bytes, &limits);
  assert_int_equal(looked, room);
  d->room -= room == TEMPORARY_FREE ? bytes : 0;
  return room;
}

static int64_t take_all(disk *d, temporary_file *file, int64_t most) {
  int64_t taken = 0;
  while (take(d, file, 1, most) == TEMPORARY_FREE) {
    taken++;
  }
  return taken;
}

static void delete_file(disk *d, temporary_file *file) {
  d->room += file->bytes;
  temporary_give(d->t, file);
  assert_int_equal(file->bytes, 0);
}

/* Each owner gets half of what the others left, however many files it has. */
static void shares(void **state) {
  disk d = {.t = temporary_create(), .room = 1000};
  temporary_file files[40] = {{0}}, second = {.owner = 2}, third = {.owner = 3 + 256}, fourth = {.owner = 3};
  int64_t taken = 0;
  (void)state;
  for (int i = 0; i < 40; i++) {
    files[i].owner = 1;
    taken += i < 39 ? take(&d, &files[i], 10, 0) == TEMPORARY_FREE ? 10 : 0 : take_all(&d, &files[i], 0);
  }
  assert_int_equal(taken, 500);
  assert_int_equal(take(&d, &files[0], 1, 0), TEMPORARY_OTHERS);
  assert_int_equal(take_all(&d, &second, 0), 250);
  assert_int_equal(take(&d, &second, 1, 0), TEMPORARY_FULL);
  assert_int_equal(take_all(&d, &third, 0), 125);
  assert_int_equal(take_all(&d, &fourth, 0), 62); /* in one bucket with the third, but not of its share */
  assert_int_equal(temporary_bytes(d.t), 937);
  for (int i = 0; i < 40; i++) {
    delete_file(&d, &files[i]);
  }
  assert_int_equal(take_all(&d, &second, 0), 156); /* 406 beside 407 */
  delete_file(&d, &third);
  delete_file(&d, &second);
  delete_file(&d, &fourth);
  delete_file(&d, &fourth); /* twice is fine */
  assert_int_equal(temporary_bytes(d.t), 0);
  assert_int_equal(take(&d, &second, 501, 0), TEMPORARY_FULL);
  assert_int_equal(take(&d, &second, 500, 0), TEMPORARY_FREE);
  delete_file(&d, &second);
  temporary_destroy(d.t);
}

/* A limit of the owner's own, and a disk without room. */
static void limits(void **state) {
  disk d = {.t = temporary_create(), .room = 1000};
  temporary_file one = {.owner = 7}, two = {.owner = 7}, other = {.owner = 8};
  (void)state;
  assert_int_equal(take(&d, &one, 101, 100), TEMPORARY_FULL);
  assert_int_equal(take(&d, &one, 60, 100), TEMPORARY_FREE);
  assert_int_equal(take(&d, &two, 41, 100), TEMPORARY_OTHERS);
  assert_int_equal(take(&d, &two, 40, 100), TEMPORARY_FREE);
  assert_int_equal(take(&d, &other, 400, 0), TEMPORARY_FREE);
  delete_file(&d, &one);
  assert_int_equal(take(&d, &two, 60, 100), TEMPORARY_FREE);
  d.room = -50; /* someone else has filled the disk beyond the reserve */
  assert_int_equal(take(&d, &other, 1, 0), TEMPORARY_FULL);
  assert_int_equal(take(&d, &one, 1, 0), TEMPORARY_OTHERS);
  temporary_give(d.t, &two);
  temporary_give(d.t, &other);
  assert_int_equal(temporary_bytes(d.t), 0);
  temporary_destroy(d.t);
}

/* Downloads and uploads of a tenant have the same owner, which is not that of an address. */
static void owners(void **state) {
  (void)state;
  assert_true(tenant_hash("ann") == tenant_hash("ann"));
  assert_true(tenant_hash("ann") != tenant_hash("bob"));
  assert_true(tenant_hash("") >> 63);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(shares), cmocka_unit_test(limits), cmocka_unit_test(owners)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
