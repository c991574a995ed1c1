#include "store/s3_keys.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int take(const char *from, char *out, size_t size) {
  return from && snprintf(out, size, "%s", from) < (int)size;
}

static const char *from_environment(s3_keys *out) {
  const char *access = getenv("AWS_ACCESS_KEY_ID"), *secret = getenv("AWS_SECRET_ACCESS_KEY");
  const char *token = getenv("AWS_SESSION_TOKEN");
  if (!access || !secret || !*access || !*secret) {
    return "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment, or name a file with s3-keys";
  }
  return take(access, out->access, sizeof out->access) && take(secret, out->secret, sizeof out->secret) &&
                 take(token ? token : "", out->token, sizeof out->token)
             ? NULL
             : "a key in the environment is too long";
}

/* The value of a line "name = value"; NULL: another line. */
static char *value_of(char *line, const char *name) {
  size_t n = strlen(name);
  line += strspn(line, " \t");
  if (strncmp(line, name, n) != 0) {
    return NULL;
  }
  line += n;
  line += strspn(line, " \t");
  if (*line != '=') {
    return NULL;
  }
  line += 1 + strspn(line + 1, " \t");
  line[strcspn(line, " \t\r\n")] = 0;
  return line;
}

static const char *from_file(const char *path, s3_keys *out) {
  static char line[S3_TOKEN + 64]; /* only one thread reads keys: at the start, then that of bucket.c */
  int of_default = 1, fine = 1;
  FILE *file = fopen(path, "re");
  if (!file) {
    return "the file that s3-keys names cannot be read";
  }
  while (fgets(line, sizeof line, file)) {
    char *value;
    if (line[strspn(line, " \t")] == '[') {
      of_default = strncmp(line + strspn(line, " \t"), "[default]", 9) == 0;
    } else if (of_default && (value = value_of(line, "aws_access_key_id"))) {
      fine &= take(value, out->access, sizeof out->access);
    } else if (of_default && (value = value_of(line, "aws_secret_access_key"))) {
      fine &= take(value, out->secret, sizeof out->secret);
    } else if (of_default && (value = value_of(line, "aws_session_token"))) {
      fine &= take(value, out->token, sizeof out->token);
    }
  }
  fclose(file);
  memset(line, 0, sizeof line);
  if (!fine) {
    return "a key in the file that s3-keys names is too long";
  }
  return *out->access && *out->secret
             ? NULL
             : "the file that s3-keys names needs the lines aws_access_key_id = … and aws_secret_access_key = …";
}

int s3_keys_read(const char *path, s3_keys *out, const char **why) {
  memset(out, 0, sizeof *out);
  *why = *path ? from_file(path, out) : from_environment(out);
  return !*why;
}
