#include "net/networks.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char special4[] =
    "0.0.0.0/8,"        /* this network */
    "10.0.0.0/8,"       /* private */
    "100.64.0.0/10,"    /* shared by carriers; a cloud's metadata */
    "127.0.0.0/8,"      /* loopback */
    "168.63.129.16/32," /* Azure's host */
    "169.254.0.0/16,"   /* link-local; clouds' metadata */
    "172.16.0.0/12,"    /* private */
    "192.0.0.0/24,"     /* protocol assignments; a cloud's metadata */
    "192.0.2.0/24,"     /* documentation */
    "192.88.99.0/24,"   /* 6to4 relays */
    "192.168.0.0/16,"   /* private */
    "198.18.0.0/15,"    /* benchmarks */
    "198.51.100.0/24,"  /* documentation */
    "203.0.113.0/24,"   /* documentation */
    "224.0.0.0/3";      /* multicast, reserved, broadcast */
static const char global6[] = "2000::/3";
static const char special6[] =
    "2001::/23,"     /* protocol assignments, Teredo */
    "2001:db8::/32," /* documentation */
    "2002::/16,"     /* 6to4 */
    "3fff::/20";     /* documentation */

/* The bytes of an address in network order; NULL for other families. */
static const unsigned char *bytes_of(const struct sockaddr *address) {
  if (address->sa_family == AF_INET) {
    return (const unsigned char *)&((const struct sockaddr_in *)(const void *)address)->sin_addr;
  }
  if (address->sa_family == AF_INET6) {
    return ((const struct sockaddr_in6 *)(const void *)address)->sin6_addr.s6_addr;
  }
  return NULL;
}

static int same_prefix(const unsigned char *a, const unsigned char *b, int bits) {
  int whole = bits / 8, rest = bits % 8;
  unsigned mask = (0xFF00u >> rest) & 0xFF;
  return memcmp(a, b, (size_t)whole) == 0 && (rest == 0 || ((a[whole] ^ b[whole]) & mask) == 0);
}

int networks_contain(const networks *set, const struct sockaddr *address) {
  const unsigned char *bytes = bytes_of(address);
  for (int i = 0; bytes && i < set->count; i++) {
    if (set->of[i].family == address->sa_family && same_prefix(set->of[i].address, bytes, set->of[i].bits)) {
      return 1;
    }
  }
  return 0;
}

static int read_one(const char *text, network *out) {
  char address[INET6_ADDRSTRLEN];
  const char *slash = strchr(text, '/');
  size_t length = slash ? (size_t)(slash - text) : strlen(text);
  if (length >= sizeof address) {
    return 0;
  }
  memcpy(address, text, length);
  address[length] = 0;
  memset(out, 0, sizeof *out);
  out->family = strchr(address, ':') ? AF_INET6 : AF_INET;
  int most = out->family == AF_INET6 ? 128 : 32;
  if (inet_pton(out->family, address, out->address) != 1) {
    return 0;
  }
  out->bits = most;
  if (slash) {
    size_t digits = strspn(slash + 1, "0123456789");
    out->bits = digits >= 1 && digits <= 3 && slash[1 + digits] == 0 ? atoi(slash + 1) : -1;
  }
  if (out->bits < 0 || out->bits > most) {
    return 0;
  }
  for (int bit = out->bits; bit < most; bit++) {
    if (out->address[bit / 8] & (0x80 >> bit % 8)) {
      return 0;
    }
  }
  return 1;
}

int networks_read(const char *list, networks *out, char wrong[NETWORKS_WRONG]) {
  out->count = 0;
  wrong[0] = 0;
  for (const char *at = list; *at;) {
    at += strspn(at, ", \t");
    size_t length = strcspn(at, ", \t");
    if (length == 0) {
      break;
    }
    snprintf(wrong, NETWORKS_WRONG, "%.*s", (int)(length < NETWORKS_WRONG ? length : NETWORKS_WRONG - 1), at);
    if (length >= NETWORKS_WRONG || out->count == NETWORKS_MOST || !read_one(wrong, &out->of[out->count])) {
      return 0;
    }
    out->count++;
    at += length;
  }
  wrong[0] = 0;
  return 1;
}

int address_is_public(const struct sockaddr *address) {
  networks special, global;
  char wrong[NETWORKS_WRONG];
  if (address->sa_family == AF_INET) {
    return networks_read(special4, &special, wrong) && !networks_contain(&special, address);
  }
  return address->sa_family == AF_INET6 && networks_read(special6, &special, wrong) &&
         networks_read(global6, &global, wrong) && networks_contain(&global, address) &&
         !networks_contain(&special, address);
}
