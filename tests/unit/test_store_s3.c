/* Objects in S3 without a server: signatures compared with examples that AWS published, URLs, keys, the bound of the
 * cache. */
#include <fcntl.h>
#include <limits.h>
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
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>
#include <sodium.h>

#include "store/object_cache.h"
#include "store/s3.h"
#include "store/s3_keys.h"

static const char empty[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";

/* Amazon S3 API Reference, "Signature Calculations for the Authorization Header: Transferring Payload in a Single
 * Chunk", its four examples. */
static void test_s3_examples(void **state) {
  (void)state;
  static const s3_keys keys = {.access = "AKIAIOSFODNN7EXAMPLE", .secret = "wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY"};
  static const char date[] = "20130524T000000Z",
                    body[] = "44ce7dd67c959e0d3524ffac1771dfbba87d2b6b4b4e99e42034a8b803f8b072";
  static const struct {
    s3_canonical request;
    const char *signature;
  } cases[] = {
      {{"GET", "/test.txt", "",
        "host:examplebucket.s3.amazonaws.com\nrange:bytes=0-9\n"
        "x-amz-content-sha256:e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855\n"
        "x-amz-date:20130524T000000Z\n",
        "host;range;x-amz-content-sha256;x-amz-date", empty},
       "f0e8bdb87c964420e857bd35b5d6ed310bd44f0170aba48dd91039c6036bdb41"},
      {{"PUT", "/test%24file.text", "",
        "date:Fri, 24 May 2013 00:00:00 GMT\nhost:examplebucket.s3.amazonaws.com\n"
        "x-amz-content-sha256:44ce7dd67c959e0d3524ffac1771dfbba87d2b6b4b4e99e42034a8b803f8b072\n"
        "x-amz-date:20130524T000000Z\nx-amz-storage-class:REDUCED_REDUNDANCY\n",
        "date;host;x-amz-content-sha256;x-amz-date;x-amz-storage-class", body},
       "98ad721746da40c64f1a55b78f14c238d841ea1380cd77a1b5971af0ece108bd"},
      {{"GET", "/", "lifecycle=",
        "host:examplebucket.s3.amazonaws.com\n"
        "x-amz-content-sha256:e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855\n"
        "x-amz-date:20130524T000000Z\n",
        "host;x-amz-content-sha256;x-amz-date", empty},
       "fea454ca298b7da1c68078a5d1bdbfbbe0d65c699e0f91ac7a200a0136783543"},
      {{"GET", "/", "max-keys=2&prefix=J",
        "host:examplebucket.s3.amazonaws.com\n"
        "x-amz-content-sha256:e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855\n"
        "x-amz-date:20130524T000000Z\n",
        "host;x-amz-content-sha256;x-amz-date", empty},
       "34b48302e7b5fa45bde8084f4b7868a86f0a534bc59db6670ed5711ef69dc6f7"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    char signature[S3_SIGNATURE];
    s3_sign(&keys, "us-east-1", "s3", date, &cases[i].request, signature);
    assert_string_equal(signature, cases[i].signature);
  }
}

/* AWS Signature Version 4 test suite: get-vanilla. */
static void test_suite(void **state) {
  (void)state;
  static const s3_keys keys = {.access = "AKIDEXAMPLE", .secret = "wJalrXUtnFEMI/K7MDENG+bPxRfiCYEXAMPLEKEY"};
  const s3_canonical vanilla = {
      "GET", "/", "", "host:example.amazonaws.com\nx-amz-date:20150830T123600Z\n", "host;x-amz-date", empty};
  char signature[S3_SIGNATURE];
  s3_sign(&keys, "us-east-1", "service", "20150830T123600Z", &vanilla, signature);
  assert_string_equal(signature, "5fa00fa31553b73ebf1942676e86291e8372ff2a2260956d9b8aae1d763fbf31");
}

/* Amazon S3 API Reference, "Authenticating Requests: Using Query Parameters", its example. */
static void test_presigned(void **state) {
  (void)state;
  static const s3_keys keys = {.access = "AKIAIOSFODNN7EXAMPLE", .secret = "wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY"};
  char query[2048];
  const s3_presigned url = {.method = "GET",
                            .region = "us-east-1",
                            .host = "examplebucket.s3.amazonaws.com",
                            .path = "/test.txt",
                            .date = "20130524T000000Z",
                            .seconds = 86400,
                            .more = ""};
  assert_true(s3_presign(&keys, &url, query, sizeof query));
  assert_string_equal(query,
                      "X-Amz-Algorithm=AWS4-HMAC-SHA256&X-Amz-Credential=AKIAIOSFODNN7EXAMPLE%2F20130524%2Fus-east-1%"
                      "2Fs3%2Faws4_request"
                      "&X-Amz-Date=20130524T000000Z&X-Amz-Expires=86400&X-Amz-SignedHeaders=host"
                      "&X-Amz-Signature=aeeed9bbccd4d02ee5c0109b86d86835f995330da4c265957d157751f604d404");
  char small[100];
  assert_false(s3_presign(&keys, &url, small, sizeof small));
  s3_date(1369353600, small);
  assert_string_equal(small, "20130524T000000Z");
}

static void test_urls(void **state) {
  (void)state;
  s3_place at;
  const char *why;
  assert_true(s3_url_read("s3://things", &at, &why));
  assert_string_equal(at.host, "things.s3.us-east-1.amazonaws.com");
  assert_string_equal(at.base, "/");
  assert_string_equal(at.prefix, "");
  assert_string_equal(at.scheme, "https");
  assert_int_equal(at.part_mib, 64);
  assert_true(s3_url_read("s3://things?part_mib=5", &at, &why));
  assert_int_equal(at.part_mib, 5);
  assert_true(
      s3_url_read("s3://things/a/b/?region=eu-1&path_style=1&endpoint=https%3A%2F%2Fs3.example.org:443/", &at, &why));
  assert_string_equal(at.host, "s3.example.org");
  assert_string_equal(at.base, "/things/");
  assert_string_equal(at.prefix, "a/b/");
  assert_string_equal(at.region, "eu-1");
  assert_true(s3_url_read("s3://things?endpoint=http://127.0.0.1:8080", &at, &why));
  assert_string_equal(at.host, "127.0.0.1:8080");
  assert_string_equal(at.base, "/things/");
  static const char *const wrong[] = {"s3:/things",
                                      "S3://things",
                                      "s3://",
                                      "s3://ab",
                                      "s3://Things",
                                      "s3://things/a b",
                                      "s3://things//a",
                                      "s3://things/../a",
                                      "s3://things?endpoint",
                                      "s3://things?endpoint=ftp://x",
                                      "s3://things?endpoint=https://",
                                      "s3://things?endpoint=https://user@host",
                                      "s3://things?endpoint=https://host/path",
                                      "s3://things?endpoint=https%3",
                                      "s3://things?region=",
                                      "s3://things?region=a%00b",
                                      "s3://things?path_style=2",
                                      "s3://things?part_mib=4",
                                      "s3://things?part_mib=5121",
                                      "s3://things?part_mib=5M",
                                      "s3://things?colour=red"};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
    if (s3_url_read(wrong[i], &at, &why)) {
      fail_msg("%s", wrong[i]);
    }
    assert_non_null(why);
  }
  char long_one[2000] = "s3://things/";
  memset(long_one + 12, 'a', sizeof long_one - 13);
  assert_false(s3_url_read(long_one, &at, &why));
}

static void test_keys(void **state) {
  (void)state;
  char path[] = "/tmp/orbmorph-keys-XXXXXX";
  static const char text[] =
      "[other]\naws_access_key_id = wrong\n[default]\naws_access_key_id=AK:1\r\n  aws_secret_access_key = s/+=  \n";
  int fd = mkstemp(path);
  assert_true(fd >= 0 && write(fd, text, sizeof text - 1) == (ssize_t)sizeof text - 1);
  s3_keys keys;
  const char *why;
  assert_true(s3_keys_read(path, &keys, &why));
  assert_string_equal(keys.access, "AK:1");
  assert_string_equal(keys.secret, "s/+=");
  assert_string_equal(keys.token, "");
  assert_int_equal(ftruncate(fd, 30), 0);
  assert_false(s3_keys_read(path, &keys, &why));
  close(fd);
  unlink(path);
  assert_false(s3_keys_read(path, &keys, &why));
  unsetenv("AWS_ACCESS_KEY_ID");
  assert_false(s3_keys_read("", &keys, &why));
  setenv("AWS_ACCESS_KEY_ID", "a", 1);
  setenv("AWS_SECRET_ACCESS_KEY", "b", 1);
  setenv("AWS_SESSION_TOKEN", "c", 1);
  assert_true(s3_keys_read("", &keys, &why));
  assert_string_equal(keys.token, "c");
}

static void test_elements(void **state) {
  (void)state;
  const char *at = "<A><Key>a&amp;b</Key><Key>&quot;c</Key></A>";
  char out[8];
  assert_true(s3_element(&at, "Key", out, sizeof out));
  assert_string_equal(out, "a&b");
  assert_true(s3_element(&at, "Key", out, sizeof out));
  assert_string_equal(out, "\"c");
  assert_false(s3_element(&at, "Key", out, sizeof out));
}

enum { FILES = 10, FILE_BYTES = 1000, MOST = 5500 };

static int put_file(object_cache *cache, const char *folder, int i) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s/mesh/%02d", folder, i);
  assert_int_equal(mkdir(path, 0700), 0);
  snprintf(path, sizeof path, "%s/mesh/%02d/file", folder, i);
  int fd = open(path, O_RDWR | O_CREAT | O_EXCL, 0600);
  assert_true(fd >= 0 && ftruncate(fd, FILE_BYTES) == 0);
  object_cache_used(fd);
  object_cache_grew(cache, FILE_BYTES);
  return fd;
}

