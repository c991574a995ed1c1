/* Moving a deployment from one data folder to another: all rows and objects, an interrupted move that continues, and
 * damage. Scenarios move to PostgreSQL and S3 and back. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "store/move.h"
#include "store/object_removal.h"
#include "store/owners.h"

enum { MESHES = 230 }; /* more than a batch of rows and more than a page of objects */

typedef struct two {
  char top[64], from[80], to[80];
  int wrong;      /* objects reported to the listener */
  char what[200]; /* the last one */
} two;

static int setup(void **state) {
  two *s = calloc(1, sizeof *s);
  strcpy(s->top, access("/dev/shm", W_OK) == 0 ? "/dev/shm/orbmorph-move-XXXXXX" : "/tmp/orbmorph-move-XXXXXX");
  if (!mkdtemp(s->top)) {
    return -1;
  }
  snprintf(s->from, sizeof s->from, "%s/from", s->top);
  snprintf(s->to, sizeof s->to, "%s/to", s->top);
  *state = s;
  return mkdir(s->to, 0700);
}

static int teardown(void **state) {
  two *s = *state;
  char command[128];
  snprintf(command, sizeof command, "rm -rf %s", s->top);
  int failed = system(command);
  free(s);
  return failed;
}

static void open_place(const char *data, objects **store, catalogue **cat) {
  assert_int_equal(objects_open(data, store), STORE_OK);
  assert_int_equal(catalogue_open(data, cat), STORE_OK);
}

static void close_place(objects *store, catalogue *cat) {
  catalogue_close(cat);
  objects_close(store);
}

static void text_of(int number, char out[32]) {
  snprintf(out, 32, "mesh %d", number);
}

static void id_of(int number, char out[API_ID_SIZE]) {
  char text[32];
  text_of(number, text);
  api_id_of_text(text, strlen(text), out);
}

static void add(objects *store, catalogue *cat, resource_kind kind, object_kind object, int number,
                const char *tenant) {
  char text[32], json[200];
  resource row = {.kind = kind, .json = json, .bytes = 10, .created = number};
  int fresh;
  text_of(number, text);
  id_of(number, row.id);
  strcpy(row.sha, row.id);
  snprintf(json, sizeof json, "{\"id\":\"%s\",\"name\":\"\xc3\xa9 %d\"}", row.id, number);
  assert_int_equal(objects_put(store, object, row.id, text, strlen(text)), STORE_OK);
  assert_int_equal(kind == RESOURCE_ALIGNMENT ? catalogue_put_alignment(cat, &row, tenant)
                                              : catalogue_put_for(cat, &row, tenant, 0, &fresh),
                   STORE_OK);
}

static void fill(const two *s) {
  objects *store;
  catalogue *cat;
  open_place(s->from, &store, &cat);
  for (int i = 0; i < MESHES; i++) {
    add(store, cat, RESOURCE_MESH, OBJECT_MESH, i, i % 2 ? "ann" : "bob");
  }
  add(store, cat, RESOURCE_ALIGNMENT, OBJECT_ALIGNMENT, 1000, "ann");
  close_place(store, cat);
}

static void hear_rows(void *user, int64_t rows) {
  (void)user;
  assert_true(rows > 0);
}

static void hear_objects(void *user, const object_counts *counts) {
  (void)user;
  assert_true(counts->objects > 0);
}

static void hear_wrong(void *user, const resource *row, const char *what, const char *why) {
  two *s = user;
  s->wrong++;
  snprintf(s->what, sizeof s->what, "%s: %s %s", row->id, what, why);
}

static store_place place_at(const char *data) {
  return (store_place){.data = data, .bucket = {.keys = "", .authorities = ""}};
}

/* Opens a move, and runs it if it opened. */
static store_result go(two *s, int runs, int *goes_on, object_counts *counts) {
  const store_place from = place_at(s->from), to = place_at(s->to);
  const move_listener listener = {hear_rows, hear_objects, hear_wrong, s};
  move *m = NULL;
  *goes_on = 0;
  s->wrong = 0;
  store_result result = move_open(&from, &to, &m);
  if (result == STORE_OK) {
    *goes_on = move_goes_on(m);
    result = runs ? move_run(m, &listener, counts) : STORE_OK;
  }
  move_close(m);
  return result;
}

static void object_at(const char *data, object_kind kind, int number, char out[PATH_MAX]) {
  objects *store;
  char id[API_ID_SIZE];
  id_of(number, id);
  assert_int_equal(objects_open_read_only(data, &store), STORE_OK);
  objects_path(store, kind, id, out);
  objects_close(store);
}

static void flip(const char *path) {
  FILE *file = fopen(path, "r+b");
  assert_non_null(file);
  int byte = fgetc(file);
  rewind(file);
  assert_int_equal(fputc(byte ^ 1, file), byte ^ 1);
  assert_int_equal(fclose(file), 0);
}

