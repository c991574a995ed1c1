#include "log.h"

#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "api/text.h"

static atomic_int least_level = LOG_INFO, as_json = 1;
static const char *const names[] = {"debug", "info", "warn", "error"};

void log_setup(log_level least, int json) {
  atomic_store(&least_level, (int)least);
  atomic_store(&as_json, json);
}

int log_wants(log_level level) {
  return (int)level >= atomic_load(&least_level);
}

void log_write(log_level level, const char *fields, const char *format, ...) {
  if ((int)level < atomic_load(&least_level)) {
    return;
  }
  char message[1024];
  va_list args;
  va_start(args, format);
  vsnprintf(message, sizeof message, format, args);
  va_end(args);
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  api_text line = {0};
  if (atomic_load(&as_json)) {
    api_json_open(&line, '{');
    api_json_member_instant(&line, "time", (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000);
    api_json_member_string(&line, "level", names[level]);
    api_json_member_string(&line, "message", message);
    if (fields && fields[0]) {
      api_text_printf(&line, ",%s", fields);
    }
    api_json_close(&line, '}');
  } else {
    api_text_printf(&line, "%s: %s%s%s", names[level], message, fields && fields[0] ? " " : "", fields ? fields : "");
  }
  api_text_add(&line, "\n");
  if (!line.failed) {
    ssize_t ignored = write(STDERR_FILENO, line.data, line.size);
    (void)ignored;
  }
  api_text_free(&line);
}
