#include "net/url.h"

#include <arpa/inet.h>
#include <curl/curl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char plain_only[] =
    "http:// is accepted only for addresses that the operator has listed. Use https://, or ask the operator.";
static const char not_public[] = "The host is not a public address. The operator can allow further networks.";

/* The address of a host that is one, in any form that the C library's resolver takes without a query: also decimal,
 * octal, hexadecimal and shortened IPv4. 0: the host is a name. */
static int literal(const char *host, struct sockaddr_storage *out) {
  char inner[NET_ORIGIN];
  struct sockaddr_in *four = (struct sockaddr_in *)(void *)out;
  struct sockaddr_in6 *six = (struct sockaddr_in6 *)(void *)out;
  size_t length = strlen(host), head = host[0] == '[';
  while (length > head && strchr(".]", host[length - 1])) {
    length--;
  }
  snprintf(inner, sizeof inner, "%.*s", (int)(length - head), host + head);
  memset(out, 0, sizeof *out);
  if (inet_pton(AF_INET6, inner, &six->sin6_addr) == 1) {
    out->ss_family = AF_INET6;
    return 1;
  }
  if (inet_aton(inner, &four->sin_addr)) {
    out->ss_family = AF_INET;
    return 1;
  }
  /* Names that mean loopback without a query (RFC 6761). */
  length = strlen(inner);
  if (strcasecmp(inner, "localhost") == 0 || (length > 10 && strcasecmp(inner + length - 10, ".localhost") == 0)) {
    out->ss_family = AF_INET;
    four->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return 1;
  }
  return 0;
}

static net_verdict judge_host(const char *host, int plain, const networks *allowed, const char **why) {
  struct sockaddr_storage address;
  if (!literal(host, &address)) {
    *why = plain_only;
    return plain && allowed->count == 0 ? NET_URL_FORBIDDEN : NET_URL_FINE;
  }
  const struct sockaddr *at = (const struct sockaddr *)&address;
  if (networks_contain(allowed, at)) {
    return NET_URL_FINE;
  }
  *why = address_is_public(at) ? plain_only : not_public;
  return !address_is_public(at) || plain ? NET_URL_FORBIDDEN : NET_URL_FINE;
}

static net_verdict judge(CURLU *parts, const networks *allowed, net_url *out, const char **why) {
  char *scheme = NULL, *host = NULL, *port = NULL, *whole = NULL;
  net_verdict verdict = NET_URL_MALFORMED;
  *why = "The URL is not valid; it must be like https://example.org/path.";
  if (curl_url_set(parts, CURLUPART_FRAGMENT, NULL, 0) == CURLUE_OK &&
      curl_url_get(parts, CURLUPART_SCHEME, &scheme, 0) == CURLUE_OK) {
    out->plain = strcasecmp(scheme, "http") == 0;
    if (!out->plain && strcasecmp(scheme, "https") != 0) {
      *why = "The URL must begin with https://, or with http:// if the operator has listed its address.";
      verdict = NET_URL_FORBIDDEN;
    } else if (curl_url_get(parts, CURLUPART_HOST, &host, 0) == CURLUE_OK && *host &&
               curl_url_get(parts, CURLUPART_PORT, &port, CURLU_DEFAULT_PORT) == CURLUE_OK &&
               strtol(port, NULL, 10) > 0 && curl_url_get(parts, CURLUPART_URL, &whole, 0) == CURLUE_OK &&
               strlen(whole) < sizeof out->text &&
               snprintf(out->origin, sizeof out->origin, "%s://%s:%s", scheme, host, port) < (int)sizeof out->origin) {
      strcpy(out->text, whole);
      verdict = judge_host(host, out->plain, allowed, why);
    }
  }
  curl_free(scheme);
  curl_free(host);
  curl_free(port);
  curl_free(whole);
  return verdict;
}

net_verdict net_url_read(const char *text, const networks *allowed, net_url *out, const char **why) {
  CURLU *parts = curl_url();
  CURLUcode code = parts ? curl_url_set(parts, CURLUPART_URL, text, CURLU_NON_SUPPORT_SCHEME) : CURLUE_OUT_OF_MEMORY;
  char *user = NULL, *password = NULL;
  net_verdict verdict = NET_URL_MALFORMED;
  memset(out, 0, sizeof *out);
  *why = code == CURLUE_OUT_OF_MEMORY ? "The server has no memory left; try again later."
                                      : "The URL is not valid; it must be like https://example.org/path.";
  if (code == CURLUE_OK) {
    int named = curl_url_get(parts, CURLUPART_USER, &user, 0) == CURLUE_OK ||
                curl_url_get(parts, CURLUPART_PASSWORD, &password, 0) == CURLUE_OK;
    if (named) {
      *why = "The URL must not contain a user name or password.";
      verdict = NET_URL_FORBIDDEN;
    } else {
      verdict = judge(parts, allowed, out, why);
    }
  }
  curl_free(user);
  curl_free(password);
  curl_url_cleanup(parts);
  return verdict;
}
