/* The client for URLs that callers name, and the addresses that it refuses, in every notation, from a resolver, or from
 * a redirect. The servers of this test are on loopback; the resolver is this file's getaddrinfo(), which the linker
 * gives to libcurl. */
#include <arpa/inet.h>
#include <dlfcn.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "net/client.h"

/* The names of the test, and the addresses to which they resolve the first time and later. */
static struct name {
  const char *name, *first, *later;
  int asked;
} names[] = {{"private.test", "10.0.0.1", "10.0.0.1", 0},     {"loopback.test", "127.0.0.1", "127.0.0.1", 0},
             {"mapped.test", "::ffff:127.0.0.1", "::1", 0},   {"metadata.test", "169.254.169.254", "fd00:ec2::254", 0},
             {"rebinding.test", "127.0.0.2", "127.0.0.1", 0}, {"listed.test", "127.0.0.2", "127.0.0.2", 0}};

int getaddrinfo(const char *host, const char *service, const struct addrinfo *hints, struct addrinfo **out) {
  int (*real)(const char *, const char *, const struct addrinfo *, struct addrinfo **);
  *(void **)&real = dlsym(RTLD_NEXT, "getaddrinfo");
  for (size_t i = 0; host && i < sizeof names / sizeof names[0]; i++) {
    if (strcmp(host, names[i].name) == 0) {
      host = names[i].asked++ == 0 ? names[i].first : names[i].later;
      struct addrinfo any = *hints;
      any.ai_family = AF_UNSPEC;
      return real(host, service, &any, out);
    }
  }
  return real(host, service, hints, out);
}

/* A server on one address that answers by path and counts its requests. */
typedef struct origin {
  int fd, port, hits;
  char to[128]; /* the target of /to */
  pthread_t thread;
} origin;

static void answer(origin *o, int peer) {
  char request[2048] = "", reply[512], path[64] = "";
  static char block[65536];
  if (read(peer, request, sizeof request - 1) <= 0) {
    return;
  }
  __atomic_add_fetch(&o->hits, 1, __ATOMIC_SEQ_CST);
  sscanf(request, "%*s %63s", path);
  int n = strcmp(path, "/to") == 0
              ? snprintf(reply, sizeof reply, "HTTP/1.1 302 x\r\nLocation: %s\r\nContent-Length: 3\r\n\r\nxxx", o->to)
          : strcmp(path, "/big") == 0 ? snprintf(reply, sizeof reply, "HTTP/1.1 200 x\r\n\r\n")
          : strcmp(path, "/said") == 0
              ? snprintf(reply, sizeof reply, "HTTP/1.1 200 x\r\nContent-Length: 99999999\r\n\r\n")
          : strcmp(path, "/slow") == 0
              ? snprintf(reply, sizeof reply, "HTTP/1.1 200 x\r\nContent-Length: 5\r\n\r\nhe")
              : snprintf(reply, sizeof reply, "HTTP/1.1 200 x\r\nContent-Length: 5\r\nSet-Cookie: a=b\r\n\r\nhello%s",
                         strstr(request, "ookie:") ? "!" : "");
  (void)!write(peer, reply, (size_t)n);
  if (strcmp(path, "/slow") == 0) {
    usleep(1500000);
  }
  for (int i = 0; strcmp(path, "/big") == 0 && i < 64 && send(peer, block, sizeof block, MSG_NOSIGNAL) > 0; i++) {
  }
}

static void *serve(void *user) {
  origin *o = user;
  for (int peer; (peer = accept(o->fd, NULL, NULL)) >= 0; close(peer)) {
    answer(o, peer);
  }
  return NULL;
}

static void origin_open(origin *o, const char *address) {
  struct sockaddr_in at = {.sin_family = AF_INET};
  socklen_t size = sizeof at;
  memset(o, 0, sizeof *o);
  assert_int_equal(inet_pton(AF_INET, address, &at.sin_addr), 1);
  o->fd = socket(AF_INET, SOCK_STREAM, 0);
  assert_int_equal(bind(o->fd, (struct sockaddr *)&at, sizeof at), 0);
  assert_int_equal(listen(o->fd, 16), 0);
  assert_int_equal(getsockname(o->fd, (struct sockaddr *)&at, &size), 0);
  o->port = ntohs(at.sin_port);
  assert_int_equal(pthread_create(&o->thread, NULL, serve, o), 0);
}

static void origin_close(origin *o) {
  shutdown(o->fd, SHUT_RDWR);
  pthread_join(o->thread, NULL);
  close(o->fd);
}

