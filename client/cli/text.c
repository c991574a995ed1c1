#include "text.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "program.h"

void *cli_alloc(size_t size) {
  void *block = calloc(1, size ? size : 1);
  if (!block) {
    fputs("orbmorph: no memory\n", stderr);
    exit(CLI_REFUSED);
  }
  return block;
}

char *cli_text(const char *format, ...) {
  char *out = NULL;
  va_list list;
  va_start(list, format);
  int length = vasprintf(&out, format, list);
  va_end(list);
  if (length < 0) {
    fputs("orbmorph: no memory\n", stderr);
    exit(CLI_REFUSED);
  }
  return out;
}

char *cli_escape(const char *text) {
  static const char digits[] = "0123456789ABCDEF";
  char *out = cli_alloc(3 * strlen(text) + 1), *fill = out;
  for (const unsigned char *at = (const unsigned char *)text; *at; at++) {
    int plain =
        (*at >= 'a' && *at <= 'z') || (*at >= 'A' && *at <= 'Z') || (*at >= '0' && *at <= '9') || strchr("-_.~,", *at);
    if (plain) {
      *fill++ = (char)*at;
    } else {
      *fill++ = '%';
      *fill++ = digits[*at >> 4];
      *fill++ = digits[*at & 15];
    }
  }
  return out;
}

char *cli_read_file(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  if (!file) {
    fprintf(stderr, "orbmorph: %s: %s\n", path, strerror(errno));
    return NULL;
  }
  size_t room = 1 << 16, fill = 0;
  char *bytes = cli_alloc(room + 1);
  for (size_t got; (got = fread(bytes + fill, 1, room - fill, file)) > 0;) {
    fill += got;
    if (fill == room) {
      char *more = realloc(bytes, 2 * room + 1);
      if (!more) {
        fputs("orbmorph: no memory\n", stderr);
        exit(CLI_REFUSED);
      }
      bytes = more;
      room *= 2;
    }
  }
  int failed = ferror(file);
  if (failed) {
    fprintf(stderr, "orbmorph: %s: %s\n", path, strerror(errno));
  }
  fclose(file);
  if (failed) {
    free(bytes);
    return NULL;
  }
  bytes[fill] = 0;
  *size = fill;
  return bytes;
}

char *cli_base_name(const char *path) {
  const char *slash = strrchr(path, '/'), *begin = slash ? slash + 1 : path, *dot = strrchr(begin, '.');
  size_t length = dot && dot > begin ? (size_t)(dot - begin) : strlen(begin);
  return cli_text("%.*s", (int)length, begin);
}

int cli_is_id(const char *text) {
  return strlen(text) == 64 && strspn(text, "0123456789abcdef") == 64;
}

const char *cli_string(const cJSON *object, const char *name, const char *otherwise) {
  const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, name));
  return text ? text : otherwise;
}

double cli_number(const cJSON *object, const char *name) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  return cJSON_IsNumber(item) ? item->valuedouble : (double)NAN;
}

void cli_count(double value, char out[32]) {
  char digits[32];
  if (!(fabs(value) < 1e15)) {
    snprintf(out, 32, "?");
    return;
  }
  int length = snprintf(digits, sizeof digits, "%.0f", fabs(value)), fill = 0;
  if (value < 0) {
    out[fill++] = '-';
  }
  for (int i = 0; i < length; i++) {
    if (i && (length - i) % 3 == 0) {
      out[fill++] = ',';
    }
    out[fill++] = digits[i];
  }
  out[fill] = 0;
}

double cli_hundredths(double value) {
  const double rounding = 1e-9; /* 0.57 has 56.99999999999999 hundredths */
  return floor(100 * value + rounding) / 100;
}

int cli_whole_number(const char *text, long least, long most, long *out) {
  char *end;
  errno = 0;
  *out = strtol(text, &end, 10);
  return !errno && *text && !*end && *out >= least && *out <= most;
}

int cli_decimal(const char *text, double *out) {
  char *end;
  *out = strtod(text, &end);
  return *text && !*end && isfinite(*out);
}

int cli_fraction(const char *text, double *out) {
  char *end;
  *out = strtod(text, &end);
  if (end > text && !strcmp(end, "%")) {
    *out /= 100;
    end++;
  }
  return *text && !*end && isfinite(*out);
}
