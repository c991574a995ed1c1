/* Signatures of URLs: the required end of a target, the HMAC of RFC 4231, rotation and limits per day. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "http/signers.h"
#include "support_store.h"

#define ZEROS "0000000000000000000000000000000000000000000000000000000000000000"
#define ONES "1111111111111111111111111111111111111111111111111111111111111111"

static void ends_of_targets(void **state) {
  static const struct {
    const char *target;
    int result;
  } cases[] = {{"/v1/morph.glb", 0},
               {"/v1/morph.glb?shapes=a", 0},
               {"/v1/signature=" ZEROS, 0},
               {"/a?xsignature=" ZEROS, 0},
               {"/a?key=web&expires=1&signature=" ZEROS, 1},
               {"/a?b=c&key=web&expires=123456789012345678&signature=" ZEROS, 1},
               {"/a?key=x&b=c&key=web&expires=1&signature=" ZEROS, 1},
               {"/a?key=web&expires=1&signature=", -1},
               {"/a?key=web&expires=1&signature=" ZEROS "0", -1},
               {"/a?key=web&expires=1&signature=" ZEROS "&b=c", -1},
               {"/a?key=web&expires=1&signature=" ZEROS "&signature=" ZEROS, -1},
               {"/a?key=web&expires=1&b=c&signature=" ZEROS, -1},
               {"/a?expires=1&key=web&signature=" ZEROS, -1},
               {"/a?key=web&expires=0&signature=" ZEROS, -1},
               {"/a?key=web&expires=01&signature=" ZEROS, -1},
               {"/a?key=web&expires=-1&signature=" ZEROS, -1},
               {"/a?key=web&expires=1234567890123456789&signature=" ZEROS, -1},
               {"/a?key=&expires=1&signature=" ZEROS, -1},
               {"/a?key=a%20b&expires=1&signature=" ZEROS, -1},
               {"/a?key=" ZEROS "&expires=1&signature=" ZEROS, -1},
               {"/a?signature=" ZEROS, -1},
               {"/a?key=web&expires=1&signature=ABCDEF0000000000000000000000000000000000000000000000000000000000", -1}};
  signed_target parts;
  (void)state;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    assert_int_equal(signature_read(cases[i].target, &parts), cases[i].result);
  }
  assert_int_equal(signature_read("/a?b=c&key=web-1.x_Y&expires=77&signature=" ZEROS, &parts), 1);
  assert_string_equal(parts.name, "web-1.x_Y");
  assert_int_equal(parts.expires, 77);
  assert_int_equal(parts.size, strlen("/a?b=c&key=web-1.x_Y&expires=77"));
}

static void sign(const char *secret, const char *text, char target[400]) {
  unsigned char mac[crypto_auth_hmacsha256_BYTES];
  char hex[65];
  crypto_auth_hmacsha256_state hmac;
  crypto_auth_hmacsha256_init(&hmac, (const unsigned char *)secret, strlen(secret));
  crypto_auth_hmacsha256_update(&hmac, (const unsigned char *)text, strlen(text));
  crypto_auth_hmacsha256_final(&hmac, mac);
  sodium_bin2hex(hex, sizeof hex, mac, sizeof mac);
  snprintf(target, 400, "%s&signature=%s", text, hex);
}

static sign_result check(signers *all, const char *secret, const char *text, int64_t now) {
  char target[400];
  signed_target parts;
  signer *who = NULL;
  int64_t limit;
  sign(secret, text, target);
  assert_int_equal(signature_read(target, &parts), 1);
  sign_result result = signers_check(all, target, &parts, now, &who, &limit);
  assert_int_equal(who != NULL, result == SIGN_OK);
  signer_release(who);
  return result;
}

/* RFC 4231, test case 2: the key "Jefe". */
static void hmac_of_the_rfc(void **state) {
  char target[400];
  (void)state;
  sign("Jefe", "what do ya want for nothing?", target);
  assert_string_equal(strstr(target, "&signature="),
                      "&signature=5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

static const char text_of_web[] = "/v1/morph.glb?shapes=a&key=web&expires=2000";

static void rotation(void **state) {
  stored *s = *state;
  key_row row = {.name = "web", .tenant = "shop", .secret = ZEROS, .created = 1};
  assert_int_equal(catalogue_key_add(s->cat, &row), STORE_OK);
  assert_int_equal(catalogue_key_add(s->cat, &row), STORE_CONFLICT);
  signers *all = signers_open(s->cat);
  assert_non_null(all);
  assert_int_equal(check(all, ZEROS, text_of_web, 1000), SIGN_OK);
  assert_int_equal(check(all, ONES, text_of_web, 1000), SIGN_BAD);
  assert_int_equal(check(all, ZEROS, text_of_web, 1999), SIGN_OK);
  assert_int_equal(check(all, ZEROS, text_of_web, 2000), SIGN_EXPIRED);
  assert_int_equal(check(all, ONES, text_of_web, 2000), SIGN_BAD); /* an invalid one says nothing about its date */
  assert_int_equal(check(all, ZEROS, "/v1/morph.glb?shapes=a&key=other&expires=2000", 1000), SIGN_BAD);
  assert_int_equal(catalogue_key_rotate(s->cat, "web", ONES, 1500), STORE_OK);
  assert_int_equal(catalogue_key_rotate(s->cat, "other", ONES, 1500), STORE_NOT_FOUND);
  assert_true(signers_reload(all));
  assert_int_equal(check(all, ONES, text_of_web, 1000), SIGN_OK);
  assert_int_equal(check(all, ZEROS, text_of_web, 1499), SIGN_OK);
  assert_int_equal(check(all, ZEROS, text_of_web, 1500), SIGN_BAD);
  assert_int_equal(catalogue_key_remove(s->cat, "web"), STORE_OK);
  assert_true(signers_reload(all));
  assert_int_equal(check(all, ONES, text_of_web, 1000), SIGN_BAD);
  signers_close(all);
}

static void limits_by_day(void **state) {
  stored *s = *state;
  key_row row = {.name = "web", .tenant = "shop", .secret = ZEROS, .requests = 2, .created = 1};
  const char *text = "/v1/morph.glb?shapes=a&key=web&expires=9999999";
  const int64_t day = 86400;
  int count;
  assert_int_equal(catalogue_key_add(s->cat, &row), STORE_OK);
  signers *all = signers_open(s->cat);
  assert_int_equal(check(all, ZEROS, text, 10 * day + 5), SIGN_OK);
  assert_int_equal(check(all, ONES, text, 10 * day + 5), SIGN_BAD); /* is not counted */
  assert_int_equal(check(all, ZEROS, text, 10 * day + 6), SIGN_OK);
  assert_int_equal(check(all, ZEROS, text, 11 * day - 1), SIGN_TOO_MANY);
  assert_int_equal(check(all, ZEROS, text, 11 * day), SIGN_OK);
  signers_store_use(all);
  signers_close(all);
  catalogue_key_settle(s->cat);
  key_row *rows = catalogue_keys(s->cat, &count);
  assert_int_equal(count, 1);
  assert_int_equal(rows[0].day, 11);
  assert_int_equal(rows[0].used_requests, 1);
  free(rows);
  all = signers_open(s->cat); /* after a restart */
  assert_int_equal(check(all, ZEROS, text, 11 * day + 7), SIGN_OK);
  assert_int_equal(check(all, ZEROS, text, 11 * day + 8), SIGN_TOO_MANY);
  signers_close(all);
  catalogue_key_use(s->cat, "web", 11, 0, 1500);
  catalogue_key_use(s->cat, "web", 11, 0, 1500);
  catalogue_key_use(s->cat, "gone", 11, 0, 1500);
  catalogue_key_settle(s->cat);
  assert_int_equal(catalogue_key_ms(s->cat, "web", 11), 3000);
  assert_int_equal(catalogue_key_ms(s->cat, "web", 12), 0);
  assert_int_equal(catalogue_key_ms(s->cat, "gone", 11), 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(ends_of_targets), cmocka_unit_test(hmac_of_the_rfc),
                                     cmocka_unit_test_setup_teardown(rotation, stored_setup, stored_teardown),
                                     cmocka_unit_test_setup_teardown(limits_by_day, stored_setup, stored_teardown)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