static void read_networks(const char *list, networks *out) {
  char wrong[NETWORKS_WRONG];
  assert_true(networks_read(list, out, wrong));
}

typedef struct taken {
  char bytes[64];
  size_t size;
} taken;

static int keep(void *user, const char *bytes, size_t size) {
  taken *t = user;
  for (size_t i = 0; i < size && t->size < sizeof t->bytes - 1; i++) {
    t->bytes[t->size++] = bytes[i];
  }
  return 1;
}

/* Gets a URL as the daemon does: reads it, then connects. */
static net_end get(const char *text, const networks *allowed, int redirects, net_answer *out, taken *body) {
  net_url url;
  const char *why = NULL;
  memset(out, 0, sizeof *out);
  net_verdict verdict = net_url_read(text, allowed, &url, &why);
  if (verdict != NET_URL_FINE) {
    assert_non_null(why);
    return verdict == NET_URL_FORBIDDEN ? NET_FORBIDDEN : NET_FAILED;
  }
  net_get(&(net_request){.url = &url,
                         .allowed = allowed,
                         .authorities = "",
                         .total_ms = 1000,
                         .most = 1 << 20,
                         .take = body ? keep : NULL,
                         .user = body},
          redirects, out);
  return out->end;
}

static const char *const hostile[] = {"https://127.0.0.1/",
                                      "http://127.0.0.1/",
                                      "https://127.1/",
                                      "https://127.0.1/",
                                      "https://2130706433/",
                                      "https://017700000001/",
                                      "https://0x7f000001/",
                                      "https://0x7f.0.0.0x1/",
                                      "https://0177.0.0.1/",
                                      "https://127.0.0.1./",
                                      "https://%31%32%37.0.0.1/",
                                      "https://0.0.0.0/",
                                      "https://0/",
                                      "https://0.1.2.3/",
                                      "https://10.0.0.1/",
                                      "https://172.16.0.1/",
                                      "https://172.31.255.255/",
                                      "https://192.168.1.1/",
                                      "https://3232235777/",
                                      "https://169.254.169.254/latest/meta-data/",
                                      "https://2852039166/",
                                      "https://0xa9fea9fe/",
                                      "https://100.64.0.1/",
                                      "https://100.100.100.200/",
                                      "https://192.0.0.192/",
                                      "https://168.63.129.16/",
                                      "https://192.0.2.1/",
                                      "https://192.88.99.1/",
                                      "https://198.18.0.1/",
                                      "https://203.0.113.9/",
                                      "https://224.0.0.1/",
                                      "https://240.0.0.1/",
                                      "https://255.255.255.255/",
                                      "https://[::1]/",
                                      "https://[::]/",
                                      "https://[::ffff:127.0.0.1]/",
                                      "https://[::ffff:7f00:1]/",
                                      "https://[::ffff:8.8.8.8]/",
                                      "https://[::127.0.0.1]/",
                                      "https://[64:ff9b::7f00:1]/",
                                      "https://[64:ff9b:1::a00:1]/",
                                      "https://[2002:7f00:1::1]/",
                                      "https://[2001:0:53aa:64c::1]/",
                                      "https://[2001:db8::1]/",
                                      "https://[fe80::1%25eth0]/",
                                      "https://[fec0::1]/",
                                      "https://[fc00::1]/",
                                      "https://[fd00:ec2::254]/",
                                      "https://[ff02::1]/",
                                      "https://localhost/",
                                      "https://LOCALHOST./",
                                      "https://a.localhost:8443/",
                                      "https://user:password@example.org/",
                                      "https://example.org@127.0.0.1/",
                                      "https://@127.0.0.1/",
                                      "https://127.0.0.1#@example.org/",
                                      "https://127.0.0.1?@example.org/",
                                      "http://8.8.8.8/",
                                      "http://example.org/",
                                      "file:///etc/passwd",
                                      "gopher://example.org:70/1",
                                      "ftp://example.org/a",
                                      "dict://example.org:2628/",
                                      "unix:///run/docker.sock",
                                      "https://private.test/",
                                      "https://loopback.test/",
                                      "https://mapped.test/",
                                      "https://mapped.test/again",
                                      "https://metadata.test/",
                                      "https://metadata.test/again"};

static void hostile_urls(void **state) {
  networks none;
  net_answer out;
  (void)state;
  read_networks("", &none);
  for (size_t i = 0; i < sizeof hostile / sizeof hostile[0]; i++) {
    if (get(hostile[i], &none, 5, &out, NULL) != NET_FORBIDDEN) {
      fail_msg("%s is not refused: %d %s", hostile[i], (int)out.end, out.why);
    }
  }
}

