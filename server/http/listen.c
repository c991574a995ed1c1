#include "http/listen.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "log.h"

enum { PASSED_FD = 3 };

typedef union address {
  struct sockaddr any;
  struct sockaddr_in v4;
  struct sockaddr_in6 v6;
  struct sockaddr_un local;
  struct sockaddr_storage room;
} address;

/* Fills text and local from the bound address. host: as the configuration writes it; "": the numeric address. */
static int describe(listener *out, const char *host) {
  address at = {0};
  socklen_t size = sizeof at;
  if (getsockname(out->fd, &at.any, &size) != 0) {
    log_error("the socket has no address: %s", strerror(errno));
    return 0;
  }
  char numeric[INET6_ADDRSTRLEN] = "";
  switch (at.any.sa_family) {
    case AF_UNIX:
      out->local = 1;
      snprintf(out->text, sizeof out->text, "unix:%.107s", at.local.sun_path);
      return 1;
    case AF_INET:
      inet_ntop(AF_INET, &at.v4.sin_addr, numeric, sizeof numeric);
      out->local = ntohl(at.v4.sin_addr.s_addr) >> 24 == 127;
      snprintf(out->text, sizeof out->text, "%s:%u", host[0] ? host : numeric, (unsigned)ntohs(at.v4.sin_port));
      return 1;
    case AF_INET6:
      inet_ntop(AF_INET6, &at.v6.sin6_addr, numeric, sizeof numeric);
      out->local = IN6_IS_ADDR_LOOPBACK(&at.v6.sin6_addr);
      if (host[0]) {
        snprintf(out->text, sizeof out->text, "%s:%u", host, (unsigned)ntohs(at.v6.sin6_port));
      } else {
        snprintf(out->text, sizeof out->text, "[%s]:%u", numeric, (unsigned)ntohs(at.v6.sin6_port));
      }
      return 1;
    default:
      log_error("sockets of address family %d are not supported", at.any.sa_family);
      return 0;
  }
}

/* 1: systemd passed a socket, now in *out; 0: it passed none; −1: it passed one that cannot be used (logged). */
static int take_passed(listener *out) {
  const char *count = getenv("LISTEN_FDS"), *pid = getenv("LISTEN_PID");
  if (!count || !pid || atol(pid) != (long)getpid()) {
    return 0;
  }
  int wanted = atoi(count), listens = 0;
  socklen_t size = sizeof listens;
  unsetenv("LISTEN_FDS"); /* child processes must not inherit them */
  unsetenv("LISTEN_PID");
  unsetenv("LISTEN_FDNAMES");
  if (wanted != 1) {
    log_error("systemd passed %d sockets; orbmorphd serves exactly one", wanted);
    return -1;
  }
  if (getsockopt(PASSED_FD, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) != 0 || !listens) {
    log_error("the socket from systemd is not a listening stream socket: set Accept=no and ListenStream=");
    return -1;
  }
  fcntl(PASSED_FD, F_SETFD, FD_CLOEXEC);
  fcntl(PASSED_FD, F_SETFL, fcntl(PASSED_FD, F_GETFL) | O_NONBLOCK);
  out->fd = PASSED_FD;
  return describe(out, "") ? 1 : -1;
}

/* Removes a socket file on which no process listens. 0, with the reason logged, if the path is taken. */
static int clear_path(const struct sockaddr_un *at) {
  struct stat info;
  if (lstat(at->sun_path, &info) != 0) {
    return 1;
  }
  if (!S_ISSOCK(info.st_mode)) {
    log_error("%s exists and is not a socket", at->sun_path);
    return 0;
  }
  int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  int used = probe >= 0 && (connect(probe, (const struct sockaddr *)at, sizeof *at) == 0 || errno == EAGAIN);
  if (probe >= 0) {
    close(probe);
  }
  if (used) {
    log_error("another process listens on %s", at->sun_path);
    return 0;
  }
  return unlink(at->sun_path) == 0;
}

static int listen_unix(const char *path, mode_t mode, listener *out) {
  struct sockaddr_un at = {.sun_family = AF_UNIX};
  struct stat info;
  if (!*path || strlen(path) >= sizeof at.sun_path) {
    log_error("the path of a Unix socket must have 1 to %zu bytes", sizeof at.sun_path - 1);
    return 0;
  }
  strcpy(at.sun_path, path);
  if (!clear_path(&at)) {
    return 0;
  }
  out->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  /* No client can connect before listen(), so the mode applies from the first connection. */
  if (out->fd < 0 || bind(out->fd, (struct sockaddr *)&at, sizeof at) != 0 || chmod(path, mode) != 0 ||
      stat(path, &info) != 0 || listen(out->fd, SOMAXCONN) != 0) {
    log_error("cannot listen on %s: %s", path, strerror(errno));
    return 0;
  }
  strcpy(out->path, path);
  out->device = info.st_dev;
  out->inode = info.st_ino;
  return describe(out, "");
}

static int listen_internet(const char *where, listener *out) {
  char host[200];
  const char *colon = strrchr(where, ':');
  if (!colon || (size_t)(colon - where) >= sizeof host) {
    log_error("listen must be ADDR:PORT, [V6]:PORT or unix:PATH, not \"%s\"", where);
    return 0;
  }
  int bracket = where[0] == '[';
  snprintf(host, sizeof host, "%.*s", (int)(colon - where) - 2 * bracket, where + bracket);
  struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV}, *found = NULL;
  int code = getaddrinfo(host[0] ? host : NULL, colon + 1, &hints, &found);
  if (code != 0) {
    log_error("cannot listen on %s: %s", where, gai_strerror(code));
    return 0;
  }
  out->fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  setsockopt(out->fd, SOL_SOCKET, SO_REUSEADDR, &(int){1}, sizeof(int));
  int fine = out->fd >= 0 && bind(out->fd, found->ai_addr, found->ai_addrlen) == 0 && listen(out->fd, SOMAXCONN) == 0;
  if (!fine) {
    log_error("cannot listen on %s: %s%s", where, strerror(errno),
              errno == EADDRINUSE ? "; another program has this port, maybe another orbmorphd: stop it, or choose "
                                    "another port with --listen"
                                  : "");
  }
  freeaddrinfo(found);
  snprintf(host, sizeof host, "%.*s", (int)(colon - where), where);
  return fine && describe(out, host);
}

int listen_open(const config *options, const char *where, listener *out) {
  memset(out, 0, sizeof *out);
  out->fd = -1;
  int passed = take_passed(out);
  int fine = passed != 0 ? passed > 0
             : strncmp(where, "unix:", 5) == 0
                 ? listen_unix(where + 5, (mode_t)strtol(options->socket_mode, NULL, 8), out)
                 : listen_internet(where, out);
  if (!fine && out->fd >= 0) {
    close(out->fd);
    out->fd = -1;
  }
  return fine;
}

void listen_remove(listener *of) {
  struct stat info;
  if (of->path[0] && lstat(of->path, &info) == 0 && info.st_dev == of->device && info.st_ino == of->inode) {
    unlink(of->path);
  }
  of->path[0] = 0;
}
