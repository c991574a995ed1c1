#include "store/object_files.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"

static const char *const folders[OBJECT_KINDS] = {"mesh",    "sphere",    "asset",   "places",
                                                  "spheres", "quantized", "meshopt", "alignment"};

const char *object_folder(object_kind kind) {
  return folders[kind];
}

store_result file_failed(const char *what, const char *path) {
  int code = errno;
  log_error("%s %s: %s", what, path, strerror(code));
  return code == ENOSPC || code == EDQUOT || code == EFBIG ? STORE_FULL : STORE_ERROR;
}

void object_file_path(const char *root, object_kind kind, const char *id, char out[PATH_MAX]) {
  snprintf(out, PATH_MAX, "%s/objects/%s/%.2s/%s", root, folders[kind], id, id);
}

static store_result sync_folder(const char *path) {
  int fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) {
    return file_failed("open", path);
  }
  int result = fsync(fd);
  store_result status = result == 0 ? STORE_OK : file_failed("fsync", path);
  close(fd);
  return status;
}

store_result file_make_folder(const char *path) {
  return mkdir(path, 0700) == 0 || errno == EEXIST ? STORE_OK : file_failed("mkdir", path);
}

/* A folder of objects is made with its first object. Making all 256 of each kind would take most of a first start. */
store_result object_file_make_folder(const char *root, object_kind kind, const char *id) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/objects/%s/%.2s", root, folders[kind], id);
  store_result status = file_make_folder(path);
  *strrchr(path, '/') = 0;
  return status == STORE_OK ? sync_folder(path)
                            : status; /* another thread may have made it without having synced it yet */
}

store_result object_files_make_top(const char *root) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/tmp", root);
  store_result status = file_make_folder(root);
  return status == STORE_OK ? file_make_folder(path) : status;
}

store_result object_files_make(const char *root) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/objects", root);
  store_result status = object_files_make_top(root);
  status = status == STORE_OK ? file_make_folder(path) : status;
  for (int kind = 0; kind < OBJECT_KINDS && status == STORE_OK; kind++) {
    snprintf(path, sizeof path, "%s/objects/%s", root, folders[kind]);
    status = file_make_folder(path);
  }
  snprintf(path, sizeof path, "%s/objects", root);
  status = status == STORE_OK ? sync_folder(path) : status;
  return status == STORE_OK ? sync_folder(root) : status;
}

void object_files_sweep(const char *root) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/tmp", root);
  DIR *dir = opendir(path);
  if (!dir) {
    return;
  }
  int swept = 0;
  for (struct dirent *entry; (entry = readdir(dir));) {
    if (entry->d_name[0] != '.') {
      swept += unlinkat(dirfd(dir), entry->d_name, 0) == 0;
    }
  }
  closedir(dir);
  if (swept) {
    log_info("deleted %d temporary files", swept);
  }
}

store_result object_file_publish(const char *root, object_kind kind, const char *id, int fd, const char *from) {
  char path[PATH_MAX];
  object_file_path(root, kind, id, path);
  FAULT_POINT("publish-written");
  if (fsync(fd) != 0) {
    store_result status = file_failed("fsync", from);
    unlink(from);
    return status;
  }
  FAULT_POINT("publish-synced");
  store_result status = STORE_OK;
  int renamed = rename(from, path) == 0;
  if (!renamed && errno == ENOENT && (status = object_file_make_folder(root, kind, id)) == STORE_OK) {
    FAULT_POINT("publish-folder");
    renamed = rename(from, path) == 0;
  }
  if (!renamed) {
    status = status == STORE_OK ? file_failed("rename to", path) : status;
    unlink(from);
    return status;
  }
  FAULT_POINT("publish-renamed");
  *strrchr(path, '/') = 0;
  store_result synced = sync_folder(path);
  FAULT_POINT("publish-done");
  return synced;
}

store_result object_file_read(const char *root, object_kind kind, const char *id, int *fd, uint64_t *size) {
  char path[PATH_MAX];
  struct stat info;
  object_file_path(root, kind, id, path);
  *fd = open(path, O_RDONLY | O_CLOEXEC);
  if (*fd < 0) {
    return errno == ENOENT ? STORE_NOT_FOUND : file_failed("open", path);
  }
  if (fstat(*fd, &info) != 0) {
    store_result status = file_failed("stat", path);
    close(*fd);
    return status;
  }
  *size = (uint64_t)info.st_size;
  return STORE_OK;
}

store_result object_file_look(const char *root, object_kind kind, const char *id) {
  char path[PATH_MAX];
  object_file_path(root, kind, id, path);
  return access(path, F_OK) == 0 ? STORE_OK : errno == ENOENT ? STORE_NOT_FOUND : file_failed("look at", path);
}

store_result object_file_delete(const char *root, object_kind kind, const char *id) {
  char path[PATH_MAX];
  object_file_path(root, kind, id, path);
  FAULT_POINT("before-unlink");
  return unlink(path) == 0 || errno == ENOENT ? STORE_OK : file_failed("unlink", path);
}

store_result object_file_quarantine(const char *root, object_kind kind, const char *id, int fd, const char *aside,
                                    int *moved) {
  char path[PATH_MAX];
  struct stat read, named;
  object_file_path(root, kind, id, path);
  if (stat(path, &named) != 0 || fstat(fd, &read) != 0) {
    return STORE_NOT_FOUND;
  }
  if (read.st_ino != named.st_ino) {
    return STORE_OK;
  }
  *moved = rename(path, aside) == 0;
  return *moved ? STORE_NOT_FOUND : file_failed("rename to", aside);
}

store_result object_file_set_aside(const char *root, object_kind kind, const char *id, const char *aside) {
  char path[PATH_MAX];
  object_file_path(root, kind, id, path);
  return rename(path, aside) == 0 ? STORE_OK : file_failed("rename to", aside);
}

long object_files_purge_lost(const char *root, int64_t before) {
  char path[PATH_MAX];
  long purged = 0;
  snprintf(path, sizeof path, "%s/lost+found", root);
  DIR *dir = opendir(path);
  for (struct dirent *entry; dir && (entry = readdir(dir));) {
    struct stat info;
    if (entry->d_name[0] != '.' && fstatat(dirfd(dir), entry->d_name, &info, AT_SYMLINK_NOFOLLOW) == 0 &&
        S_ISREG(info.st_mode) && info.st_mtime < before) {
      purged += unlinkat(dirfd(dir), entry->d_name, 0) == 0;
    }
  }
  if (dir) {
    closedir(dir);
  }
  return purged;
}

store_result object_files_each(const char *root,
                               void (*each)(void *user, object_kind kind, const char *id, uint64_t size), void *user) {
  store_result result = STORE_OK;
  for (int kind = 0; kind < OBJECT_KINDS; kind++) {
    for (int shard = 0; shard < 256; shard++) {
      char path[PATH_MAX];
      snprintf(path, sizeof path, "%s/objects/%s/%02x", root, folders[kind], (unsigned)shard);
      DIR *dir = opendir(path); /* it does not exist before its first object */
      for (struct dirent *entry; dir && (entry = readdir(dir));) {
        struct stat info;
        if (entry->d_name[0] != '.' && fstatat(dirfd(dir), entry->d_name, &info, 0) == 0) {
          each(user, (object_kind)kind, entry->d_name, (uint64_t)info.st_size);
        }
      }
      if (dir) {
        closedir(dir);
      } else if (errno != ENOENT) {
        result = file_failed("open", path);
      }
    }
  }
  return result;
}