static void malformed_urls(void **state) {
  static const char *const wrong[] = {"",
                                      "example.org",
                                      "https://",

                                      "//example.org/",
                                      "https://a b/",
                                      "https://[::1/",
                                      "https://a:99999/",
                                      "https://a:0/",
                                      "https://a:00/",
                                      "https://a\tb/"};
  networks none;
  net_url url;
  const char *why;
  (void)state;
  read_networks("", &none);
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
    if (net_url_read(wrong[i], &none, &url, &why) != NET_URL_MALFORMED) {
      fail_msg("\"%s\" is not malformed", wrong[i]);
    }
  }
  assert_int_equal(net_url_read("https://Example.org/a?b=c#d", &none, &url, &why), NET_URL_FINE);
  assert_string_equal(url.text, "https://Example.org/a?b=c");
  assert_string_equal(url.origin, "https://Example.org:443");
  assert_int_equal(net_url_read("https://[2606:4700::1111]:8443/", &none, &url, &why), NET_URL_FINE);
}

static void lists_of_networks(void **state) {
  static const struct {
    const char *list;
    int count;
  } cases[] = {{"", 0},
               {"10.0.0.0/8", 1},
               {"10.0.0.0/8, fd00::/8 192.0.2.7", 3},
               {"0.0.0.0/0,::/0", 2},
               {"10.0.0.1/8", -1},
               {"10.0.0/8", -1},
               {"10.0.0.0/33", -1},
               {"fd00::/129", -1},
               {"fd00::1/64", -1},
               {"localhost", -1},
               {"10.0.0.0/", -1},
               {"10.0.0.0/-1", -1},
               {"127.1", -1},
               {"10.0.0.0/8;", -1}};
  (void)state;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    networks set;
    char wrong[NETWORKS_WRONG];
    assert_int_equal(networks_read(cases[i].list, &set, wrong) ? set.count : -1, cases[i].count);
  }
}

static void public_addresses(void **state) {
  static const char *const reachable[] = {
      "8.8.8.8",   "1.1.1.1",   "11.0.0.0",        "172.15.255.255", "172.32.0.0", "100.63.255.255", "100.128.0.0",
      "126.0.0.1", "128.0.0.1", "223.255.255.255", "192.167.0.1",    "198.17.0.1", "198.20.0.1"};
  (void)state;
  for (size_t i = 0; i < sizeof reachable / sizeof reachable[0]; i++) {
    struct sockaddr_in at = {.sin_family = AF_INET};
    assert_int_equal(inet_pton(AF_INET, reachable[i], &at.sin_addr), 1);
    assert_true(address_is_public((struct sockaddr *)&at));
  }
  static const char *const reachable6[] = {"2606:4700::1111", "2a00:1450:4001::1", "2003::1", "3ffe::1"};
  for (size_t i = 0; i < sizeof reachable6 / sizeof reachable6[0]; i++) {
    struct sockaddr_in6 at = {.sin6_family = AF_INET6};
    assert_int_equal(inet_pton(AF_INET6, reachable6[i], &at.sin6_addr), 1);
    assert_true(address_is_public((struct sockaddr *)&at));
  }
  assert_false(address_is_public(&(struct sockaddr){.sa_family = AF_UNIX}));
}

