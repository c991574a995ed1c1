/* The scanner keeps one character per level ('{' or '[') instead of recursing. It accepts a subset of what cJSON reads,
 * so cJSON can only fail when memory runs out. */
#include "api/json.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "orbmorph/utf8.h"

typedef struct scanner {
  const unsigned char *at, *end, *begin;
  const char *why;
  size_t values;
  struct top_names *top; /* of the object that the text is; NULL: not wanted */
} scanner;

/* Names as the text writes them, with their quotes. */
typedef struct top_names {
  int bare; /* the text is the members of the object, without its braces */
  int count;
  struct {
    const unsigned char *at;
    size_t size;
  } names[API_JSON_NAMES];
} top_names;

static int refuse(scanner *s, const char *why) {
  if (!s->why) {
    s->why = why;
  }
  return 0;
}

int api_utf8_valid(const char *bytes, size_t size) {
  const unsigned char *p = (const unsigned char *)bytes, *end = p + size;
  while (p < end) {
    size_t n = orb_utf8_length(p, (size_t)(end - p));
    if (n == 0 || *p == 0) {
      return 0;
    }
    p += n;
  }
  return 1;
}

static void blanks(scanner *s) {
  while (s->at < s->end && (*s->at == ' ' || *s->at == '\t' || *s->at == '\n' || *s->at == '\r')) {
    s->at++;
  }
}

static int hex4(scanner *s, unsigned *out) {
  unsigned value = 0;
  for (int i = 0; i < 4; i++, s->at++) {
    if (s->at >= s->end) {
      return refuse(s, "a string is not closed");
    }
    unsigned char c = *s->at;
    unsigned digit = c >= '0' && c <= '9'   ? (unsigned)c - '0'
                     : c >= 'a' && c <= 'f' ? (unsigned)c - 'a' + 10
                     : c >= 'A' && c <= 'F' ? (unsigned)c - 'A' + 10
                                            : 16;
    if (digit > 15) {
      return refuse(s, "\\u needs four hexadecimal digits");
    }
    value = value * 16 + digit;
  }
  *out = value;
  return 1;
}

static int escape(scanner *s) {
  unsigned unit, low;
  if (s->at >= s->end) {
    return refuse(s, "a string is not closed");
  }
  unsigned char c = *s->at++;
  if (c != 'u') {
    return strchr("\"\\/bfnrt", c) && c ? 1 : refuse(s, "a backslash must be followed by one of \"\\/bfnrtu");
  }
  if (!hex4(s, &unit)) {
    return 0;
  }
  if (unit == 0) {
    return refuse(s, "a string contains the character NUL");
  }
  if (unit >= 0xdc00 && unit <= 0xdfff) {
    return refuse(s, "a surrogate is not paired");
  }
  if (unit >= 0xd800 && unit <= 0xdbff) {
    if (s->end - s->at < 6 || s->at[0] != '\\' || s->at[1] != 'u') {
      return refuse(s, "a surrogate is not paired");
    }
    s->at += 2;
    if (!hex4(s, &low)) {
      return 0;
    }
    if (low < 0xdc00 || low > 0xdfff) {
      return refuse(s, "a surrogate is not paired");
    }
  }
  return 1;
}

static int string(scanner *s) {
  for (s->at++; s->at < s->end;) {
    unsigned char c = *s->at;
    if (c == '"') {
      s->at++;
      return 1;
    }
    if (c < 0x20) {
      return refuse(s, "a string contains a control character");
    }
    if (c == '\\') {
      s->at++;
      if (!escape(s)) {
        return 0;
      }
      continue;
    }
    size_t n = orb_utf8_length(s->at, (size_t)(s->end - s->at));
    if (n == 0) {
      return refuse(s, "a string is not valid UTF-8");
    }
    s->at += n;
  }
  return refuse(s, "a string is not closed");
}

static size_t digits(scanner *s) {
  size_t n = 0;
  while (s->at < s->end && *s->at >= '0' && *s->at <= '9') {
    s->at++;
    n++;
  }
  return n;
}

