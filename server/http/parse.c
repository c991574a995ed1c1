#include "http/parse.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/ids.h"
#include "api/json.h"

int parse_range(const char *text, uint64_t size, uint64_t *first, uint64_t *length) {
  if (!text || strncasecmp(text, "bytes=", 6) != 0) {
    return 0;
  }
  text += 6;
  size_t digits = strspn(text, "0123456789"), after;
  if (digits > 18 || text[digits] != '-') {
    return 0;
  }
  const char *second = text + digits + 1;
  after = strspn(second, "0123456789");
  if (after > 18 || second[after] != 0 || (digits == 0 && after == 0)) {
    return 0;
  }
  uint64_t a = strtoull(text, NULL, 10), b = after ? strtoull(second, NULL, 10) : UINT64_MAX;
  if (digits == 0) { /* the last b bytes */
    if (b == 0 || size == 0) {
      return -1;
    }
    *length = b < size ? b : size;
    *first = size - *length;
    return 1;
  }
  if (b < a) {
    return 0;
  }
  if (a >= size) {
    return -1;
  }
  *first = a;
  *length = (b < size - 1 ? b : size - 1) - a + 1;
  return 1;
}

static int tag_matches(const char *list, const char *tag, int strong) {
  for (const char *at = list; at && *at;) {
    at += strspn(at, " \t,");
    if (*at == '*') {
      return 1;
    }
    if (!strong && strncmp(at, "W/", 2) == 0) {
      at += 2;
    }
    size_t n = strcspn(at, ",");
    while (n && (at[n - 1] == ' ' || at[n - 1] == '\t')) {
      n--;
    }
    if (n == strlen(tag) && strncmp(at, tag, n) == 0) {
      return 1;
    }
    at += strcspn(at, ",");
  }
  return 0;
}

int parse_tag_matches(const char *list, const char *tag) {
  return tag_matches(list, tag, 0);
}

int parse_tag_matches_strong(const char *list, const char *tag) {
  return tag_matches(list, tag, 1);
}

const char *parse_target(const char *url) {
  size_t scheme = strncasecmp(url, "http://", 7) == 0 ? 7 : strncasecmp(url, "https://", 8) == 0 ? 8 : 0;
  const char *path = strchr(url + scheme, '/');
  return scheme == 0 ? url : path ? path : "/";
}

enum { WAIT_MOST_S = 60 };

static int64_t clamped_ms(double seconds) {
  return seconds < WAIT_MOST_S ? (int64_t)(1000 * seconds) : 1000 * WAIT_MOST_S;
}

int64_t parse_wait_ms(const char *query) {
  char *end;
  double seconds = strtod(query, &end);
  return end == query || *end || !(seconds >= 0) ? -1 : clamped_ms(seconds);
}

/* Returns the end of a token or quoted string. */
static const char *skip_word(const char *at) {
  if (*at != '"') {
    return at + strcspn(at, " \t,;=\"");
  }
  for (at++; *at && *at != '"'; at++) {
    at += *at == '\\' && at[1];
  }
  return at + (*at == '"');
}

/* Reads name [= word], with blanks allowed around the sign; *value is NULL without a sign. Returns the end, after any
 * blanks. */
static const char *read_pair(const char *at, const char **value) {
  at = skip_word(at);
  at += strspn(at, " \t");
  *value = NULL;
  if (*at == '=') {
    at++;
    at += strspn(at, " \t");
    *value = at;
    at = skip_word(at);
    at += strspn(at, " \t");
  }
  return at;
}

int64_t parse_preferred_ms(const char *prefer) {
  for (const char *at = prefer; at && *at;) {
    at += strspn(at, " \t,;");
    const char *name = at, *value, *other;
    at = read_pair(at, &value);
    if (value && strncasecmp(name, "wait", 4) == 0 && strchr(" \t=", name[4])) {
      char *end;
      value += *value == '"';
      double seconds = value[0] >= '0' && value[0] <= '9' ? strtod(value, &end) : 0;
      return seconds > 0 && strchr(" \t,;\"", *end) ? clamped_ms(seconds) : 0;
    }
    while (*at == ';') { /* its parameters */
      at++;
      at += strspn(at, " \t");
      at = read_pair(at, &other);
    }
    at += *at && *at != ',' && *at != ';'; /* skips a character outside the grammar */
  }
  return 0;
}

int parse_urgency(const char *text) {
  for (const char *at = text; at && *at; at += strcspn(at, ","), at += *at == ',') {
    at += strspn(at, " \t");
    if (at[0] == 'u' && at[1] == '=' && at[2] >= '0' && at[2] <= '7' && (!at[3] || strchr(" \t,;", at[3]))) {
      return at[2] - '0';
    }
  }
  return 3;
}

int64_t parse_event_number(const char *text) {
  long long number = text ? strtoll(text, NULL, 10) : 0;
  return number > 0 ? number : 0;
}

const char PARSE_PAGE_TOKEN[] = "\"page_token\" must be the \"next_page_token\" of the previous page.";

int parse_page(const char *limit_text, const char *token, int *limit, uint64_t *sealed, const char **why) {
  char *end;
  *limit = PAGE_STANDARD;
  *sealed = 0;
  if (limit_text) {
    long value = strtol(limit_text, &end, 10);
    if (*end || end == limit_text || value < 1) {
      *why = "\"limit\" must be a whole number of at least 1; values above 1000 mean 1000.";
      return 0;
    }
    *limit = value < PAGE_MOST ? (int)value : PAGE_MOST;
  }
  if (token) {
    if (strlen(token) != 16 || strspn(token, "0123456789abcdef") != 16) {
      *why = PARSE_PAGE_TOKEN;
      return 0;
    }
    *sealed = strtoull(token, NULL, 16);
  }
  return 1;
}

int parse_id_prefix(const char *text) {
  size_t length = strlen(text);
  return length > 0 && length < API_ID_SIZE && strspn(text, "0123456789abcdef") == length;
}

int parse_trace(const char *text, char out[TRACE_SIZE]) {
  static const char form[TRACE_SIZE] = "00-xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx-xxxxxxxxxxxxxxxx-xx";
  if (!text || strlen(text) != TRACE_SIZE - 1) {
    return 0;
  }
  for (size_t i = 0; form[i]; i++) {
    if (form[i] == 'x' ? !strchr("0123456789abcdef", text[i]) : text[i] != form[i]) {
      return 0;
    }
  }
  if (strspn(text + 3, "0") >= 32 || strspn(text + 36, "0") >= 16) { /* "All zeroes is considered an invalid value." */
    return 0;
  }
  memcpy(out, text, TRACE_SIZE);
  return 1;
}
