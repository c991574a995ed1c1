#include "backup.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "folder_lock.h"
#include "log.h"
#include "store/object_removal.h"
#include "store/place.h"
#include "store/snapshot.h"
#include "store/transfer.h"

/* Brings the objects of a catalogue from one folder to another. */
typedef struct haul {
  objects *from, *to;
  const char *place; /* what `to` is */
  int64_t reserve;   /* bytes that stay free there */
  snapshot *rows;
  long objects, made, wrong, deleted;
  const char *stopped; /* why nothing more can be written; NULL: it can */
} haul;

static const char no_space[] =
    "would have less space left than disk-reserve asks for, or twice as much on the disk of the data folder: free "
    "some, or lower --disk-reserve, and run this again; to use another disk, delete this folder";

static int complain(const char *folder, const char *why) {
  fprintf(stderr, "orbmorphd: %s %s\n", folder, why);
  return 0;
}

static int is_among(const char *name, const char *const *names) {
  while (*names && strcmp(name, *names) != 0) {
    names++;
  }
  return *names != NULL;
}

/* Whether all entries of the folder are among these names; creates the folder. −1 with the reason printed: it cannot be
 * used. */
static int has_only(const char *folder, const char *const *names) {
  int only = 1;
  DIR *dir = mkdir(folder, 0700) == 0 || errno == EEXIST ? opendir(folder) : NULL;
  if (!dir) {
    complain(folder, strerror(errno));
    return -1;
  }
  for (struct dirent *entry; (entry = readdir(dir));) {
    only &= strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0 || is_among(entry->d_name, names);
  }
  closedir(dir);
  return only;
}

/* But for a lock. */
static int is_empty(const char *folder) {
  return has_only(folder, (const char *const[]){"lock", NULL});
}

/* Makes the file unless it exists, and writes the text at its beginning. Its name is on the disk when this returns. */
static int put_file(const char *folder, const char *name, const char *text) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  size_t size = strlen(text);
  int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600), in = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  int fine = fd >= 0 && write(fd, text, size) == (ssize_t)size && fsync(fd) == 0 && in >= 0 && fsync(in) == 0;
  fine = fine || complain(path, strerror(errno));
  if (fd >= 0) {
    close(fd);
  }
  if (in >= 0) {
    close(in);
  }
  return fine;
}

/* Gives the new catalogue its name, after all that it names is on the disk. */
static int commit(const char *folder) {
  char from[PATH_MAX], to[PATH_MAX];
  snprintf(from, sizeof from, "%s/%s", folder, place_new_catalogue);
  snprintf(to, sizeof to, "%s/catalogue.sqlite", folder);
  int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  int fine = fd >= 0 && syncfs(fd) == 0 && rename(from, to) == 0 && fsync(fd) == 0;
  if (fd >= 0) {
    close(fd);
  }
  return fine || complain(to, strerror(errno));
}

static void bring_row(void *user, const resource *row) {
  static const char *const names[RESOURCE_KINDS] = {"mesh", "embedding", "supermesh", "landmarks", "alignment"};
  haul *h = user;
  named_object named[RESOURCE_OBJECTS];
  int count = resource_objects(row, named);
  for (int i = 0; i < count && !h->stopped; i++) {
    transfer_deed deed;
    store_result result = transfer_object(h->from, h->to, row->id, &named[i], h->reserve, &deed);
    h->objects++;
    h->made += deed != TRANSFER_NONE;
    h->stopped = result == STORE_FULL ? no_space : result == STORE_ERROR ? "cannot be written" : NULL;
    if (deed == TRANSFER_MENDED) {
      printf("%s %s: %s in the %s was damaged and is copied again\n", names[row->kind], row->id, named[i].what,
             h->place);
    }
    if (result != STORE_OK && !h->stopped) {
      h->wrong++;
      printf("%s %s: %s %s\n", names[row->kind], row->id, named[i].what,
             result == STORE_NOT_FOUND ? "is missing" : "does not match its hash");
    }
  }
}

/* Opens the rows of folder/catalogue.new and brings their objects. */
static int bring_objects(haul *h, const char *folder) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/%s", folder, place_new_catalogue);
  if (snapshot_open(path, &h->rows) != STORE_OK || snapshot_each(h->rows, bring_row, h) != STORE_OK) {
    return complain(path, "cannot be read");
  }
  return !h->stopped || complain(folder, h->stopped);
}

