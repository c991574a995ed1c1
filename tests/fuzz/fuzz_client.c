/* User input of the command line: the first line is an argument of --set, the rest a landmark file. The resulting
 * request must be JSON. Run with -close_fd_mask=2: each refused input prints an error. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "input.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void must_be_json(const cJSON *made) {
  char *text = cJSON_PrintUnformatted(made);
  cJSON *again = text ? cJSON_Parse(text) : NULL;
  if (!again) {
    abort();
  }
  cJSON_Delete(again);
  free(text);
}

static void read_landmarks(const cli *c, const uint8_t *data, size_t size) {
  char path[64];
  int fd = memfd_create("landmarks", MFD_CLOEXEC);
  if (fd < 0 || write(fd, data, size) != (ssize_t)size) {
    abort();
  }
  snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
  cJSON *list = cli_read_landmarks(c, path);
  close(fd);
  if (list) {
    if (!cJSON_IsArray(list)) {
      abort();
    }
    must_be_json(list);
  }
  cJSON_Delete(list);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  const uint8_t *end = memchr(data, '\n', size);
  size_t line = end ? (size_t)(end - data) : size;
  cli c = {.args = {.set_count = 1}};
  char *set = strndup((const char *)data, line);
  cJSON *request = cJSON_Parse("{\"remesh\":{\"method\":\"overlay\"},\"shapes\":[]}");
  if (!set || !request) {
    abort();
  }
  c.args.sets[0] = set;
  (void)cli_apply_sets(&c, request);
  must_be_json(request);
  cJSON_Delete(request);
  free(set);
  if (end) {
    read_landmarks(&c, end + 1, size - line - 1);
  }
  return 0;
}
