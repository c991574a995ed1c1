/* Bytes of a connection to the whole service: requests as they arrive over the network. The first byte says whether
 * tokens are needed and in how many parts the rest is sent. No worker runs, so jobs stay queued and the outcome does
 * not depend on time. No answer may be 500, and each answer begins as HTTP does. The target creates the data folder in
 * $TMPDIR; run.sh removes it. */
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "http/http.h"
#include "log.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerInitialize(int *argc, char ***argv);

enum { QUEUED_MOST = 8, REPLY_MOST = 1 << 20, PATIENCE_US = 100000 };
static server srv;
static config options;
static struct sockaddr_un address = {.sun_family = AF_UNIX};

/* The token that the seeds send: 64 zeros. */
static int add_token(void) {
  static const char token[] = "0000000000000000000000000000000000000000000000000000000000000000";
  token_row row = {.name = "fuzz", .scopes = SCOPE_READ | SCOPE_WRITE};
  return token_hash(token, row.hash) && catalogue_token_add(srv.cat, &row) == STORE_OK;
}

int LLVMFuzzerInitialize(int *argc, char ***argv) {
  static char folder[80], listen[100];
  const char *base = getenv("TMPDIR");
  (void)argc;
  (void)argv;
  snprintf(folder, sizeof folder, "%.60s/fuzz-XXXXXX", base ? base : "/tmp");
  if (sodium_init() < 0 || !mkdtemp(folder)) {
    abort();
  }
  snprintf(address.sun_path, sizeof address.sun_path, "%s/socket", folder);
  snprintf(listen, sizeof listen, "unix:%s", address.sun_path);
  char *words[] = {
      "orbmorphd",      "--listen", listen,     "--data", folder,    "--max-body", "1M",     "--max-json",        "64K",
      "--disk-reserve", "0",        "--limits", "off",    "--hosts", "*",          "--cors", "https://a.example", NULL};
  srv.memory = budget_create(INT64_C(1) << 40);
  queue_options queued = {.workers = 1, .cores = 1, .limit = QUEUED_MOST, .memory = srv.memory};
  if (config_read(&options, (int)(sizeof words / sizeof *words) - 1, words) != CONFIG_RUN) {
    abort();
  }
  log_setup(LOG_ERROR, 1);
  srv.options = &options;
  srv.control = -1;
  srv.arriving = temporary_create();
  if (!srv.memory || !srv.arriving || !listen_open(&options, options.listen, &srv.at) ||
      objects_open(options.data, &srv.store) != STORE_OK || catalogue_open(options.data, &srv.cat) != STORE_OK ||
      !add_token() || !(srv.callers = callers_open(srv.cat)) || !(srv.q = queue_create(&queued, srv.cat)) ||
      !(srv.descriptions = cache_create(1 << 20)) || !(srv.io = tasks_start(1, NULL)) ||
      !(srv.checks = tasks_start(1, srv.memory)) || !(srv.large_checks = tasks_start(1, srv.memory)) ||
      !http_start(&srv)) {
    abort();
  }
  __atomic_store_n(&srv.ready, 1, __ATOMIC_RELEASE);
  return 0;
}

static int open_connection(void) {
  int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  struct timeval patience = {.tv_usec = PATIENCE_US};
  if (fd < 0 || connect(fd, (struct sockaddr *)&address, sizeof address) != 0) {
    abort();
  }
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  return fd;
}

/* Reads up to the end, or until the other side is silent for a while. */
static void check_reply(int fd) {
  static char text[REPLY_MOST + 1];
  size_t size = 0;
  for (ssize_t n = 1; n > 0 && size < REPLY_MOST;) {
    n = recv(fd, text + size, REPLY_MOST - size, 0);
    size += n > 0 ? (size_t)n : 0;
  }
  text[size] = 0;
  if (size >= 12 && (strncmp(text, "HTTP/1.", 7) != 0 || strncmp(text + 9, "500", 3) == 0)) {
    abort();
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  if (size < 2) {
    return 0;
  }
  srv.needs_token = data[0] & 1;
  size_t parts = 1 + (data[0] >> 1) % 4, at = 1;
  int fd = open_connection();
  for (size_t part = 1; part <= parts; part++) {
    size_t end = part == parts ? size : 1 + (size - 1) * part / parts;
    ssize_t n = end > at ? send(fd, data + at, end - at, MSG_NOSIGNAL) : 0;
    if (n < 0) {
      break;
    }
    at = end;
  }
  shutdown(fd, SHUT_WR);
  check_reply(fd);
  close(fd);
  return 0;
}