static int number(scanner *s) {
  const unsigned char *begin = s->at;
  if (*s->at == '-') {
    s->at++;
  }
  const unsigned char *whole = s->at;
  size_t n = digits(s);
  if (n == 0 || (n > 1 && *whole == '0')) {
    return refuse(s, "a number is malformed");
  }
  if (s->at < s->end && *s->at == '.') {
    s->at++;
    if (digits(s) == 0) {
      return refuse(s, "a number is malformed");
    }
  }
  if (s->at < s->end && (*s->at == 'e' || *s->at == 'E')) {
    s->at++;
    if (s->at < s->end && (*s->at == '+' || *s->at == '-')) {
      s->at++;
    }
    if (digits(s) == 0) {
      return refuse(s, "a number is malformed");
    }
  }
  /* cJSON truncates numbers of more than 63 characters. */
  char copy[64];
  size_t length = (size_t)(s->at - begin);
  if (length >= sizeof copy) {
    return refuse(s, "a number has more than 63 characters");
  }
  memcpy(copy, begin, length);
  copy[length] = 0;
  return isfinite(strtod(copy, NULL)) ? 1 : refuse(s, "a number is too large to be finite");
}

static int literal(scanner *s, const char *word) {
  size_t n = strlen(word);
  if ((size_t)(s->end - s->at) < n || memcmp(s->at, word, n) != 0) {
    return refuse(s, "a value is expected");
  }
  s->at += n;
  return 1;
}

static int scalar(scanner *s) {
  switch (*s->at) {
    case '"':
      return string(s);
    case 't':
      return literal(s, "true");
    case 'f':
      return literal(s, "false");
    case 'n':
      return literal(s, "null");
    default:
      break;
  }
  return *s->at == '-' || (*s->at >= '0' && *s->at <= '9') ? number(s) : refuse(s, "a value is expected");
}

/* Adds a name of the object at the top. */
static int add_name(scanner *s, const unsigned char *at) {
  top_names *top = s->top;
  const size_t size = (size_t)(s->at - at);
  if (memchr(at, '\\', size)) {
    return refuse(s, "a name is escaped");
  }
  for (int i = 0; i < top->count; i++) {
    if (top->names[i].size == size && memcmp(top->names[i].at, at, size) == 0) {
      return refuse(s, "an object has the same name twice");
    }
  }
  if (top->count == API_JSON_NAMES) {
    return refuse(s, "an object has too many names");
  }
  top->names[top->count].at = at;
  top->names[top->count++].size = size;
  return 1;
}

/* A member's name and colon. depth: how many levels deep. */
static int name(scanner *s, int depth) {
  blanks(s);
  const unsigned char *begin = s->at;
  if (s->at >= s->end || *s->at != '"') {
    return refuse(s, "a member's name in quotes is expected");
  }
  if (!string(s) || (s->top && depth == 1 && !add_name(s, begin))) {
    return 0;
  }
  blanks(s);
  if (s->at >= s->end || *s->at != ':') {
    return refuse(s, "a colon is expected");
  }
  s->at++;
  return 1;
}

/* Closes the objects and arrays that end after a value. Returns 1 if another value must follow, 2 at the end of the
 * text, 0 if it refuses. */
static int after_value(scanner *s, const char *stack, int *depth) {
  const int least = s->top && s->top->bare;
  while (*depth > 0) {
    blanks(s);
    if (s->at >= s->end) {
      return least && *depth == 1 ? 2 : refuse(s, "the text ends before the value is complete");
    }
    char open = stack[*depth - 1];
    if (*s->at == ',') {
      s->at++;
      return open == '[' || name(s, *depth);
    }
    if (*s->at != (open == '{' ? '}' : ']') || *depth == least) {
      return refuse(s, open == '{' ? "a comma or } is expected" : "a comma or ] is expected");
    }
    s->at++;
    --*depth;
  }
  return 2;
}

