/* sign: signed URLs. The signature is the HMAC-SHA256 of the path, "?" and the query, with the secret as printed. */
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "commands.h"
#include "terminal.h"
#include "text.h"

/* A number of minutes, hours or days from now, as Unix time in seconds; 0 if malformed. */
static long long moment(const char *text) {
  char *end;
  long long number = text && *text >= '0' && *text <= '9' ? strtoll(text, &end, 10) : 0;
  long long unit = number < 1 || number > 1000000 ? 0
                   : !strcmp(end, "d")            ? 86400
                   : !strcmp(end, "h")            ? 3600
                   : !strcmp(end, "m")            ? 60
                                                  : 0;
  return unit ? (long long)time(NULL) + number * unit : 0;
}

/* Whether a query, from its question mark on, has a parameter of this name. */
static int has_parameter(const char *query, const char *name) {
  size_t length = strlen(name);
  for (; *query; query += strcspn(query, "&")) {
    query++;
    if (!strncmp(query, name, length) && query[length] == '=') {
      return 1;
    }
  }
  return 0;
}

/* NULL, or why a client would not send the URL as it stands here: the signature covers the bytes that are sent. */
static const char *why_not(const char *url, const char *target) {
  for (const unsigned char *at = (const unsigned char *)url; *at; at++) {
    if (*at <= ' ' || *at >= 0x7f || strchr("\"<>\\^`{|}#", *at)) {
      return "percent-encode spaces, non-ASCII letters and \" < > \\ ^ ` { | }, and omit the fragment";
    }
  }
  if (!target) {
    return "it needs a path, such as /v1/morph.glb?shapes=ID,ID";
  }
  size_t path = strcspn(target, "?");
  for (size_t i = 0; i < path; i++) {
    if (target[i] == '/' && target[i + 1] == '.') {
      return "its path has a dot segment, which clients remove";
    }
  }
  const char *query = target + path;
  return has_parameter(query, "signature") ? "it is signed already"
         : has_parameter(query, "expires") || has_parameter(query, "key")
             ? "signing adds the parameters key and expires; remove them from the URL"
             : NULL;
}

int cli_run_sign(cli *c) {
  const char *url = c->args.operands[0], *key = c->args.value[OPT_KEY], *scheme = strstr(url, "://");
  const char *target = url[0] == '/' ? url : scheme ? strchr(scheme + 3, '/') : NULL, *wrong = why_not(url, target);
  unsigned char signature[crypto_auth_hmacsha256_BYTES];
  char hex[2 * sizeof signature + 1];
  crypto_auth_hmacsha256_state state;
  key = key ? key : getenv("ORBMORPH_KEY");
  const char *colon = key ? strchr(key, ':') : NULL;
  if (wrong) {
    cli_error(c, "the URL cannot be signed: %s", wrong);
    return CLI_USAGE;
  }
  if (!colon || colon == key || !colon[1]) {
    cli_error(c, "--key or $ORBMORPH_KEY takes KEY:SECRET, as orbmorphd key add prints it");
    return CLI_USAGE;
  }
  const char *expires = c->args.value[OPT_EXPIRES];
  long long until = moment(expires);
  if (!until) {
    cli_error(c, "--expires %s a number of days, hours or minutes, such as 30d, 12h or 90m",
              expires ? "takes" : "is missing; it takes");
    return CLI_USAGE;
  }
  char *whole =
      cli_text("%s%ckey=%.*s&expires=%lld", url, strchr(url, '?') ? '&' : '?', (int)(colon - key), key, until);
  const char *from = whole + (target - url);
  crypto_auth_hmacsha256_init(&state, (const unsigned char *)colon + 1, strlen(colon + 1));
  crypto_auth_hmacsha256_update(&state, (const unsigned char *)from, strlen(from));
  crypto_auth_hmacsha256_final(&state, signature);
  sodium_bin2hex(hex, sizeof hex, signature, sizeof signature);
  printf("%s&signature=%s\n", whole, hex);
  free(whole);
  return CLI_DONE;
}