/* Whether the target has these meshes, undamaged, and sums that match its rows. */
static void check_target(const two *s, int meshes, int alignments) {
  objects *store;
  catalogue *cat;
  open_place(s->to, &store, &cat);
  assert_int_equal(catalogue_mismatches(cat), 0);
  assert_int_equal(catalogue_bytes(cat, 0), 10 * (meshes + alignments));
  for (int i = 0; i < meshes; i++) {
    char id[API_ID_SIZE], text[32], name[40];
    unsigned char *bytes;
    size_t size;
    resource row;
    id_of(i, id);
    text_of(i, text);
    snprintf(name, sizeof name, "\"\xc3\xa9 %d\"", i);
    assert_int_equal(catalogue_get_of(cat, RESOURCE_MESH, id, i % 2 ? "ann" : "bob", &row), STORE_OK);
    assert_int_equal(row.created, i);
    assert_non_null(strstr(row.json, name));
    resource_free(&row);
    assert_int_equal(objects_load(store, OBJECT_MESH, id, &bytes, &size), STORE_OK);
    assert_int_equal(size, strlen(text));
    assert_memory_equal(bytes, text, size);
    free(bytes);
  }
  assert_int_equal(catalogue_tenant_bytes(cat, "ann"), 10 * (meshes / 2));
  close_place(store, cat);
}

static void test_all_is_moved(void **state) {
  two *s = *state;
  object_counts counts;
  int goes_on;
  fill(s);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_OK);
  assert_false(goes_on);
  assert_int_equal(counts.objects, MESHES + 1);
  assert_int_equal(counts.sent, MESHES + 1);
  assert_int_equal(s->wrong, 0);
  check_target(s, MESHES, 1);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_UNFIT); /* it is not damaged */
  check_target(s, MESHES, 1);
}

static void test_a_move_goes_on(void **state) {
  two *s = *state;
  object_counts counts;
  int goes_on;
  objects *store;
  catalogue *cat = NULL;
  char path[PATH_MAX], id[API_ID_SIZE];
  fill(s);
  assert_int_equal(go(s, 0, &goes_on, &counts), STORE_OK);
  assert_int_equal(catalogue_open(s->to, &cat), STORE_UNFIT);
  object_at(s->from, OBJECT_MESH, 7, path);
  flip(path);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_CONFLICT);
  assert_true(goes_on);
  assert_int_equal(counts.wrong, 1);
  assert_int_equal(counts.sent, MESHES);
  id_of(7, id);
  assert_int_equal(strncmp(s->what, id, strlen(id)), 0);
  assert_non_null(strstr(s->what, "its object does not match its hash"));
  assert_int_equal(catalogue_open(s->to, &cat), STORE_UNFIT);
  object_at(s->to, OBJECT_MESH, 7, path);
  assert_int_not_equal(access(path, F_OK), 0);

  /* Repairs the source, deletes one mesh there, and flips a bit in the copy. */
  object_at(s->from, OBJECT_MESH, 7, path);
  flip(path);
  open_place(s->from, &store, &cat);
  id_of(MESHES - 1, id);
  assert_int_equal(catalogue_delete(cat, RESOURCE_MESH, id), STORE_OK);
  assert_int_equal(objects_delete(store, OBJECT_MESH, id), STORE_OK);
  close_place(store, cat);
  object_at(s->to, OBJECT_MESH, 8, path);
  flip(path);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_OK);
  assert_int_equal(counts.sent, 2);
  assert_int_equal(counts.there, MESHES - 2);
  assert_int_equal(counts.removed, 1);
  object_at(s->to, OBJECT_MESH, MESHES - 1, path);
  assert_int_not_equal(access(path, F_OK), 0);
  check_target(s, MESHES - 1, 1);
}

/* A damaged alignment is omitted with its row: no caller could delete it. */
static void test_a_damaged_alignment_is_left_out(void **state) {
  two *s = *state;
  object_counts counts;
  int goes_on;
  char path[PATH_MAX];
  fill(s);
  object_at(s->from, OBJECT_ALIGNMENT, 1000, path);
  flip(path);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_OK);
  assert_int_equal(counts.left_out, 1);
  assert_int_equal(s->wrong, 1);
  check_target(s, MESHES, 0);
}

static void test_what_does_not_fit(void **state) {
  two *s = *state;
  object_counts counts;
  int goes_on;
  objects *store;
  catalogue *cat;
  assert_int_equal(mkdir(s->from, 0700), 0);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_UNFIT); /* no catalogue */
  fill(s);
  open_place(s->to, &store, &cat);
  add(store, cat, RESOURCE_MESH, OBJECT_MESH, 1, "ann");
  close_place(store, cat);
  assert_int_equal(go(s, 1, &goes_on, &counts), STORE_UNFIT); /* another deployment */
  open_place(s->to, &store, &cat);
  assert_int_equal(catalogue_bytes(cat, 0), 10);
  close_place(store, cat);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(test_all_is_moved, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_move_goes_on, setup, teardown),
      cmocka_unit_test_setup_teardown(test_a_damaged_alignment_is_left_out, setup, teardown),
      cmocka_unit_test_setup_teardown(test_what_does_not_fit, setup, teardown),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
