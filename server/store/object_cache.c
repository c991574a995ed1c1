#include "store/object_cache.h"

#include <dirent.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "log.h"

enum { KEPT_PERCENT = 90 }; /* after deleting, so that not every new file walks the folder */

struct object_cache {
  pthread_mutex_t evicting;
  uint64_t most,
      bytes; /* an upper bound in bytes: the next walk finds out which files others have replaced or deleted */
  char folder[PATH_MAX];
};

typedef struct cached_file {
  struct timespec used;
  uint64_t bytes;
  char name[100]; /* within the folder */
} cached_file;

typedef struct file_list {
  cached_file *files;
  size_t count, room;
  uint64_t bytes;
} file_list;

static void add(file_list *list, const char *name, const struct stat *info) {
  if (list->count == list->room) {
    size_t room = list->room ? 2 * list->room : 256;
    cached_file *more = realloc(list->files, room * sizeof *more);
    if (!more) {
      return;
    }
    list->files = more;
    list->room = room;
  }
  cached_file *one = &list->files[list->count];
  if (snprintf(one->name, sizeof one->name, "%s", name) < (int)sizeof one->name) {
    one->used = info->st_atim;
    one->bytes = (uint64_t)info->st_size;
    list->bytes += one->bytes;
    list->count++;
  }
}

/* Lists the files two folders below. */
static void walk(int top, const char *within, int depth, file_list *list) {
  int fd = openat(top, *within ? within : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  DIR *dir = fd >= 0 ? fdopendir(fd) : NULL;
  for (struct dirent *entry; dir && (entry = readdir(dir));) {
    char name[100];
    struct stat info;
    if (entry->d_name[0] == '.' ||
        snprintf(name, sizeof name, "%s%s%.90s", within, *within ? "/" : "", entry->d_name) >= (int)sizeof name ||
        fstatat(top, name, &info, AT_SYMLINK_NOFOLLOW) != 0) {
      continue;
    }
    if (S_ISDIR(info.st_mode) && depth < 2) {
      walk(top, name, depth + 1, list);
    } else if (S_ISREG(info.st_mode)) {
      add(list, name, &info);
    }
  }
  if (dir) {
    closedir(dir);
  }
}

static int by_use(const void *a, const void *b) {
  const cached_file *first = a, *second = b;
  return first->used.tv_sec != second->used.tv_sec    ? (first->used.tv_sec < second->used.tv_sec ? -1 : 1)
         : first->used.tv_nsec < second->used.tv_nsec ? -1
                                                      : first->used.tv_nsec > second->used.tv_nsec;
}

static void evict(object_cache *cache) {
  file_list list = {0};
  int top = open(cache->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (top < 0) {
    return;
  }
  __atomic_store_n(&cache->bytes, 0, __ATOMIC_RELAXED); /* a file that is added during the walk may count twice */
  walk(top, "", 0, &list);
  uint64_t left = list.bytes, deleted = 0;
  if (left > cache->most) {
    qsort(list.files, list.count, sizeof *list.files, by_use);
    for (size_t i = 0; i < list.count && left > cache->most / 100 * KEPT_PERCENT; i++) {
      if (unlinkat(top, list.files[i].name, 0) == 0) {
        left -= list.files[i].bytes;
        deleted++;
      }
    }
    log_write(LOG_DEBUG, NULL, "deleted %llu files from the cache of objects", (unsigned long long)deleted);
  }
  __atomic_fetch_add(&cache->bytes, left, __ATOMIC_RELAXED);
  free(list.files);
  close(top);
}

object_cache *object_cache_open(const char *folder, uint64_t most) {
  object_cache *cache = calloc(1, sizeof *cache);
  if (cache) {
    pthread_mutex_init(&cache->evicting, NULL);
    cache->most = most;
    snprintf(cache->folder, sizeof cache->folder, "%s", folder);
    evict(cache);
  }
  return cache;
}

void object_cache_close(object_cache *cache) {
  if (cache) {
    pthread_mutex_destroy(&cache->evicting);
    free(cache);
  }
}

void object_cache_used(int fd) {
  const struct timespec times[2] = {{.tv_nsec = UTIME_NOW}, {.tv_nsec = UTIME_OMIT}};
  futimens(fd, times); /* the file system may be mounted so that reading does not set the time */
}

void object_cache_grew(object_cache *cache, uint64_t bytes) {
  if (__atomic_add_fetch(&cache->bytes, bytes, __ATOMIC_RELAXED) > cache->most &&
      pthread_mutex_trylock(&cache->evicting) == 0) {
    evict(cache);
    pthread_mutex_unlock(&cache->evicting);
  }
}
