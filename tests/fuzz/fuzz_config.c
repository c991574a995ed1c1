/* A config file, read as the daemon reads it. An accepted configuration has terminated texts and numbers within their
 * bounds. Run with -close_fd_mask=2: each refusal prints its reason on standard error. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "config.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static config options;
  char path[64];
  int fd = memfd_create("config", MFD_CLOEXEC);
  if (fd < 0 || write(fd, data, size) != (ssize_t)size) {
    abort();
  }
  snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
  char *argv[] = {(char *)(uintptr_t) "orbmorphd", (char *)(uintptr_t) "--config", path, NULL};
  config_action action = config_read(&options, 3, argv);
  close(fd);
  if (action == CONFIG_RUN &&
      (options.workers < 1 || options.workers > 256 || options.http_threads < 2 || options.max_json > 1 << 26 ||
       !memchr(options.listen, 0, sizeof options.listen) || !memchr(options.data, 0, sizeof options.data))) {
    abort();
  }
  return 0;
}