static int scan(scanner *s) {
  char stack[API_JSON_DEPTH];
  int depth = 0, more = 1;
  if (s->top && s->top->bare) {
    stack[depth++] = '{';
    more = name(s, depth);
  }
  while (more == 1) {
    blanks(s);
    if (s->at >= s->end) {
      return refuse(s, s->begin == s->end ? "the body is empty" : "the text ends before the value is complete");
    }
    unsigned char c = *s->at;
    s->values++;
    if (c == '{' || c == '[') {
      if (depth == API_JSON_DEPTH) {
        return refuse(s, "the value is nested deeper than 32 levels");
      }
      stack[depth++] = (char)c;
      s->at++;
      blanks(s);
      if (s->at < s->end && *s->at == (c == '{' ? '}' : ']')) {
        s->at++;
        depth--;
      } else if (c == '[') {
        continue;
      } else if (name(s, depth)) {
        continue;
      } else {
        return 0;
      }
    } else if (!scalar(s)) {
      return 0;
    }
    more = after_value(s, stack, &depth);
  }
  if (!more) {
    return 0;
  }
  blanks(s);
  return s->at == s->end ? 1 : refuse(s, "the value is followed by more text");
}

size_t api_json_count(const char *bytes, size_t size) {
  const unsigned char *begin = (const unsigned char *)bytes;
  scanner s = {.at = begin, .begin = begin, .end = begin + size};
  return scan(&s) ? s.values : 0;
}

int api_json_is_object(const char *text, size_t size, int bare, size_t most) {
  const unsigned char *begin = (const unsigned char *)text;
  top_names top = {.bare = bare};
  scanner s = {.at = begin, .begin = begin, .end = begin + size, .top = &top};
  blanks(&s);
  return (bare || (s.at < s.end && *s.at == '{')) && scan(&s) && s.values <= most;
}

const char *api_json_blanks(const char *at) {
  return at + strspn(at, " \t\r\n");
}

const char *api_json_after(const char *at) {
  for (int depth = 0; *at; at++) {
    if (*at == '"') {
      for (at++; *at && *at != '"'; at++) {
        at += *at == '\\' && at[1];
      }
    } else if (depth == 0 && strchr(",]} \t\r\n", *at)) {
      return at;
    } else {
      depth += *at == '[' || *at == '{';
      depth -= *at == ']' || *at == '}';
    }
    if (!*at || (depth == 0 && strchr("\"]}", *at))) {
      return *at ? at + 1 : at;
    }
  }
  return at;
}

int api_json_next_member(const char **at, api_json_span *name, api_json_span *value) {
  name->at = api_json_blanks(*at);
  name->end = api_json_after(name->at);
  value->at = api_json_blanks(api_json_blanks(name->end) + (*api_json_blanks(name->end) == ':'));
  value->end = api_json_after(value->at);
  *at = api_json_blanks(value->end);
  *at += **at == ',';
  return *name->at == '"' && value->end > value->at;
}

static int by_name(const void *a, const void *b) {
  return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Returns 1 if an object in the tree has the same name twice, 0 if none has, −1 if memory runs out. It recurses: the
 * scanner bounds the depth. */
static int has_duplicates(const cJSON *value) {
  if (cJSON_IsObject(value)) {
    size_t n = (size_t)cJSON_GetArraySize(value), i = 0;
    const char **names = malloc((n ? n : 1) * sizeof *names);
    if (!names) {
      return -1;
    }
    for (const cJSON *m = value->child; m; m = m->next) {
      names[i++] = m->string;
    }
    qsort(names, n, sizeof *names, by_name);
    int twice = 0;
    for (i = 1; i < n; i++) {
      twice |= strcmp(names[i - 1], names[i]) == 0;
    }
    free(names);
    if (twice) {
      return 1;
    }
  }
  if (cJSON_IsObject(value) || cJSON_IsArray(value)) {
    for (const cJSON *m = value->child; m; m = m->next) {
      int found = has_duplicates(m);
      if (found) {
        return found;
      }
    }
  }
  return 0;
}

cJSON *api_json_parse(const char *bytes, size_t size, api_json_error *error) {
  const unsigned char *begin = (const unsigned char *)bytes;
  scanner s = {.at = begin, .begin = begin, .end = begin + size};
  if (!scan(&s)) {
    error->why = s.why;
    error->offset = (size_t)(s.at - s.begin);
    return NULL;
  }
  *error = (api_json_error){NULL, 0};
  cJSON *value = cJSON_ParseWithLength(bytes, size);
  int twice = value ? has_duplicates(value) : -1;
  if (twice) {
    cJSON_Delete(value);
    error->why = twice > 0 ? "an object has the same name twice" : NULL;
    return NULL;
  }
  return value;
}