static void sweep_one(void *user, object_kind kind, const char *id, uint64_t size) {
  haul *h = user;
  (void)size;
  if (!snapshot_names(h->rows, kind, id)) {
    h->deleted += objects_delete(h->to, kind, id) == STORE_OK;
  }
}

static void end(haul *h) {
  snapshot_close(h->rows);
  objects_close(h->from);
  objects_close(h->to);
}

/* The lock that keeps a daemon from deleting objects; waits for the deletion in progress. */
static int hold_deletions(const char *data) {
  int fd = objects_backup_lock(data);
  if (fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) != 0) {
    puts("waiting for a deletion or another backup to end");
    fflush(stdout);
  }
  while (fd >= 0 && flock(fd, LOCK_EX) != 0 && errno == EINTR) {
  }
  return fd;
}

/* The space that a file takes; 0: there is none. */
static uint64_t space_of(const char *folder, const char *name) {
  char path[PATH_MAX];
  struct stat info;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return stat(path, &info) == 0 ? (uint64_t)info.st_blocks * 512 : 0;
}

/* Bytes that stay free where objects go. Uploads need the reserve and their own bytes: so a backup that shares their
 * disk leaves twice the reserve. */
static int64_t reserve_of(const char *folder, const config *options) {
  struct stat a, b;
  const int shared = stat(folder, &a) == 0 && stat(options->data, &b) == 0 && a.st_dev == b.st_dev;
  return options->disk_reserve * (shared ? 2 : 1);
}

/* Copies the catalogue of `data` to folder/catalogue.new, if it leaves the reserve free. What an earlier run has left
 * there is replaced. */
static int take_catalogue(const haul *h, const char *folder, const char *data) {
  char to[PATH_MAX];
  const uint64_t space = space_of(data, "catalogue.sqlite") + space_of(data, "catalogue.sqlite-wal");
  snprintf(to, sizeof to, "%s/%s", folder, place_new_catalogue);
  if ((uint64_t)h->reserve + space > objects_free_bytes(h->to) + space_of(folder, place_new_catalogue)) {
    return complain(folder, no_space);
  }
  store_result result = snapshot_take(data, to);
  return result == STORE_FULL ? complain(folder, no_space) : result == STORE_OK;
}

static int take(const char *folder, const config *options) {
  const char *data = options->data;
  haul h = {.place = "backup", .reserve = reserve_of(folder, options)};
  int fine = objects_open(folder, &h.to) == STORE_OK && take_catalogue(&h, folder, data) &&
             objects_open_read_only(data, &h.from) == STORE_OK && bring_objects(&h, folder) && commit(folder) &&
             objects_each(h.to, sweep_one, &h) == STORE_OK;
  if (fine) {
    printf("%ld objects in the backup: %ld new, %ld deleted that the last backup had, %ld damaged or missing\n",
           h.objects - h.wrong, h.made, h.deleted, h.wrong);
  }
  if (fine && h.wrong) {
    puts(
        "upload or request again what is named above, then repeat the backup; copies from an earlier backup in this "
        "folder stay");
  }
  end(&h);
  return !fine || h.wrong;
}

static int refuse_url(void) {
  fputs(
      "orbmorphd: backup and restore are for a catalogue in SQLite. Copy one in PostgreSQL with pg_dump, and then the "
      "folder objects of the data folder\n",
      stderr);
  return 2;
}

/* Objects in a bucket: its versions are their backup. */
static int refuse_bucket(void) {
  fputs(
      "orbmorphd: backup and restore are for objects in files. Keep versions in the bucket, and copy the catalogue "
      "with "
      "sqlite3 DATA/catalogue.sqlite '.backup FILE'; see docs/cluster.md\n",
      stderr);
  return 2;
}

static int is_in_bucket(const config *options) {
  return strcmp(options->objects, "files") != 0 || place_has(options->data, "objects.s3");
}

static int run_backup(const char *folder, const config *options) {
  umask(077);
  if (is_in_bucket(options)) {
    return refuse_bucket();
  }
  if (config_catalogue(options)) {
    return refuse_url();
  }
  if (!place_has_catalogue(options->data)) {
    complain(options->data, "is not a data folder: name that of the service with --data");
    return 1;
  }
  int empty = is_empty(folder);
  if (empty == 0 && !place_has(folder, place_backup_mark)) {
    complain(folder, "is neither empty nor a backup");
    return 1;
  }
  if (empty < 0) {
    return 1;
  }
  int lock = folder_lock(folder);
  int held = lock >= 0 && put_file(folder, place_backup_mark, "orbmorph backup, format 1\n")
                 ? hold_deletions(options->data)
                 : -1;
  int status = held >= 0 ? take(folder, options) : 1;
  if (held >= 0) {
    close(held);
  }
  if (lock >= 0) {
    close(lock);
  }
  return status;
}

