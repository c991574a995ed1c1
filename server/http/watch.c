#include "http/watch.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "http/addresses.h"
#include "orbmorph/context.h"
#include "wake.h"

/* CUT_OFF_MS: a body whose client has left is given up this long after its last byte; longer than the write of what
 * libmicrohttpd still holds of it takes. */
enum { CUT_OFF_MS = 1000, CUT_OFF_TICKS = 4 }; /* a look each second: ten thousand stalled uploads cost little */
enum { TICK_MS = 250, LINGER_TICK_MS = 20, LINGERERS = 256, LINGER_MS = 5000, LINGER_IDLE_MS = 1500 };
static const int64_t LINGER_BYTES = INT64_C(64) << 20;

typedef enum phase { PHASE_HEADERS, PHASE_NEXT_HEADERS, PHASE_RECEIVING, PHASE_WORKING, PHASE_ANSWERING } phase;

struct watched {
  watch *of;
  watched *previous, *next;
  int fd, lingers, doomed;
  address_entry *from; /* NULL: no limits */
  int over;            /* the address had too many connections when this one opened */
  int phase;           /* phase, since and received: __atomic, written by the thread that serves the connection */
  int64_t since, received;
  int64_t seen_received, seen_acked, looked; /* of the watching thread only, as are the next two */
  int64_t left_at, left_received;            /* the first look after the client left, and the bytes then; 0: none */
};

typedef struct lingerer {
  int fd;
  int64_t until, idle_until, bytes;
} lingerer;

struct watch {
  const config *options;
  int limits_local, limits;
  pthread_mutex_t lock;
  pthread_cond_t wake;
  pthread_t thread;
  int stopping;
  unsigned ticks;
  watched *first;
  addresses *from;
  lingerer lingerers[LINGERERS];
  int lingerer_count;
};

/* Bytes in the kernel that the peer has not acknowledged, and those it has. 0 if the kernel does not say. */
static int look_at(int fd, int64_t *waiting, int64_t *acked) {
  struct tcp_info info;
  socklen_t size = sizeof info;
  int queued = 0;
  memset(&info, 0, sizeof info);
  if (ioctl(fd, SIOCOUTQ, &queued) != 0 || getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) {
    return 0;
  }
  *waiting = queued;
  *acked = (int64_t)info.tcpi_bytes_acked;
  return 1;
}

/* Shuts the socket down; libmicrohttpd then notices and closes the connection. Linger time 0 discards unsent data, so
 * that the kernel keeps none. */
static void doom(watched *c) {
  struct linger at_once = {.l_onoff = 1, .l_linger = 0};
  setsockopt(c->fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  shutdown(c->fd, SHUT_RDWR);
  c->doomed = 1;
}

/* Has the client left in the middle of a body? libmicrohttpd misses that where it reads the last bytes after the client
 * has left: its edge-triggered epoll does not tell twice. */
static int is_cut_off(watched *c, int64_t now) {
  struct pollfd look = {.fd = c->fd, .events = POLLRDHUP};
  const int64_t received = __atomic_load_n(&c->received, __ATOMIC_RELAXED);
  int unread = 0;
  if (poll(&look, 1, 0) <= 0 || !(look.revents & (POLLRDHUP | POLLHUP)) || ioctl(c->fd, FIONREAD, &unread) != 0 ||
      unread > 0) {
    c->left_at = 0;
    return 0;
  }
  if (c->left_at == 0 || c->left_received != received) {
    c->left_at = now;
    c->left_received = received;
  }
  return now - c->left_at >= CUT_OFF_MS;
}

static void inspect(watch *w, watched *c, int64_t now) {
  const config *o = w->options;
  int at = __atomic_load_n(&c->phase, __ATOMIC_ACQUIRE);
  int64_t since = __atomic_load_n(&c->since, __ATOMIC_RELAXED), waiting = 0, acked = 0;
  int64_t window = 1000 * o->slow_seconds, least = o->min_rate * o->slow_seconds;
  if (at == PHASE_HEADERS || at == PHASE_NEXT_HEADERS) {
    if (now - since > 1000 * (o->header_seconds + (at == PHASE_NEXT_HEADERS ? o->idle_seconds : 0))) {
      doom(c);
    }
    return;
  }
  if (at == PHASE_RECEIVING && w->ticks % CUT_OFF_TICKS == 0 && is_cut_off(c, now)) {
    doom(c);
    return;
  }
  if (at == PHASE_WORKING || least == 0) {
    return;
  }
  if (c->looked < since) { /* the first look in this phase */
    c->looked = now;
    c->seen_received = __atomic_load_n(&c->received, __ATOMIC_RELAXED);
    c->seen_acked = at == PHASE_ANSWERING && look_at(c->fd, &waiting, &acked) && waiting > 0 ? acked : -1;
    return;
  }
  if (now - c->looked < window) {
    return;
  }
  c->looked = now;
  if (at == PHASE_RECEIVING) {
    int64_t received = __atomic_load_n(&c->received, __ATOMIC_RELAXED);
    if (received - c->seen_received < least) {
      doom(c);
    }
    c->seen_received = received;
  } else if (!look_at(c->fd, &waiting, &acked) || waiting == 0) {
    c->seen_acked = -1; /* the peer has acknowledged everything */
  } else if (c->seen_acked >= 0 && acked - c->seen_acked < least) {
    doom(c);
  } else {
    c->seen_acked = acked;
  }
}

/* Reads and discards what still arrives on lingering sockets. */
static void serve_lingerers(watch *w, int64_t now) {
  static char dropped[64 * 1024]; /* only the watching thread uses it */
  for (int i = 0; i < w->lingerer_count;) {
    lingerer *l = &w->lingerers[i];
    ssize_t n = 1;
    for (int64_t round = 0; n > 0 && round < LINGER_BYTES / 16; round += n) {
      n = recv(l->fd, dropped, sizeof dropped, MSG_DONTWAIT);
      if (n > 0) {
        l->bytes += n;
        l->idle_until = now + LINGER_IDLE_MS;
      }
    }
    int open = n > 0 || (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR));
    if (!open || w->stopping || now > l->until || now > l->idle_until || l->bytes > LINGER_BYTES) {
      close(l->fd);
      *l = w->lingerers[--w->lingerer_count];
    } else {
      i++;
    }
  }
}

