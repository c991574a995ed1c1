#include "migrate.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "folder_lock.h"
#include "store/move.h"

enum { TELL_SECONDS = 5 }; /* between two lines of progress */

static const char usage[] =
    "  orbmorphd migrate --from-data DIR [--from-catalogue URL] [--from-objects URL] [--from-s3-keys FILE]\n"
    "                    --data NEW [--catalogue URL] [--objects URL]\n";

static int complain(const char *what, const char *why) {
  fprintf(stderr, "orbmorphd: %s %s\n", what, why);
  return 0;
}

/* Takes --from-NAME VALUE or --from-NAME=VALUE at argv[at]. *used: how many arguments it takes; 0: another option. */
static int take_option(migrate_command *out, int argc, char **argv, int at, int *used) {
  const struct {
    const char *name;
    const char **value;
  } options[] = {{"--from-data", &out->data},
                 {"--from-catalogue", &out->catalogue},
                 {"--from-objects", &out->objects},
                 {"--from-s3-keys", &out->keys}};
  *used = 0;
  for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
    size_t length = strlen(options[i].name);
    if (strncmp(argv[at], options[i].name, length) != 0 || (argv[at][length] && argv[at][length] != '=')) {
      continue;
    }
    *used = argv[at][length] ? 1 : 2;
    if (*used == 2 && at + 1 >= argc) {
      return complain(argv[at], "needs a value");
    }
    *options[i].value = *used == 1 ? argv[at] + length + 1 : argv[at + 1];
  }
  return 1;
}

int migrate_command_read(migrate_command *out, int *argc, char **argv) {
  *out = (migrate_command){NULL, "sqlite", "files", NULL};
  if (*argc < 2 || strcmp(argv[1], "migrate") != 0) {
    return 1;
  }
  int kept = 1;
  for (int at = 2, used; at < *argc; at += used ? used : 1) {
    if (!take_option(out, *argc, argv, at, &used)) {
      return 0;
    }
    if (!used) {
      argv[kept++] = argv[at];
    }
  }
  argv[kept] = NULL;
  *argc = kept;
  if (!out->data && !(kept > 1 && strcmp(argv[1], "--help") == 0)) {
    fprintf(stderr, "orbmorphd migrate: --from-data is missing\n%s", usage);
    return 0;
  }
  return 1;
}

/* The configuration of the source: its own options, and all else as for the target. */
static int read_source(const migrate_command *c, const config *to, config *from) {
  char *argv[] = {"orbmorphd",
                  "--data",
                  (char *)c->data,
                  "--catalogue",
                  (char *)c->catalogue,
                  "--objects",
                  (char *)c->objects,
                  "--s3-keys",
                  (char *)(c->keys ? c->keys : to->s3_keys),
                  "--tls-authorities",
                  (char *)to->tls_authorities,
                  NULL};
  return config_read(from, (int)(sizeof argv / sizeof argv[0]) - 1, argv) == CONFIG_RUN;
}

static int is_folder(const char *path) {
  struct stat info;
  return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

/* Makes the folder of the target. */
static int are_two_folders(const char *from, const char *to) {
  struct stat a, b;
  if (!is_folder(from)) {
    return complain(from, "is not a data folder: name that of the service with --from-data");
  }
  if ((mkdir(to, 0700) != 0 && errno != EEXIST) || !is_folder(to)) {
    return complain(to, errno == EEXIST ? "is not a folder" : strerror(errno));
  }
  if (stat(from, &a) != 0 || stat(to, &b) != 0 || (a.st_dev == b.st_dev && a.st_ino == b.st_ino)) {
    return complain(to, "is also the data folder of the source: name a new one with --data");
  }
  return 1;
}

/* Lines of progress, at most one each few seconds. */
typedef struct progress {
  time_t told;
  int begun; /* a line about objects has been printed */
} progress;

static int is_time(progress *p) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  int due = now.tv_sec - p->told >= TELL_SECONDS;
  p->told = due ? now.tv_sec : p->told;
  return due;
}

static void tell_rows(void *user, int64_t rows) {
  if (is_time(user)) {
    printf("%lld rows copied so far\n", (long long)rows);
    fflush(stdout);
  }
}

static void print_objects(const object_counts *c, const char *end) {
  printf("%lld objects: %lld copied (%lld bytes), %lld were there%s\n", (long long)c->objects, (long long)c->sent,
         (long long)c->bytes, (long long)c->there, end);
  fflush(stdout);
}

static void tell_objects(void *user, const object_counts *c) {
  progress *p = user;
  if (!p->begun || is_time(p)) {
    print_objects(c, " so far");
    p->begun = 1;
  }
}

static void tell_wrong(void *user, const resource *row, const char *what, const char *why) {
  static const char *const names[RESOURCE_KINDS] = {"mesh", "embedding", "supermesh", "landmarks", "alignment"};
  (void)user;
  printf("%s %s: %s %s%s\n", names[row->kind], row->id, what, why,
         row->kind == RESOURCE_ALIGNMENT ? "; it is omitted, and the daemon computes it again" : "");
}

static int end(store_result result, const object_counts *c, const config *to) {
  switch (result) {
    case STORE_OK:
      print_objects(c, "");
      if (c->removed) {
        printf("%lld objects removed that the source has deleted meanwhile\n", (long long)c->removed);
      }
      puts("all is copied: start orbmorphd with the same --data, --catalogue and --objects");
      return 0;
    case STORE_CONFLICT:
      printf(
          "%lld objects of the source are damaged or missing: nothing starts on the target yet. Start orbmorphd on the "
          "source, DELETE what is named above or upload it again, stop it, and run migrate again: it goes on\n",
          (long long)c->wrong);
      return 1;
    case STORE_UNFIT:
      return CONFIG_UNFIT;
    case STORE_FULL:
      complain(to->data, "or the database of the target has no space left: make some, and run migrate again");
      return 1;
    default:
      complain("migrate", "has not ended: run it again, and it goes on");
      return 1;
  }
}

static int copy(const config *from, const config *to) {
  const store_place places[2] = {store_place_of(from), store_place_of(to)};
  progress told = {0};
  const move_listener listener = {tell_rows, tell_objects, tell_wrong, &told};
  object_counts counts = {0};
  move *m = NULL;
  store_result result = move_open(&places[0], &places[1], &m);
  if (result == STORE_OK) {
    puts(move_goes_on(m) ? "going on" : "copying");
    fflush(stdout);
    is_time(&told);
    result = move_run(m, &listener, &counts);
  }
  move_close(m);
  return end(result, &counts, to);
}

int migrate_run(const migrate_command *command, const config *to) {
  static config from; /* static because it is large */
  umask(077);
  if (!read_source(command, to, &from)) {
    return 2;
  }
  if (!are_two_folders(from.data, to->data)) {
    return CONFIG_UNFIT;
  }
  int source = folder_lock(from.data), target = source >= 0 ? folder_lock(to->data) : -1;
  int status = target >= 0 ? copy(&from, to) : 1;
  if (target >= 0) {
    close(target);
  }
  if (source >= 0) {
    close(source);
  }
  return status;
}
