#include "folder_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

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