static void *watch_main(void *argument) {
  watch *w = argument;
  int64_t inspected = 0;
  pthread_mutex_lock(&w->lock);
  while (!w->stopping) {
    wake_wait_ms(&w->wake, &w->lock, w->lingerer_count ? LINGER_TICK_MS : TICK_MS);
    int64_t now = orb_clock_ms();
    serve_lingerers(w, now);
    if (now - inspected >= TICK_MS) {
      inspected = now;
      w->ticks++;
      for (watched *c = w->first; c; c = c->next) {
        if (!c->doomed) {
          inspect(w, c, now);
        }
      }
      addresses_sweep(w->from, now);
    }
  }
  serve_lingerers(w, orb_clock_ms());
  pthread_mutex_unlock(&w->lock);
  return NULL;
}

watch *watch_start(const config *options, int tokens) {
  watch *w = calloc(1, sizeof *w);
  if (!w) {
    return NULL;
  }
  w->options = options;
  w->limits_local = strcmp(options->limits, "all") == 0;
  w->limits = w->limits_local || (strcmp(options->limits, "remote") == 0 && tokens);
  w->from = addresses_create(options->requests_per_second);
  pthread_mutex_init(&w->lock, NULL);
  wake_init(&w->wake);
  if (!w->from || pthread_create(&w->thread, NULL, watch_main, w) != 0) {
    addresses_destroy(w->from);
    free(w);
    return NULL;
  }
  return w;
}

void watch_stop(watch *w) {
  if (!w) {
    return;
  }
  pthread_mutex_lock(&w->lock);
  w->stopping = 1;
  pthread_cond_signal(&w->wake);
  pthread_mutex_unlock(&w->lock);
  pthread_join(w->thread, NULL);
  addresses_destroy(w->from);
  free(w);
}

watched *watch_open(watch *w, int fd, const struct sockaddr *address) {
  watched *c = calloc(1, sizeof *c);
  if (!c) {
    return NULL;
  }
  c->of = w;
  c->fd = fd;
  c->since = orb_clock_ms();
  pthread_mutex_lock(&w->lock);
  c->next = w->first;
  if (c->next) {
    c->next->previous = c;
  }
  w->first = c;
  if (w->limits && address && (w->limits_local || !address_is_local(address))) {
    c->from = addresses_enter(w->from, address, c->since);
    c->over = c->from && w->options->connections_per_address > 0 &&
              address_connections(c->from) > w->options->connections_per_address;
  }
  pthread_mutex_unlock(&w->lock);
  return c;
}

static void start_lingering(watch *w, const watched *c) {
  int fd = w->lingerer_count < LINGERERS ? fcntl(c->fd, F_DUPFD_CLOEXEC, 0) : -1;
  if (fd < 0) {
    return;
  }
  int64_t now = orb_clock_ms();
  shutdown(fd, SHUT_WR);
  w->lingerers[w->lingerer_count++] = (lingerer){fd, now + LINGER_MS, now + LINGER_IDLE_MS, 0};
  pthread_cond_signal(&w->wake);
}

void watch_close(watch *w, watched *c) {
  if (!c) {
    return;
  }
  pthread_mutex_lock(&w->lock);
  *(c->previous ? &c->previous->next : &w->first) = c->next;
  if (c->next) {
    c->next->previous = c->previous;
  }
  if (c->lingers && !c->doomed) {
    start_lingering(w, c);
  }
  if (c->from) {
    addresses_leave(w->from, c->from);
  }
  pthread_mutex_unlock(&w->lock);
  free(c);
}

static void enter(watched *c, phase next) {
  if (c) {
    __atomic_store_n(&c->since, orb_clock_ms(), __ATOMIC_RELAXED);
    __atomic_store_n(&c->phase, (int)next, __ATOMIC_RELEASE);
  }
}

void watched_headers(watched *c) {
  enter(c, PHASE_RECEIVING);
}
void watched_work(watched *c) {
  enter(c, PHASE_WORKING);
}
void watched_answer(watched *c) {
  enter(c, PHASE_ANSWERING);
}
void watched_done(watched *c) {
  enter(c, PHASE_NEXT_HEADERS);
}
void watched_body(watched *c, int64_t bytes) {
  if (c) {
    __atomic_fetch_add(&c->received, bytes, __ATOMIC_RELAXED);
  }
}
void watched_linger(watched *c) {
  if (c) {
    c->lingers = 1; /* read by the same thread, in watch_close() */
  }
}

void watched_take_request(watched *c, allowance *out) {
  memset(out, 0, sizeof *out);
  if (!c || !c->from) {
    return;
  }
  pthread_mutex_lock(&c->of->lock);
  out->limited = c->of->options->requests_per_second > 0;
  out->refused = c->over ? 2 : out->limited && !address_take(c->of->from, c->from, orb_clock_ms());
  address_left(c->of->from, c->from, &out->quota, &out->window, &out->left, &out->reset);
  pthread_mutex_unlock(&c->of->lock);
}
