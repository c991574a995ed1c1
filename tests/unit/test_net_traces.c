/* Spans for a collector that does not exist: recording them never waits, and spans beyond the limit are counted. */
#include <arpa/inet.h>
#include <netinet/in.h>
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
#include "trace/send.h"
#include "trace/trace.h"

static const char caller[] = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
enum { TRACE_DIGITS_END = 35 };

static void test_off(void **state) {
  char self[TRACE_PARENT] = "x";
  (void)state;
  assert_false(trace_is_on());
  trace_begin(caller, self);
  assert_string_equal(self, "");
  trace_end(&(trace_span){.self = caller, .parent = "", .name = "none"});
  trace_numbers n;
  trace_count(&n);
  assert_int_equal(n.waiting + n.dropped + n.sent, 0);
}

static void check_names(void) {
  char self[TRACE_PARENT], other[TRACE_PARENT];
  trace_begin(caller, self);
  assert_int_equal(strlen(self), TRACE_PARENT - 1);
  assert_memory_equal(self, caller, TRACE_DIGITS_END);
  assert_memory_not_equal(self + TRACE_DIGITS_END, caller + TRACE_DIGITS_END, 17);
  trace_begin("", self);
  trace_begin("", other);
  assert_memory_not_equal(self, other, TRACE_DIGITS_END);
  assert_int_equal(strspn(self, "0123456789abcdef-"), TRACE_PARENT - 1);
  assert_string_equal(self + TRACE_PARENT - 3, "01");
  trace_begin_below("", self);
  assert_string_equal(self, "");
  trace_begin("00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-00", self);
  assert_string_equal(self, "");
}

/* A port that takes connections and answers nothing. */
static int listen_silently(char url[64]) {
  struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  socklen_t size = sizeof at;
  int fd = socket(AF_INET, SOCK_STREAM, 0);
  assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
  assert_int_equal(listen(fd, 4), 0);
  assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &size), 0);
  snprintf(url, 64, "http://127.0.0.1:%d", ntohs(at.sin_port));
  return fd;
}

static void test_bound(void **state) {
  enum { MANY = 20000, BUFFER = 8192, BATCH = 512 };
  char url[64], self[TRACE_PARENT];
  int fd = listen_silently(url);
  trace_numbers n;
  (void)state;
  assert_true(net_start());
  assert_true(trace_start(&(trace_options){.url = url, .authorities = "", .role = "all"}));
  check_names();
  for (int i = 0; i < MANY; i++) {
    trace_begin(caller, self);
    trace_end(&(trace_span){.self = self, .parent = caller, .name = "one", .start_us = 2, .end_us = 1});
  }
  trace_count(&n);
  assert_int_equal(n.sent, 0);
  assert_int_equal(n.waiting + n.dropped, MANY);
  assert_true(n.waiting >= BUFFER && n.waiting <= BUFFER + BATCH); /* besides the batch that is being sent */
  trace_stop();
  assert_false(trace_is_on());
  close(fd);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_off), cmocka_unit_test(test_bound)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
