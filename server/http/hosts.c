#include "http/hosts.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { HOST_MOST = 256 };

/* Splits an authority. host loses the brackets of IPv6. *port points at the digits, or is NULL. 0 if malformed. */
static int split(const char *authority, size_t length, char host[HOST_MOST], const char **port) {
  const char *end = authority + length, *colon = memchr(authority, ':', length);
  int bracket = length > 0 && authority[0] == '[';
  *port = NULL;
  if (bracket) {
    const char *close = memchr(authority, ']', length);
    if (!close || (close + 1 < end && close[1] != ':')) {
      return 0;
    }
    colon = close + 1 < end ? close + 1 : NULL;
  }
  size_t size = (size_t)((colon ? colon : end) - authority) - 2 * (size_t)bracket;
  if (size == 0 || size >= HOST_MOST) {
    return 0;
  }
  memcpy(host, authority + bracket, size);
  host[size] = 0;
  if (colon) {
    *port = colon + 1;
    return colon + 1 < end && strspn(colon + 1, "0123456789") >= (size_t)(end - colon - 1);
  }
  return 1;
}

int host_is_loopback(const char *authority) {
  char host[HOST_MOST];
  const char *port;
  struct in_addr v4;
  struct in6_addr v6;
  if (!split(authority, strlen(authority), host, &port)) {
    return 0;
  }
  if (authority[0] == '[') {
    return inet_pton(AF_INET6, host, &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
  }
  return strcasecmp(host, "localhost") == 0 ||
         (inet_pton(AF_INET, host, &v4) == 1 && ntohl(v4.s_addr) >> 24 == IN_LOOPBACKNET);
}

int host_is_address(const char *authority, const struct sockaddr *address) {
  char host[HOST_MOST];
  const char *port;
  struct in6_addr named = {0}, own = {0};
  if (!split(authority, strlen(authority), host, &port)) {
    return 0;
  }
  if (address->sa_family == AF_INET) {
    own.s6_addr[10] = own.s6_addr[11] = 0xff; /* ::ffff:a.b.c.d, as a socket for both families reports it */
    memcpy(own.s6_addr + 12, &((const struct sockaddr_in *)(const void *)address)->sin_addr, 4);
  } else if (address->sa_family == AF_INET6) {
    own = ((const struct sockaddr_in6 *)(const void *)address)->sin6_addr;
  } else {
    return 0;
  }
  if (authority[0] != '[') {
    named.s6_addr[10] = named.s6_addr[11] = 0xff;
    return inet_pton(AF_INET, host, named.s6_addr + 12) == 1 && memcmp(&named, &own, sizeof own) == 0;
  }
  return inet_pton(AF_INET6, host, &named) == 1 && memcmp(&named, &own, sizeof own) == 0;
}

int host_equals(const char *authority, const char *other) {
  char host[HOST_MOST], second[HOST_MOST];
  const char *port;
  return split(authority, strlen(authority), host, &port) && split(other, strlen(other), second, &port) &&
         strcasecmp(host, second) == 0;
}

/* Calls fits() for each entry of a list until one fits. */
static int any_entry(const char *list, const char *text,
                     int (*fits)(const char *entry, size_t size, const char *text)) {
  for (const char *at = list + strspn(list, ", "); *at; at += strspn(at, ", ")) {
    size_t size = strcspn(at, ", ");
    if ((size == 1 && *at == '*') || fits(at, size, text)) {
      return 1;
    }
    at += size;
  }
  return 0;
}

static int host_fits(const char *entry, size_t size, const char *authority) {
  char host[HOST_MOST], wanted[HOST_MOST];
  const char *port, *wanted_port;
  if (!split(authority, strlen(authority), host, &port) || !split(entry, size, wanted, &wanted_port)) {
    return 0;
  }
  size_t digits = wanted_port ? (size_t)(entry + size - wanted_port) : 0;
  return strcasecmp(host, wanted) == 0 &&
         (!wanted_port || (port && strlen(port) == digits && strncmp(port, wanted_port, digits) == 0));
}

int host_is_listed(const char *list, const char *authority) {
  return any_entry(list, authority, host_fits);
}

static int origin_fits(const char *entry, size_t size, const char *origin) {
  return strlen(origin) == size && strncmp(entry, origin, size) == 0;
}

int origin_is_listed(const char *list, const char *origin) {
  return any_entry(list, origin, origin_fits);
}

const char *origin_authority(const char *origin) {
  size_t scheme = strncasecmp(origin, "http://", 7) == 0 ? 7 : strncasecmp(origin, "https://", 8) == 0 ? 8 : 0;
  return scheme ? origin + scheme : NULL;
}
