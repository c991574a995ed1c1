/* The socket that the daemon listens on: ADDR:PORT, a Unix socket, or one that systemd holds and passes on. */
#ifndef ORB_HTTP_LISTEN_H
#define ORB_HTTP_LISTEN_H

#include <sys/types.h>

#include "config.h"

typedef struct listener {
  int fd;         /* −1: none */
  int local;      /* only this machine reaches it: loopback, or a Unix socket */
  char text[300]; /* HOST:PORT with the port that was got, or unix:PATH */
  char path[108]; /* of a Unix socket that was made here; to be removed */
  dev_t device;   /* and what it was then, so that no other's is removed */
  ino_t inode;
} listener;

/* 1, or 0 with the reason logged. Sockets of systemd (LISTEN_FDS, sd_listen_fds(3)) go before `listen`. */
int listen_open(const config *options, listener *out);
/* Removes the path of a Unix socket; the descriptor is closed by who has it. */
void listen_remove(listener *of);

#endif