/* Keeps backups out of the folder until the process ends. A folder that cannot be written needs no lock. */
static int hold_backup(const char *folder) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/lock", folder);
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  return fd < 0 || flock(fd, LOCK_SH | LOCK_NB) == 0 || complain(folder, "is in use by a backup: repeat later");
}

/* Whether a restore may fill the folder: it is empty, or a restore into it was killed and nothing else has used it. 0
 * with the reason printed. */
static int can_fill(const char *data) {
  static const char wal[] = "catalogue.new-wal", shm[] = "catalogue.new-shm", journal[] = "catalogue.new-journal";
  static const char *const made[] = {"lock", "backup.lock", "objects", "tmp", place_new_catalogue,
                                     wal,    shm,           journal,   NULL};
  const int fills = place_has(data, place_new_catalogue) ? has_only(data, made) : is_empty(data);
  return fills ? fills > 0 : complain(data, "is not empty: restore into a new folder");
}

/* The new catalogue, still without rows, is the first thing in the folder but for the lock, and no daemon starts on it
 * from then on. The lock comes before: a folder in use by a daemon with another catalogue stays as it is. Returns the
 * lock, or −1 with the reason printed. */
static int begin_filling(const char *data) {
  int lock = can_fill(data) ? folder_lock(data) : -1;
  if (lock >= 0 &&
      !(can_fill(data) /* no other restore has ended meanwhile */ && put_file(data, place_new_catalogue, ""))) {
    close(lock);
    lock = -1;
  }
  return lock;
}

/* What a restore that was killed has brought stays, unless this backup does not name it. */
static int put_back(const char *folder, const config *options) {
  const char *data = options->data;
  char path[PATH_MAX];
  haul h = {.place = "new folder", .reserve = options->disk_reserve};
  snprintf(path, sizeof path, "%s/%s", data, place_new_catalogue);
  int fine = objects_open(data, &h.to) == STORE_OK && take_catalogue(&h, data, folder) &&
             snapshot_requeue(path) == STORE_OK && objects_open_read_only(folder, &h.from) == STORE_OK &&
             bring_objects(&h, data) && objects_each(h.to, sweep_one, &h) == STORE_OK && commit(data);
  if (fine) {
    printf("%ld objects restored, %ld damaged or missing\n", h.objects - h.wrong, h.wrong);
  } else {
    complain(data, "is not complete: run the restore again");
  }
  if (fine && h.wrong) {
    puts("all else is restored: start the daemon, DELETE what is named above, and upload or request it again");
  }
  end(&h);
  return !fine || h.wrong;
}

static int run_restore(const char *folder, const config *options) {
  umask(077);
  if (is_in_bucket(options)) {
    return refuse_bucket();
  }
  if (config_catalogue(options)) {
    return refuse_url();
  }
  if (!place_has(folder, place_backup_mark) || !place_has_catalogue(folder)) {
    complain(folder, "is not a complete backup");
    return 1;
  }
  int lock = hold_backup(folder) ? begin_filling(options->data) : -1;
  int status = lock >= 0 ? put_back(folder, options) : 1;
  if (lock >= 0) {
    close(lock);
  }
  return status;
}

int backup_command_read(backup_command *out, int *argc, char **argv) {
  out->run = *argc < 2                         ? NULL
             : strcmp(argv[1], "backup") == 0  ? run_backup
             : strcmp(argv[1], "restore") == 0 ? run_restore
                                               : NULL;
  if (!out->run) {
    return 1;
  }
  if (*argc < 3 || argv[2][0] == '-') {
    fprintf(stderr,
            "orbmorphd %s: the folder is missing\n"
            "  orbmorphd backup DIR [--data DATA]\n"
            "  orbmorphd restore DIR --data NEW\n",
            argv[1]);
    return 0;
  }
  out->folder = argv[2];
  memmove(argv + 1, argv + 3, (size_t)(*argc - 2) * sizeof *argv); /* with the NULL at the end */
  *argc -= 2;
  return 1;
}
