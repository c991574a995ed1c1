#include "folder_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "log.h"

int folder_lock(const char *folder) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/lock", folder);
  int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) == 0) {
    return fd;
  }
  fprintf(stderr, "orbmorphd: %s %s\n", folder, fd < 0 ? strerror(errno) : "is in use by another process");
  if (fd >= 0) {
    close(fd);
  }
  return -1;
}

int folder_lock_data(const char *data) {
  char path[PATH_MAX];
  if (mkdir(data, 0700) != 0 && errno != EEXIST) {
    log_error("the folder %s cannot be created: %s", data,
              errno == ENOENT ? "the folder that it is to be in does not exist" : strerror(errno));
    return FOLDER_LOCK_TOLD;
  }
  snprintf(path, sizeof path, "%s/lock", data);
  int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) {
    log_error(errno == EROFS
                  ? "the data folder %s is on a read-only file system (%s): mount it for writing, or restore a "
                    "backup into a folder elsewhere"
                  : "the data folder %s cannot be written: %s",
              data, strerror(errno));
    return FOLDER_LOCK_TOLD;
  }
  for (int tries = 0; fd >= 0 && tries < 50; tries++) { /* a dying process may hold it a moment longer */
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) {
      return fd;
    }
    usleep(100000);
  }
  close(fd);
  return -1;
}

void folder_lock_say(const char *data, int lock) {
  if (lock != FOLDER_LOCK_TOLD) {
    log_error("the data folder %s is in use by another process or cannot be locked; stop that process first", data);
  }
}
