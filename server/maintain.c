#include "maintain.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "evict.h"
#include "store/object_removal.h"
#include "store/owners.h"
#include "store/place.h"
#include "store/several.h"
#include "store/shared.h"
#include "store/spheres.h"
#include "store/verify.h"

enum { PAGE = 64 };

typedef struct tally {
  catalogue *cat;
  objects *store;
  long objects, rows, wrong, orphans;
  int remove_orphans, unfit;
} tally;

static const char *const names[RESOURCE_KINDS] = {"mesh", "embedding", "supermesh", "landmarks", "alignment"};

/* An object of a page of rows, and what is wrong with it; NULL: nothing. */
typedef struct item {
  const resource *row;
  named_object object;
  const char *fault;
  uint64_t bytes;
} item;

typedef struct row_page {
  const objects *store;
  resource rows[PAGE];
  item items[PAGE * RESOURCE_OBJECTS];
} row_page;

/* Verifies an object against its hash. A row of an older engine has no hash: the object must only exist. The file of
 * aligned spheres has its hash within itself. */
static int verify(void *user, int k) {
  const row_page *p = user;
  item *i = &((row_page *)user)->items[k];
  char sha[API_ID_SIZE];
  int fd;
  if (i->object.kind == OBJECT_SPHERES) {
    i->fault = spheres_check(p->store, i->row->id) == STORE_OK ? NULL : "its aligned spheres are missing or damaged";
    return 1;
  }
  if (objects_read(p->store, i->object.kind, i->row->id, &fd, &i->bytes) != STORE_OK) {
    i->fault = "cannot be read";
    return 1;
  }
  if (!verify_hash(fd, sha)) {
    i->fault = "cannot be read";
  } else if (i->object.sha[0] && strcmp(sha, i->object.sha) != 0) {
    i->fault = "does not match its hash";
  }
  close(fd);
  return 1;
}

static void tell(const item *i) {
  if (i->object.kind == OBJECT_SPHERES) {
    printf("supermesh %s: %s\n", i->row->id, i->fault);
  } else if (i->bytes) {
    printf("%s %s: %s (%llu bytes) %s\n", names[i->row->kind], i->row->id, i->object.what, (unsigned long long)i->bytes,
           i->fault);
  } else {
    printf("%s %s: %s %s\n", names[i->row->kind], i->row->id, i->object.what, i->fault);
  }
}

/* Verifies all objects of the first `rows` rows of a page at once. */
static void verify_page(tally *t, row_page *p, int rows) {
  int count = 0;
  for (int r = 0; r < rows; r++) {
    named_object named[RESOURCE_OBJECTS];
    int many = resource_objects(&p->rows[r], named);
    for (int i = 0; i < many; i++) {
      p->items[count++] = (item){.row = &p->rows[r], .object = named[i]};
    }
  }
  t->rows += rows;
  several_run(count, verify, p);
  for (int i = 0; i < count; i++) {
    if (p->items[i].fault) {
      tell(&p->items[i]);
      t->wrong++;
    }
  }
}

static void each_row(tally *t, row_page *p, resource_kind kind) {
  int64_t before = 0;
  for (int n = PAGE; n == PAGE;) {
    n = catalogue_list(t->cat, kind, before, PAGE, p->rows);
    if (n < 0) {
      puts("the rows of the catalogue cannot be read");
      t->wrong++;
      return;
    }
    verify_page(t, p, n);
    for (int i = 0; i < n; i++) {
      before = p->rows[i].seq;
      resource_free(&p->rows[i]);
    }
  }
}

static void each_resource(tally *t) {
  row_page *p = calloc(1, sizeof *p);
  if (!p) {
    puts("out of memory");
    t->wrong++;
    return;
  }
  p->store = t->store;
  for (int kind = 0; kind < RESOURCE_KINDS; kind++) {
    each_row(t, p, (resource_kind)kind);
  }
  free(p);
}

/* The object may be published again meanwhile. What is in S3 is fetched before others have to wait. */
static store_result set_aside(const tally *t, object_kind kind, const char *id) {
  int fd;
  uint64_t size;
  if (objects_are_remote(t->store) && objects_read(t->store, kind, id, &fd, &size) == STORE_OK) {
    close(fd);
  }
  store_result result = STORE_CONFLICT;
  if (objects_exclude(t->store) && !evict_is_named(t->cat, kind, id)) {
    result = objects_set_aside(t->store, kind, id);
  }
  objects_let_go(t->store);
  return result;
}

