/* The socket that the daemon listens on: ADDR:PORT, a Unix socket, or one that systemd passes to it. */
#ifndef ORB_HTTP_LISTEN_H
#define ORB_HTTP_LISTEN_H

#include <sys/types.h>

#include "config.h"

typedef struct listener {
  int fd;         /* −1: none */
  int local;      /* only this machine reaches it: loopback, or a Unix socket */
  char text[300]; /* HOST:PORT with the actual port, or unix:PATH */
  char path[108]; /* of a Unix socket made here; listen_remove() unlinks it */
  dev_t device;   /* identity of that file, so that another process's socket is not unlinked */
  ino_t inode;
} listener;

/* Listens on ADDR:PORT or unix:PATH. 1, or 0 with the reason logged. A socket from systemd (LISTEN_FDS,
 * sd_listen_fds(3)) takes the place of the address. */
int listen_open(const config *options, const char *where, listener *out);
/* Unlinks a Unix socket. Does not close the descriptor: libmicrohttpd owns it. */
void listen_remove(listener *of);

#endif