/* 127.0.0.2 is listed; 127.0.0.1 is not, and must not be reached. */
static void listed_and_others(void **state) {
  origin listed, other;
  networks set;
  net_answer out;
  taken body = {0};
  char url[128];
  (void)state;
  origin_open(&listed, "127.0.0.2");
  origin_open(&other, "127.0.0.1");
  read_networks("127.0.0.2", &set);
  snprintf(url, sizeof url, "http://127.0.0.2:%d/", listed.port);
  assert_int_equal(get(url, &set, 5, &out, &body), NET_ANSWERED);
  assert_int_equal(out.status, 200);
  assert_string_equal(body.bytes, "hello");
  snprintf(url, sizeof url, "http://listed.test:%d/", listed.port);
  assert_int_equal(get(url, &set, 5, &out, NULL), NET_ANSWERED);

  /* Redirects: to an address that is allowed, to one that is not, and endlessly. */
  snprintf(listed.to, sizeof listed.to, "http://listed.test:%d/", listed.port);
  snprintf(url, sizeof url, "http://127.0.0.2:%d/to", listed.port);
  memset(&body, 0, sizeof body);
  assert_int_equal(get(url, &set, 1, &out, &body), NET_ANSWERED);
  assert_string_equal(body.bytes, "hello"); /* without the body of the redirect, and no cookie was sent */
  static const char *const away[] = {
      "http://127.0.0.1:%d/",          "http://2130706433:%d/",     "//127.0.0.1:%d/",     "http://loopback.test:%d/",
      "http://[::ffff:127.0.0.1]:%d/", "http://user@127.0.0.2:%d/", "ftp://127.0.0.2:%d/", "file:///etc/passwd?%d"};
  for (size_t i = 0; i < sizeof away / sizeof away[0]; i++) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    snprintf(listed.to, sizeof listed.to, away[i], other.port);
#pragma GCC diagnostic pop
    if (get(url, &set, 5, &out, NULL) != NET_FORBIDDEN) {
      fail_msg("a redirect to %s is followed: %d %s", listed.to, (int)out.end, out.why);
    }
  }
  snprintf(listed.to, sizeof listed.to, "/to");
  int before = __atomic_load_n(&listed.hits, __ATOMIC_SEQ_CST);
  assert_int_equal(get(url, &set, 3, &out, NULL), NET_FAILED);
  assert_int_equal(__atomic_load_n(&listed.hits, __ATOMIC_SEQ_CST) - before, 4);

  /* A name that resolves to a listed address the first time and to another one the second time. */
  snprintf(url, sizeof url, "http://rebinding.test:%d/", listed.port);
  assert_int_equal(get(url, &set, 5, &out, NULL), NET_ANSWERED);
  snprintf(url, sizeof url, "http://rebinding.test:%d/", other.port);
  assert_int_equal(get(url, &set, 5, &out, NULL), NET_FORBIDDEN);
  assert_int_equal(__atomic_load_n(&other.hits, __ATOMIC_SEQ_CST), 0);
  origin_close(&listed);
  origin_close(&other);
}

static void no_proxy(void **state) {
  origin listed, proxy;
  networks set;
  net_answer out;
  char url[128], through[64];
  (void)state;
  origin_open(&listed, "127.0.0.2");
  origin_open(&proxy, "127.0.0.2");
  read_networks("127.0.0.2", &set);
  snprintf(through, sizeof through, "http://127.0.0.2:%d", proxy.port);
  setenv("http_proxy", through, 1);
  setenv("ALL_PROXY", through, 1);
  snprintf(url, sizeof url, "http://127.0.0.2:%d/", listed.port);
  assert_int_equal(get(url, &set, 0, &out, NULL), NET_ANSWERED);
  unsetenv("http_proxy");
  unsetenv("ALL_PROXY");
  assert_int_equal(__atomic_load_n(&proxy.hits, __ATOMIC_SEQ_CST), 0);
  origin_close(&listed);
  origin_close(&proxy);
}

static int stop_at_once(void *user) {
  (void)user;
  return 0;
}

static void bounded(void **state) {
  origin listed;
  networks set;
  net_answer out;
  net_url where;
  taken body = {0};
  const char *why;
  char url[128];
  (void)state;
  origin_open(&listed, "127.0.0.2");
  read_networks("127.0.0.0/8", &set);
  snprintf(url, sizeof url, "http://127.0.0.2:%d/big", listed.port); /* 4 MiB without a length */
  assert_int_equal(get(url, &set, 0, &out, &body), NET_TOO_LARGE);
  snprintf(url, sizeof url, "http://127.0.0.2:%d/said", listed.port);
  assert_int_equal(get(url, &set, 0, &out, &body), NET_TOO_LARGE);
  snprintf(url, sizeof url, "http://127.0.0.2:%d/slow", listed.port);
  assert_int_equal(get(url, &set, 0, &out, &body), NET_TIMED_OUT);
  assert_int_equal(net_url_read(url, &set, &where, &why), NET_URL_FINE);
  net_get(
      &(net_request){
          .url = &where, .allowed = &set, .authorities = "", .total_ms = 20000, .most = 100, .continues = stop_at_once},
      0, &out);
  assert_int_equal(out.end, NET_STOPPED);
  origin_close(&listed);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(hostile_urls),     cmocka_unit_test(malformed_urls),    cmocka_unit_test(lists_of_networks),
      cmocka_unit_test(public_addresses), cmocka_unit_test(listed_and_others), cmocka_unit_test(no_proxy),
      cmocka_unit_test(bounded),
  };
  return net_start() ? cmocka_run_group_tests(tests, NULL, NULL) : 1;
}