/* A server that answers 403 to every signature more than 15 minutes from its time, as S3 does, and records all
 * requests. */
typedef struct fake_s3 {
  int listening, requests, accepted;
  int64_t now; /* Unix time */
  char dates[8][S3_DATE];
} fake_s3;

static void *serve(void *user) {
  fake_s3 *f = user;
  for (int fd; (fd = accept(f->listening, NULL, NULL)) >= 0; close(fd)) {
    char text[8192] = "", date[64], least[S3_DATE], most[S3_DATE], answer[256];
    size_t size = 0;
    for (ssize_t n = 1; n > 0 && size + 1 < sizeof text && !strstr(text, "\r\n\r\n"); size += n > 0 ? (size_t)n : 0) {
      n = read(fd, text + size, sizeof text - 1 - size);
    }
    const char *signed_at = strstr(text, "x-amz-date:");
    const time_t now = (time_t)f->now;
    struct tm parts;
    s3_date((long long)f->now - 900, least);
    s3_date((long long)f->now + 900, most);
    if (!signed_at || f->requests == 8) {
      continue;
    }
    char *noted = f->dates[f->requests++];
    snprintf(noted, S3_DATE, "%.16s", signed_at + strlen("x-amz-date:"));
    const int fine = strcmp(noted, least) >= 0 && strcmp(noted, most) <= 0;
    f->accepted += fine;
    strftime(date, sizeof date, "%a, %d %b %Y %H:%M:%S GMT", gmtime_r(&now, &parts));
    int n = snprintf(answer, sizeof answer, "HTTP/1.1 %s\r\nDate: %s\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
                     fine ? "200 OK" : "403 Forbidden", date);
    assert_int_equal(write(fd, answer, (size_t)n), n);
  }
  return NULL;
}

