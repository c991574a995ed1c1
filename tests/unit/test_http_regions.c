/* Answers that are sent without a copy: the receiver gets the bytes of header and region, however few bytes the socket
 * takes at a time. */
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cmocka.h>

#include "http/regions.h"

enum { SIZE = 300001 };
static const char head[] = "HTTP/1.1 200 OK\r\n\r\n";

static char *pattern(void) {
  char *bytes = malloc(SIZE);
  assert_non_null(bytes);
  for (size_t i = 0; i < SIZE; i++) {
    bytes[i] = (char)(i * 7 + i / 251);
  }
  return bytes;
}

static size_t drain(int from, char *out, size_t room) {
  size_t n = 0;
  ssize_t got;
  while ((got = recv(from, out + n, room - n, MSG_DONTWAIT)) > 0) {
    n += (size_t)got;
  }
  return n;
}

/* Sends as libmicrohttpd does: header and body at once, then what the socket did not take. */
static void send_all(const char *body, size_t size) {
  int ends[2];
  char *got = malloc(sizeof head + SIZE);
  size_t sent, received;
  assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
  struct iovec parts[] = {{(void *)(uintptr_t)head, sizeof head - 1}, {(void *)(uintptr_t)body, size}};
  struct msghdr message = {.msg_iov = parts, .msg_iovlen = 2};
  ssize_t n = sendmsg(ends[0], &message, MSG_NOSIGNAL);
  assert_true(n >= (ssize_t)sizeof head - 1);
  sent = (size_t)n;
  received = drain(ends[1], got, sizeof head + SIZE);
  while (sent < sizeof head - 1 + size) {
    size_t at = sent - (sizeof head - 1);
    n = send(ends[0], body + at, size - at, MSG_NOSIGNAL);
    assert_true(n > 0);
    sent += (size_t)n;
    received += drain(ends[1], got + received, sizeof head + SIZE - received);
  }
  assert_int_equal(received, sizeof head - 1 + size);
  assert_memory_equal(got, head, sizeof head - 1);
  assert_memory_equal(got + sizeof head - 1, body, size);
  close(ends[0]);
  assert_int_equal(recv(ends[1], got, 1, 0), 0);
  close(ends[1]);
  free(got);
}

static void bytes_arrive_from(const char *folder) {
  char *bytes = pattern();
  regions_in(folder);
  char *kept = region_make(bytes, SIZE);
  assert_non_null(kept);
  assert_memory_equal(kept, bytes, SIZE);
  send_all(kept, SIZE);
  send_all(kept, 40000); /* a part of it */
  send_all(bytes, SIZE); /* no region */
  assert_int_equal(region_free(bytes), 0);
  assert_int_equal(region_free(kept), 1);
  free(bytes);
}

static void bytes_arrive(void **state) {
  (void)state;
  bytes_arrive_from("/var/tmp");
  bytes_arrive_from("/no/such/folder"); /* from memory */
  bytes_arrive_from("");
}

/* A closed socket gives an error, and no signal. */
static void errors_are_reported(void **state) {
  int ends[2];
  char *bytes = pattern(), *kept = region_make(bytes, SIZE);
  (void)state;
  assert_non_null(kept);
  assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  close(ends[1]);
  struct iovec parts[] = {{(void *)(uintptr_t)head, sizeof head - 1}, {kept, SIZE}};
  struct msghdr message = {.msg_iov = parts, .msg_iovlen = 2};
  assert_int_equal(sendmsg(ends[0], &message, MSG_NOSIGNAL), -1);
  close(ends[0]);
  region_free(kept);
  free(bytes);
}

static int next_fd(void) {
  int fd = open("/dev/null", O_RDONLY);
  close(fd);
  return fd;
}

/* At most 256 regions exist, in any order of creation and release, and none leaves its file open. */
static void many(void **state) {
  enum { MOST = 256 };
  char *bytes = pattern(), *all[MOST];
  int first = next_fd();
  (void)state;
  assert_null(region_make(bytes, 1000));
  for (int i = 0; i < MOST; i++) {
    bytes[0] = (char)i;
    all[i] = region_make(bytes, 40000);
    assert_non_null(all[i]);
  }
  assert_null(region_make(bytes, SIZE));
  for (int i = 0; i < MOST; i += 2) {
    assert_int_equal(region_free(all[i]), 1);
  }
  for (int i = 1; i < MOST; i += 2) {
    assert_int_equal(all[i][0], (char)i);
    assert_int_equal(region_free(all[i]), 1);
    assert_int_equal(region_free(all[i]), 0);
  }
  assert_int_equal(next_fd(), first);
  free(bytes);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bytes_arrive), cmocka_unit_test(errors_are_reported),
                                     cmocka_unit_test(many)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
