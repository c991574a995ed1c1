#include "http/addresses.h"

#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>

#include "hash.h"

enum { BUCKETS = 4096, KEY_BYTES = 8 };

struct address_entry {
  unsigned char key[KEY_BYTES];
  int64_t connections, filled; /* orb_clock_ms() */
  double level;                /* requests in the bucket */
  address_entry *next;
};

struct addresses {
  double rate; /* requests a millisecond */
  double room;
  address_entry *buckets[BUCKETS];
};

addresses *addresses_create(int64_t requests_per_second) {
  addresses *a = calloc(1, sizeof *a);
  if (a) {
    a->rate = 1e-3 * (double)requests_per_second;
    a->room = (double)(requests_per_second * ADDRESS_WINDOW);
  }
  return a;
}

void addresses_destroy(addresses *a) {
  for (int i = 0; a && i < BUCKETS; i++) {
    for (address_entry *e = a->buckets[i], *next; e; e = next) {
      next = e->next;
      free(e);
    }
  }
  free(a);
}

/* The IPv4 address, or the first 64 bits of the IPv6 address: a host with one address of a /64 has all of them. */
static void key_of(const struct sockaddr *address, unsigned char key[KEY_BYTES]) {
  memset(key, 0, KEY_BYTES);
  if (address->sa_family == AF_INET) {
    memcpy(key, &((const struct sockaddr_in *)(const void *)address)->sin_addr, 4);
  } else if (address->sa_family == AF_INET6) {
    const struct in6_addr *at = &((const struct sockaddr_in6 *)(const void *)address)->sin6_addr;
    int mapped = IN6_IS_ADDR_V4MAPPED(at);
    memcpy(key, at->s6_addr + (mapped ? 12 : 0), mapped ? 4 : KEY_BYTES);
  }
}

int address_is_local(const struct sockaddr *address) {
  unsigned char key[KEY_BYTES];
  if (address->sa_family == AF_INET6) {
    const struct in6_addr *at = &((const struct sockaddr_in6 *)(const void *)address)->sin6_addr;
    if (!IN6_IS_ADDR_V4MAPPED(at)) {
      return IN6_IS_ADDR_LOOPBACK(at);
    }
  }
  key_of(address, key);
  return address->sa_family == AF_UNIX || key[0] == 127;
}

uint64_t address_hash(const struct sockaddr *address) {
  unsigned char key[KEY_BYTES];
  key_of(address, key);
  return keyed_hash(key, KEY_BYTES);
}

static unsigned bucket_of(const unsigned char key[KEY_BYTES]) {
  return (unsigned)(keyed_hash(key, KEY_BYTES) % BUCKETS);
}

address_entry *addresses_enter(addresses *a, const struct sockaddr *address, int64_t now) {
  unsigned char key[KEY_BYTES];
  key_of(address, key);
  address_entry **at = &a->buckets[bucket_of(key)], *e = *at;
  while (e && memcmp(e->key, key, KEY_BYTES) != 0) {
    e = e->next;
  }
  if (!e) {
    e = calloc(1, sizeof *e);
    if (!e) {
      return NULL;
    }
    memcpy(e->key, key, KEY_BYTES);
    e->filled = now;
    e->level = a->room;
    e->next = *at;
    *at = e;
  }
  e->connections++;
  return e;
}

void addresses_leave(addresses *a, address_entry *e) {
  (void)a; /* addresses_sweep() frees the entry */
  e->connections--;
}

int64_t address_connections(const address_entry *e) {
  return e->connections;
}

static void fill(const addresses *a, address_entry *e, int64_t now) {
  double level = e->level + a->rate * (double)(now - e->filled);
  e->level = level < a->room ? level : a->room;
  e->filled = now;
}

int address_take(addresses *a, address_entry *e, int64_t now) {
  fill(a, e, now);
  if (e->level < 1) {
    return 0;
  }
  e->level -= 1;
  return 1;
}

void address_left(const addresses *a, const address_entry *e, int64_t *quota, int64_t *window, int64_t *left,
                  int64_t *reset) {
  *quota = (int64_t)a->room;
  *window = ADDRESS_WINDOW;
  *left = (int64_t)e->level;
  *reset = a->rate > 0 ? (int64_t)((a->room - e->level) / (1000 * a->rate)) + 1 : 0;
}

void addresses_sweep(addresses *a, int64_t now) {
  for (int i = 0; i < BUCKETS; i++) {
    for (address_entry **at = &a->buckets[i]; *at;) {
      address_entry *e = *at;
      fill(a, e, now);
      if (e->connections == 0 && e->level >= a->room) {
        *at = e->next;
        free(e);
      } else {
        at = &e->next;
      }
    }
  }
}