/* If the clock of this machine is a day ahead of S3's, one request is repeated, once; links have S3's time as well. */
static void test_other_clock(void **state) {
  (void)state;
  fake_s3 f = {.listening = socket(AF_INET, SOCK_STREAM, 0), .now = (int64_t)time(NULL) - 86400};
  struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  socklen_t length = sizeof address;
  assert_int_equal(bind(f.listening, (struct sockaddr *)&address, sizeof address), 0);
  assert_int_equal(listen(f.listening, 4), 0);
  assert_int_equal(getsockname(f.listening, (struct sockaddr *)&address, &length), 0);
  pthread_t thread;
  assert_int_equal(pthread_create(&thread, NULL, serve, &f), 0);
  s3_options options = {.keys = {.access = "access", .secret = "secret"}, .authorities = ""};
  char url[120], link[4096], day[S3_DATE], expected[64];
  const char *why = NULL;
  snprintf(url, sizeof url, "s3://bucket?endpoint=http://127.0.0.1:%d&region=here&path_style=1",
           ntohs(address.sin_port));
  assert_true(s3_url_read(url, &options.place, &why));
  s3 *store = s3_open(&options);
  const s3_request request = {.method = "GET", .key = "name", .to = -1, .tries = 1};
  for (int i = 0; i < 2; i++) {
    s3_answer answer;
    s3_send(store, &request, &answer);
    assert_int_equal(answer.status, 200);
    free(answer.text);
  }
  assert_true(s3_link(store, "name", 60, "", link, sizeof link));
  s3_date((long long)f.now, day);
  snprintf(expected, sizeof expected, "X-Amz-Date=%.8s", day);
  assert_non_null(strstr(link, expected));
  s3_close(store);
  shutdown(f.listening, SHUT_RDWR);
  pthread_join(thread, NULL);
  close(f.listening);
  assert_int_equal(f.requests, 3);
  assert_int_equal(f.accepted, 2);
}

