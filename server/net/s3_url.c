#include "net/s3_url.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LETTERS "abcdefghijklmnopqrstuvwxyz"
#define CAPITALS "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
#define DIGITS "0123456789"

/* What the parameters say. */
typedef struct parameters {
  char endpoint[S3_HOST], region[S3_NAME], path_style[4], part_mib[8];
} parameters;

static int consists_of(const char *text, const char *set) {
  return *text && !text[strspn(text, set)];
}

static int take(const char *from, size_t n, char *out, size_t size) {
  if (n >= size) {
    return 0;
  }
  memcpy(out, from, n);
  out[n] = 0;
  return 1;
}

/* A value of the query; %XX stands for a byte. */
static int decode(const char *from, size_t n, char *out, size_t size) {
  size_t at = 0;
  for (size_t i = 0; i < n; i++, at++) {
    unsigned byte = (unsigned char)from[i];
    if (byte == '%') {
      if (i + 2 >= n || !isxdigit((unsigned char)from[i + 1]) || !isxdigit((unsigned char)from[i + 2]) ||
          sscanf(from + i + 1, "%2x", &byte) != 1 || !byte) {
        return 0;
      }
      i += 2;
    }
    if (at + 1 >= size) {
      return 0;
    }
    out[at] = (char)byte;
  }
  out[at] = 0;
  return 1;
}

static int read_parameter(const char *text, size_t n, parameters *out) {
  const char *equals = memchr(text, '=', n);
  size_t name = equals ? (size_t)(equals - text) : n;
  const struct {
    const char *name;
    char *value;
    size_t size;
  } known[] = {{"endpoint", out->endpoint, sizeof out->endpoint},
               {"region", out->region, sizeof out->region},
               {"path_style", out->path_style, sizeof out->path_style},
               {"part_mib", out->part_mib, sizeof out->part_mib}};
  for (size_t i = 0; equals && i < sizeof known / sizeof known[0]; i++) {
    if (name == strlen(known[i].name) && strncmp(text, known[i].name, name) == 0) {
      return decode(equals + 1, n - name - 1, known[i].value, known[i].size);
    }
  }
  return 0;
}

static int is_address(const char *host) {
  size_t name = strcspn(host, ":");
  return host[0] == '[' || strspn(host, DIGITS ".") >= name || (name == 9 && strncmp(host, "localhost", 9) == 0);
}

/* Fills scheme, host and base. */
static const char *place_host(const parameters *p, s3_place *out) {
  char endpoint[S3_HOST];
  if (p->endpoint[0]) {
    strcpy(endpoint, p->endpoint);
  } else {
    snprintf(endpoint, sizeof endpoint, "https://s3.%s.amazonaws.com", out->region);
  }
  int plain = strncmp(endpoint, "http://", 7) == 0;
  if (!plain && strncmp(endpoint, "https://", 8) != 0) {
    return "its endpoint must begin with https:// or http://";
  }
  char *host = endpoint + (plain ? 7 : 8), *end = host + strlen(host);
  if (end > host && end[-1] == '/') {
    *--end = 0;
  }
  if (!consists_of(host, LETTERS CAPITALS DIGITS "-.:[]")) {
    return "its endpoint must be a scheme, a host and perhaps a port, without path or user";
  }
  const char *own = plain ? ":80" : ":443"; /* libcurl omits it from the header Host, which is signed */
  if (end - host > (long)strlen(own) && strcmp(end - strlen(own), own) == 0 && *host != '[') {
    end[-(long)strlen(own)] = 0;
  }
  strcpy(out->scheme, plain ? "http" : "https");
  int by_path = strcmp(p->path_style, "1") == 0 || is_address(host);
  int n = by_path ? snprintf(out->host, sizeof out->host, "%s", host)
                  : snprintf(out->host, sizeof out->host, "%s.%s", out->bucket, host);
  if (n >= (int)sizeof out->host) {
    return "its endpoint is too long";
  }
  if (by_path) {
    snprintf(out->base, sizeof out->base, "/%s/", out->bucket);
  } else {
    strcpy(out->base, "/");
  }
  return NULL;
}

static const char *read_prefix(const char *from, size_t n, s3_place *out) {
  while (n && from[n - 1] == '/') {
    n--;
  }
  if (n + 1 >= sizeof out->prefix) {
    return "its prefix is too long";
  }
  if (n) {
    take(from, n, out->prefix, sizeof out->prefix);
    if (!consists_of(out->prefix, LETTERS CAPITALS DIGITS "-_./") || strstr(out->prefix, "//") ||
        out->prefix[0] == '/' || strstr(out->prefix, "..")) {
      return "its prefix may have only letters, digits, '-', '_', '.' and single slashes";
    }
    strcat(out->prefix, "/");
  }
  return NULL;
}

static const char *read_all(const char *text, s3_place *out) {
  parameters p = {.region = "us-east-1", .path_style = "0", .part_mib = "64"};
  if (strncmp(text, "s3://", 5) != 0) {
    return "it must begin with s3://";
  }
  text += 5;
  size_t bucket = strcspn(text, "/?"), whole = strcspn(text, "?");
  if (bucket < 3 || !take(text, bucket, out->bucket, sizeof out->bucket) ||
      !consists_of(out->bucket, LETTERS DIGITS "-.") || !isalnum((unsigned char)out->bucket[0])) {
    return "its bucket must have 3 to 63 lower-case letters, digits, '-' or '.'";
  }
  const char *why = whole > bucket ? read_prefix(text + bucket + 1, whole - bucket - 1, out) : NULL;
  for (const char *at = text + whole; !why && *at;) {
    size_t n = strcspn(++at, "&");
    if (!read_parameter(at, n, &p)) {
      return "its parameters may only be endpoint, region, path_style and part_mib, each with a value";
    }
    at += n;
  }
  if (why) {
    return why;
  }
  if (!consists_of(p.region, LETTERS CAPITALS DIGITS "-_")) {
    return "its region may have only letters, digits, '-' and '_'";
  }
  if (strcmp(p.path_style, "0") != 0 && strcmp(p.path_style, "1") != 0) {
    return "its path_style must be 0 or 1";
  }
  out->part_mib = consists_of(p.part_mib, DIGITS) ? atoi(p.part_mib) : 0;
  if (out->part_mib < S3_PART_LEAST || out->part_mib > S3_PART_MOST) {
    return "its part_mib must be a number from 5 to 5120";
  }
  strcpy(out->region, p.region);
  return place_host(&p, out);
}

int s3_url_read(const char *text, s3_place *out, const char **why) {
  memset(out, 0, sizeof *out);
  *why = read_all(text, out);
  return !*why;
}
