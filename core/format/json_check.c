/* A JSON scanner without recursion: one flag for each level says whether it is an object. */
#include "format/json_check.h"

#include <string.h>

enum { DEPTH_MAX = 1000, NUMBER_MAX = 63 }; /* cJSON's limits: levels, characters of a number */

typedef struct scanner {
  const char *at, *end;
} scanner;

static void blanks(scanner *s) {
  while (s->at < s->end && strchr(" \t\r\n", *s->at) && *s->at) {
    s->at++;
  }
}

static int takes(scanner *s, char c) {
  blanks(s);
  int there = s->at < s->end && *s->at == c;
  s->at += there;
  return there;
}

static int word(scanner *s, const char *text) {
  size_t n = strlen(text);
  int there = (size_t)(s->end - s->at) >= n && memcmp(s->at, text, n) == 0;
  s->at += there ? n : 0;
  return there;
}

/* The code unit of \uXXXX, after its \u; −1 if there is none. */
static int unit(scanner *s) {
  int value = 0;
  for (int i = 0; i < 4; i++, s->at++) {
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *digit = s->at < s->end && *s->at ? strchr(digits, *s->at) : NULL;
    if (!digit) {
      return -1;
    }
    value = value * 16 + (int)((digit - digits) % 16);
  }
  return value;
}

static int escape(scanner *s) {
  if (s->at == s->end) {
    return 0;
  }
  char c = *s->at++;
  if (c != 'u') {
    return c && strchr("\"\\/bfnrt", c);
  }
  int first = unit(s);
  if (first < 0xd800 || first > 0xdfff) {
    return first >= 0;
  }
  int second = first < 0xdc00 && word(s, "\\u") ? unit(s) : -1;
  return second >= 0xdc00 && second <= 0xdfff;
}

static int string(scanner *s) {
  if (!takes(s, '"')) {
    return 0;
  }
  while (s->at < s->end && *s->at != '"') {
    if (*s->at++ == '\\' && !escape(s)) {
      return 0;
    }
  }
  return takes(s, '"');
}

static int digits(scanner *s) {
  const char *begin = s->at;
  while (s->at < s->end && *s->at >= '0' && *s->at <= '9') {
    s->at++;
  }
  return s->at > begin;
}

static int number(scanner *s) {
  const char *begin = s->at;
  (void)word(s, "-");
  if (!digits(s) || (word(s, ".") && !digits(s))) {
    return 0;
  }
  if (word(s, "e") || word(s, "E")) {
    if (!word(s, "-")) {
      (void)word(s, "+");
    }
    if (!digits(s)) {
      return 0;
    }
  }
  return s->at - begin <= NUMBER_MAX;
}

static int scalar(scanner *s) {
  return s->at < s->end && *s->at == '"' ? string(s)
                                         : word(s, "true") || word(s, "false") || word(s, "null") || number(s);
}

int orb_json_begins(const char *text, size_t size) {
  unsigned char is_object[DEPTH_MAX];
  scanner s = {text, text + size};
  (void)word(&s, "\xef\xbb\xbf");
  for (int depth = 0;;) {
    blanks(&s);
    if (takes(&s, '{') || takes(&s, '[')) {
      if (depth == DEPTH_MAX) {
        return 0;
      }
      is_object[depth++] = s.at[-1] == '{';
      if (!takes(&s, is_object[depth - 1] ? '}' : ']')) {
        if (is_object[depth - 1] && !(string(&s) && takes(&s, ':'))) {
          return 0;
        }
        continue; /* to its first value */
      }
      depth--;
    } else if (!scalar(&s)) {
      return 0;
    }
    while (depth > 0 && takes(&s, is_object[depth - 1] ? '}' : ']')) {
      depth--;
    }
    if (depth == 0) {
      return 1;
    }
    if (!takes(&s, ',') || (is_object[depth - 1] && !(string(&s) && takes(&s, ':')))) {
      return 0;
    }
  }
}
