#include "http/regions.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include "http/twin.h"

/* Below the least size a copy takes less time than the second system call. */
enum { LEAST = 32 << 10, REGIONS_MOST = 256, SLOTS = 2 * REGIONS_MOST };

typedef struct region {
  void *bytes; /* NULL: empty */
  size_t size;
  int fd;
} region;

static struct {
  pthread_mutex_t lock;
  char folder[PATH_MAX]; /* of their files; empty: they lie in memory */
  int count;
  region all[SLOTS]; /* by address, with linear probing */
} regions = {.lock = PTHREAD_MUTEX_INITIALIZER};

static size_t slot_of(const void *bytes) {
  return ((uintptr_t)bytes >> 12) * UINT64_C(0x9E3779B97F4A7C15) >> 32;
}

/* The slot of the region, or the empty one where it would be. There are always empty slots. */
static region *find_locked(const void *bytes) {
  size_t i = slot_of(bytes);
  while (regions.all[i % SLOTS].bytes && regions.all[i % SLOTS].bytes != bytes) {
    i++;
  }
  return &regions.all[i % SLOTS];
}

/* Reserves the place of one more region. */
static int reserve(void) {
  pthread_mutex_lock(&regions.lock);
  int room = regions.count < REGIONS_MOST;
  regions.count += room;
  pthread_mutex_unlock(&regions.lock);
  return room;
}

static void unreserve(void) {
  pthread_mutex_lock(&regions.lock);
  regions.count--;
  pthread_mutex_unlock(&regions.lock);
}

void regions_in(const char *folder) {
  snprintf(regions.folder, sizeof regions.folder, "%s", folder);
}

static int fill(int fd, const char *bytes, size_t size) {
  for (ssize_t n = 1; size > 0 && n > 0; bytes += n > 0 ? n : 0, size -= n > 0 ? (size_t)n : 0) {
    n = write(fd, bytes, size);
  }
  return size == 0;
}

/* A file without a name that holds the bytes. A disk that is full, or takes no such files, leaves memory. */
static int file_with(const void *bytes, size_t size) {
  int fd = regions.folder[0] ? open(regions.folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600) : -1;
  if (fd >= 0 && fill(fd, bytes, size)) {
    return fd;
  }
  if (fd >= 0) {
    close(fd);
  }
  fd = memfd_create("answer", MFD_CLOEXEC);
  if (fd >= 0 && !fill(fd, bytes, size)) {
    close(fd);
    fd = -1;
  }
  return fd;
}

void *region_make(const void *bytes, size_t size) {
  if (size < LEAST || !reserve()) {
    return NULL;
  }
  int fd = file_with(bytes, size);
  void *copy = fd >= 0 ? mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) : MAP_FAILED;
  if (copy == MAP_FAILED) {
    if (fd >= 0) {
      close(fd);
    }
    unreserve();
    return NULL;
  }
  memcpy(copy, bytes, size);
  mprotect(copy, size, PROT_READ);
  pthread_mutex_lock(&regions.lock);
  *find_locked(copy) = (region){copy, size, fd};
  pthread_mutex_unlock(&regions.lock);
  return copy;
}

/* Removes a region, and closes the gap that it leaves in its run of slots. */
static void remove_locked(region *at) {
  size_t i = (size_t)(at - regions.all);
  *at = (region){0};
  for (i = (i + 1) % SLOTS; regions.all[i].bytes; i = (i + 1) % SLOTS) {
    region moved = regions.all[i];
    regions.all[i] = (region){0};
    *find_locked(moved.bytes) = moved;
  }
}

int region_free(void *bytes) {
  pthread_mutex_lock(&regions.lock);
  region *at = find_locked(bytes), found = *at;
  if (found.bytes) {
    remove_locked(at);
  }
  pthread_mutex_unlock(&regions.lock);
  if (!found.bytes) {
    return 0;
  }
  munmap(found.bytes, found.size);
  close(found.fd);
  unreserve();
  return 1;
}

/* The file of the region that `part` begins and lies in; −1: there is none. The sender of a region keeps it alive. */
static int file_of(const struct iovec *part) {
  int fd = -1;
  if (part->iov_len >= LEAST) {
    pthread_mutex_lock(&regions.lock);
    const region *at = find_locked(part->iov_base);
    fd = at->bytes && part->iov_len <= at->size ? at->fd : -1;
    pthread_mutex_unlock(&regions.lock);
  }
  return fd;
}

typedef ssize_t sender(int, const struct msghdr *, int);
static sender *next_sendmsg;

static void find_next(void) {
  void *found = dlsym(RTLD_NEXT, "sendmsg");
  memcpy(&next_sendmsg, &found, sizeof found);
}

/* In place of libc's. If the socket takes no more than a part, libmicrohttpd sends the rest with send(), by copying. */
ssize_t sendmsg(int to, const struct msghdr *message, int flags) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  const struct iovec *parts = message->msg_iov;
  int plain = message->msg_iovlen == 2 && !message->msg_name && message->msg_controllen == 0;
  int fd = plain ? file_of(&parts[1]) : -1;
  if (fd < 0) {
    size_t skipped = plain ? twin_head(parts[0].iov_base, parts[0].iov_len) : 0;
    struct iovec rest[2] = {{0}};
    struct msghdr once_only = *message;
    if (skipped) {
      rest[0] = (struct iovec){(char *)parts[0].iov_base + skipped, parts[0].iov_len - skipped};
      rest[1] = parts[1];
      once_only.msg_iov = rest;
    }
    pthread_once(&once, find_next);
    ssize_t sent = next_sendmsg(to, &once_only, flags);
    return sent > 0 ? sent + (ssize_t)skipped : sent; /* what it skips counts as sent */
  }
  ssize_t head = send(to, parts[0].iov_base, parts[0].iov_len, flags | MSG_MORE);
  if (head < 0 || (size_t)head < parts[0].iov_len) {
    return head;
  }
  off_t from = 0;
  ssize_t body = sendfile(to, fd, &from, parts[1].iov_len);
  return body > 0 ? head + body : head; /* if the file cannot be read, the copy in memory is sent */
}