/* A crash between publishing and commit leaves an object without a row, and so does a catalogue that lost rows. */
static void each_object(void *user, object_kind kind, const char *id, uint64_t size) {
  tally *t = user;
  t->objects++;
  if (!evict_is_named(t->cat, kind, id)) {
    t->orphans++;
    if (t->remove_orphans && set_aside(t, kind, id) == STORE_OK) {
      printf("moved object %s (%llu bytes), which has no row, to lost+found\n", id, (unsigned long long)size);
    }
  }
}

static int open_both(const config *options, tally *t) {
  const store_place place = store_place_of(options);
  store_result result = stores_open(&place, &t->store, &t->cat);
  t->unfit = result == STORE_UNFIT;
  if (result == STORE_OK && !catalogue_maintain(t->cat)) {
    puts("another --gc or --check-data works on this catalogue: run this one when it has ended");
    return 0;
  }
  return result == STORE_OK;
}

static void close_both(tally *t) {
  catalogue_close(t->cat);
  objects_close(t->store);
}

/* found: how many rows are wrong; −1: they cannot be read. */
static void count_wrong(tally *t, int64_t found, const char *what) {
  if (found != 0) {
    puts(found < 0 ? "the rows of the catalogue cannot be read" : what);
    t->wrong++;
  }
}

int maintain_check(const config *options) {
  tally t = {0};
  if (!open_both(options, &t)) {
    close_both(&t);
    return t.unfit ? CONFIG_UNFIT : 1;
  }
  if (!catalogue_integrity(t.cat)) {
    puts("the catalogue fails SQLite's integrity check");
    t.wrong++;
  }
  count_wrong(&t, catalogue_mismatches(t.cat), "the catalogue's owners or stored sums do not match its rows");
  count_wrong(&t, catalogue_damaged(t.cat), "the catalogue has rows with invalid values");
  each_resource(&t);
  if (objects_each(t.store, each_object, &t) != STORE_OK) {
    puts("some folders of objects cannot be read");
    t.wrong++;
  }
  printf("%ld rows and %ld objects checked: %ld wrong, %ld objects without a row (--gc moves them to lost+found)\n",
         t.rows, t.objects, t.wrong, t.orphans);
  if (t.orphans) {
    puts(
        "a crash may leave one or two objects without a row; if there are more, the catalogue has lost rows: restore a "
        "backup, or upload the meshes again from objects/mesh or lost+found/mesh-*");
  }
  if (t.wrong) {
    puts(
        "start the daemon, DELETE the resources named above, and upload or request them again (not alignments: the "
        "daemon computes a damaged one again); if the catalogue itself is damaged, restore a backup of the data "
        "folder");
  }
  close_both(&t);
  return t.wrong != 0;
}

static int forget_jobs(catalogue *cat, int64_t keep) {
  enum { BATCH = 1000 };
  int64_t many = catalogue_jobs_ended(cat) - keep;
  store_result result = STORE_OK;
  if (keep > 0 && many > 0) {
    printf("deleted %lld ended jobs beyond keep-jobs\n", (long long)many);
  }
  for (; keep > 0 && many > 0 && result == STORE_OK; many -= BATCH) {
    result = catalogue_jobs_forget(cat, many < BATCH ? (int)many : BATCH);
  }
  return result == STORE_OK;
}

int maintain_gc(const config *options) {
  tally t = {.remove_orphans = 1};
  int fine = open_both(options, &t);
  if (fine && !objects_hold_backups(t.store)) {
    puts("a backup of the data folder runs; run --gc after it");
    fine = 0;
  }
  if (fine) {
    long purged = objects_purge_lost(t.store, (int64_t)time(NULL) - 86400 * options->lost_days);
    if (purged) {
      printf("deleted %ld files that were in lost+found for %lld days\n", purged, (long long)options->lost_days);
    }
    fine = objects_each(t.store, each_object, &t) == STORE_OK && forget_jobs(t.cat, options->keep_jobs);
    if (options->derived_bytes > 0) {
      const evict_env env = {.cat = t.cat, .store = t.store};
      evict_derived(&env, options->derived_bytes, INT64_MAX);
    }
  }
  close_both(&t);
  return t.unfit ? CONFIG_UNFIT : !fine;
}