/* The entry that was used the longest time ago leaves, and the sum never exceeds the bound. */
static void test_bound(void **state) {
  (void)state;
  char folder[] = "/tmp/orbmorph-cache-XXXXXX", path[PATH_MAX];
  assert_non_null(mkdtemp(folder));
  snprintf(path, sizeof path, "%s/mesh", folder);
  assert_int_equal(mkdir(path, 0700), 0);
  object_cache *cache = object_cache_open(folder, MOST);
  int first = put_file(cache, folder, 0);
  for (int i = 1; i < FILES; i++) {
    usleep(2000); /* the time of reading has the resolution of a kernel tick */
    object_cache_used(first);
    close(put_file(cache, folder, i));
    int there = 0;
    for (int k = 0; k <= i; k++) {
      snprintf(path, sizeof path, "%s/mesh/%02d/file", folder, k);
      there += access(path, F_OK) == 0;
    }
    assert_true(there * FILE_BYTES <= MOST);
    assert_true(there >= (i + 1 < 4 ? i + 1 : 4));
    snprintf(path, sizeof path, "%s/mesh/00/file", folder);
    assert_int_equal(access(path, F_OK), 0);
    snprintf(path, sizeof path, "%s/mesh/%02d/file", folder, i);
    assert_int_equal(access(path, F_OK), 0);
  }
  close(first);
  object_cache_close(cache);
  cache = object_cache_open(folder, 2 * FILE_BYTES); /* a smaller bound holds from the start */
  int there = 0;
  for (int k = 0; k < FILES; k++) {
    snprintf(path, sizeof path, "%s/mesh/%02d/file", folder, k);
    there += access(path, F_OK) == 0;
    unlink(path);
    *strrchr(path, '/') = 0;
    rmdir(path);
  }
  assert_int_equal(there, 1);
  object_cache_close(cache);
  snprintf(path, sizeof path, "%s/mesh", folder);
  rmdir(path);
  rmdir(folder);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_s3_examples), cmocka_unit_test(test_suite),       cmocka_unit_test(test_presigned),
      cmocka_unit_test(test_urls),        cmocka_unit_test(test_keys),        cmocka_unit_test(test_elements),
      cmocka_unit_test(test_bound),       cmocka_unit_test(test_other_clock),
  };
  return sodium_init() < 0 ? 1 : cmocka_run_group_tests(tests, NULL, NULL);
}
