#include "control.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "log.h"

enum { LINE_MOST = 1024, PATIENCE_S = 10 };
static const char name[] = "control";

/* The path of a data folder may be too long for a socket address, so the address goes through its descriptor. */
static int address_of(const char *data, struct sockaddr_un *out) {
  int folder = open(data, O_PATH | O_DIRECTORY | O_CLOEXEC);
  *out = (struct sockaddr_un){.sun_family = AF_UNIX};
  if (folder >= 0) {
    snprintf(out->sun_path, sizeof out->sun_path, "/proc/self/fd/%d/%s", folder, name);
  }
  return folder;
}

static int open_socket(void) {
  int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  struct timeval patience = {.tv_sec = PATIENCE_S};
  if (fd >= 0) {
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  }
  return fd;
}

int control_listen(const char *data) {
  struct sockaddr_un at;
  int folder = address_of(data, &at), fd = open_socket();
  if (folder >= 0) {
    unlinkat(folder, name, 0); /* left by a dead process: this process holds the lock */
  }
  int fine = folder >= 0 && fd >= 0 && bind(fd, (struct sockaddr *)&at, sizeof at) == 0 &&
             fchmodat(folder, name, 0600, 0) == 0 && listen(fd, 4) == 0 &&
             fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK) == 0;
  if (!fine) {
    log_warn("token commands cannot reach this daemon while it runs: %s", strerror(errno));
  }
  if (folder >= 0) {
    close(folder);
  }
  if (!fine && fd >= 0) {
    close(fd);
  }
  return fine ? fd : -1;
}

void control_close(const char *data, int fd) {
  int folder = fd >= 0 ? open(data, O_PATH | O_DIRECTORY | O_CLOEXEC) : -1;
  if (folder >= 0) {
    unlinkat(folder, name, 0);
    close(folder);
  }
  if (fd >= 0) {
    close(fd);
  }
}

/* Reads up to the end of the line or of the connection. */
static void read_line(int fd, char line[LINE_MOST]) {
  size_t size = 0;
  ssize_t n = 1;
  while (n > 0 && size < LINE_MOST - 1 && !memchr(line, '\n', size)) {
    n = read(fd, line + size, LINE_MOST - 1 - size);
    size += n > 0 ? (size_t)n : 0;
  }
  line[size] = 0;
  line[strcspn(line, "\n")] = 0;
}

static int write_all(int fd, const char *text, size_t size) {
  while (size) {
    ssize_t n = send(fd, text, size, MSG_NOSIGNAL);
    if (n <= 0) {
      return 0;
    }
    text += n;
    size -= (size_t)n;
  }
  return 1;
}

void control_serve(int fd, control_handler handle, void *user) {
  int peer = fd >= 0 ? accept4(fd, NULL, NULL, SOCK_CLOEXEC) : -1;
  struct timeval patience = {.tv_sec = 1};
  struct ucred who = {0};
  socklen_t size = sizeof who;
  char line[LINE_MOST], status;
  api_text reply = {0};
  if (peer < 0) {
    return;
  }
  setsockopt(peer, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  setsockopt(peer, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  if (getsockopt(peer, SOL_SOCKET, SO_PEERCRED, &who, &size) == 0 && (who.uid == geteuid() || who.uid == 0)) {
    read_line(peer, line);
    status = (char)('0' + handle(user, line, who.uid, &reply));
    if (write_all(peer, &status, 1) && !reply.failed && reply.size) {
      write_all(peer, reply.data, reply.size);
    }
  }
  api_text_free(&reply);
  close(peer);
}

int control_ask(const char *data, const char *line, api_text *reply) {
  struct sockaddr_un at;
  int folder = address_of(data, &at), fd = open_socket(), status = -1;
  char part[4096];
  if (folder >= 0 && fd >= 0 && connect(fd, (struct sockaddr *)&at, sizeof at) == 0 &&
      write_all(fd, line, strlen(line)) && write_all(fd, "\n", 1) && read(fd, part, 1) == 1) {
    status = part[0] - '0';
    for (ssize_t n; (n = read(fd, part, sizeof part)) > 0;) {
      api_text_append(reply, part, (size_t)n);
    }
  }
  if (fd >= 0) {
    close(fd);
  }
  if (folder >= 0) {
    close(folder);
  }
  return status;
}
