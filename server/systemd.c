#include "systemd.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "log.h"

void systemd_notify(const char *text) {
  const char *path = getenv("NOTIFY_SOCKET");
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  if (!path || !path[0] || strlen(path) >= sizeof address.sun_path) {
    return;
  }
  strcpy(address.sun_path, path);
  if (path[0] == '@') { /* an abstract socket */
    address.sun_path[0] = 0;
  }
  int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
  if (fd >= 0) {
    if (sendto(fd, text, strlen(text), MSG_NOSIGNAL, (struct sockaddr *)&address, size) < 0) {
      log_warn("systemd could not be notified: %s", strerror(errno));
    }
    close(fd);
  }
}

void systemd_reloading(void) {
  char text[80];
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  snprintf(text, sizeof text, "RELOADING=1\nMONOTONIC_USEC=%lld\n",
           (long long)now.tv_sec * 1000000 + now.tv_nsec / 1000);
  systemd_notify(text);
}

int64_t systemd_watchdog_ms(void) {
  const char *text = getenv("WATCHDOG_USEC"), *pid = getenv("WATCHDOG_PID");
  if (!text || (pid && atol(pid) != (long)getpid())) {
    return 0;
  }
  long long micros = strtoll(text, NULL, 10);
  return micros > 0 ? (micros / 2000 > 0 ? micros / 2000 : 1) : 0;
}
