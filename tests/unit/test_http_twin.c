/* Which bytes are the head of an answer, written twice. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "http/twin.h"

#define STATUS "HTTP/1.1 431 Request Header Fields Too Large\r\n"
#define DATE(second) "Date: Sat, 28 Nov 2026 06:53:" second " GMT\r\n"
#define REST "Connection: close\r\nContent-Length: 143\r\n\r\n"
#define HEAD(second)  \
  STATUS DATE(second) \
  REST

static size_t skipped(const char *text) {
  return twin_head(text, strlen(text));
}

static void two_heads_of_one_answer(void **state) {
  (void)state;
  size_t half = strlen(HEAD("39"));
  assert_int_equal(skipped(HEAD("39") HEAD("39")), half);
  assert_int_equal(skipped(STATUS REST STATUS REST), strlen(STATUS REST));
}

/* A second, a minute or a year may end between the two. */
static void two_heads_of_two_seconds(void **state) {
  (void)state;
  assert_int_equal(skipped(HEAD("39") HEAD("40")), strlen(HEAD("39")));
  assert_int_equal(skipped(STATUS "Date: Thu, 31 Dec 2026 23:59:59 GMT\r\n" REST STATUS
                                  "Date: Fri, 01 Jan 2027 00:00:00 GMT\r\n" REST),
                   strlen(HEAD("39")));
}

static void all_else_is_sent_whole(void **state) {
  static const char *const whole[] = {"",
                                      HEAD("39"),
                                      HEAD("39") REST,
                                      HEAD("39") HEAD("39") "x",
                                      HEAD("39") HEAD("39") HEAD("39"),
                                      STATUS DATE("39") "A: 1\r\n\r\n" STATUS DATE("39") "A: 2\r\n\r\n",
                                      STATUS DATE("39") "A: 1\r\n\r\n" STATUS DATE("40") "B: 1\r\n\r\n",
                                      STATUS "Late: 1\r\n\r\n" STATUS "Late: 2\r\n\r\n",
                                      STATUS "Date: 1\r\n\r\n" STATUS "Date: 2\r\n\r\n",
                                      "HTTP/1.1 200 OK\r\n" DATE("39") "\r\n"
                                      "HTTP/1.1 400 OK\r\n" DATE("39") "\r\n",
                                      "\r\n\r\n\r\n\r\n",
                                      "HTTP/1.HTTP/1.",
                                      "abcabc"};
  (void)state;
  for (size_t i = 0; i < sizeof whole / sizeof whole[0]; i++) {
    if (skipped(whole[i]) != 0) {
      fail_msg("it skips a part of:\n%s", whole[i]);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(two_heads_of_one_answer),
                                     cmocka_unit_test(two_heads_of_two_seconds),
                                     cmocka_unit_test(all_else_is_sent_whole)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
