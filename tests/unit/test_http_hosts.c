/* Names in Host and Origin headers, and which of them a page of another site can send. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "http/hosts.h"

static void loopback_names(void **state) {
  static const char *const own[] = {"localhost", "LOCALHOST:80", "127.0.0.1",        "127.255.0.9:8080",
                                    "[::1]",     "[::1]:65535",  "[0:0:0:0:0:0:0:1]"};
  static const char *const foreign[] = {"",
                                        ":80",
                                        "localhost:",
                                        "localhost:8080x",
                                        "localhost.",
                                        "localhost.x",
                                        "x.localhost.evil",
                                        "127.0.0.1.evil",
                                        "127.1",
                                        "0.0.0.0",
                                        "2130706433",
                                        "0x7f.0.0.1",
                                        "::1",
                                        "[::1",
                                        "[::1]x",
                                        "[::ffff:127.0.0.1]",
                                        "[fe80::1]",
                                        "128.0.0.1",
                                        "localhost@evil:80",
                                        "evil#localhost"};
  (void)state;
  for (size_t i = 0; i < sizeof own / sizeof own[0]; i++) {
    assert_true(host_is_loopback(own[i]));
  }
  for (size_t i = 0; i < sizeof foreign / sizeof foreign[0]; i++) {
    assert_false(host_is_loopback(foreign[i]));
  }
}

static void addresses(void **state) {
  struct sockaddr_in v4 = {.sin_family = AF_INET};
  struct sockaddr_in6 v6 = {.sin6_family = AF_INET6}, mapped = {.sin6_family = AF_INET6};
  struct sockaddr local = {.sa_family = AF_UNIX};
  const struct sockaddr *four = (const struct sockaddr *)(const void *)&v4;
  const struct sockaddr *six = (const struct sockaddr *)(const void *)&v6;
  const struct sockaddr *both = (const struct sockaddr *)(const void *)&mapped;
  (void)state;
  assert_int_equal(inet_pton(AF_INET, "192.0.2.7", &v4.sin_addr), 1);
  assert_int_equal(inet_pton(AF_INET6, "2001:db8::7", &v6.sin6_addr), 1);
  assert_int_equal(inet_pton(AF_INET6, "::ffff:192.0.2.7", &mapped.sin6_addr), 1);
  assert_true(host_is_address("192.0.2.7:80", four));
  assert_true(host_is_address("192.0.2.7", both));
  assert_true(host_is_address("[2001:DB8:0::7]:80", six));
  assert_false(host_is_address("192.0.2.8", four));
  assert_false(host_is_address("192.0.2.7.evil", four));
  assert_false(host_is_address("2001:db8::7", six));
  assert_false(host_is_address("192.0.2.7", six));
  assert_false(host_is_address("127.0.0.1", &local));
}

static void lists(void **state) {
  const char *hosts = "a.example, b.example:8080 [2001:db8::7],";
  const char *origins = "https://a.example,http://localhost:5173";
  (void)state;
  assert_true(host_is_listed(hosts, "A.example"));
  assert_true(host_is_listed(hosts, "a.example:1"));
  assert_true(host_is_listed(hosts, "b.example:8080"));
  assert_true(host_is_listed(hosts, "[2001:DB8::7]:8080"));
  assert_false(host_is_listed(hosts, "b.example:808"));
  assert_false(host_is_listed(hosts, "b.example:80800"));
  assert_false(host_is_listed(hosts, "b.example"));
  assert_false(host_is_listed(hosts, "a.exampl"));
  assert_false(host_is_listed(hosts, ""));
  assert_false(host_is_listed("", "a.example"));
  assert_true(host_is_listed("*", "a.example"));
  assert_true(origin_is_listed(origins, "https://a.example"));
  assert_false(origin_is_listed(origins, "http://a.example"));
  assert_false(origin_is_listed(origins, "https://a.example,http"));
  assert_false(origin_is_listed(origins, "https://a.exampl"));
  assert_false(origin_is_listed(origins, ""));
  assert_true(origin_is_listed("*", "null"));
  assert_string_equal(origin_authority("https://a.example:1"), "a.example:1");
  assert_null(origin_authority("null"));
  assert_null(origin_authority("ftp://a.example"));
  assert_true(host_equals("A.example:80", "a.example"));
  assert_false(host_equals("unix:/run/x.sock", "localhost"));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(loopback_names), cmocka_unit_test(addresses),
                                     cmocka_unit_test(lists)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
