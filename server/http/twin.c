#include "http/twin.h"

#include <dlfcn.h>
#include <gnutls/gnutls.h>
#include <pthread.h>
#include <string.h>

size_t twin_head(const void *bytes, size_t size) {
  static const char START[] = "HTTP/1.", END[] = "\r\n\r\n";
  const char *first = bytes;
  size_t half = size / 2, start = sizeof START - 1, end = sizeof END - 1;
  return size % 2 == 0 && half >= start + end && memcmp(first, START, start) == 0 &&
                 memcmp(first + half - end, END, end) == 0 && memcmp(first, first + half, half) == 0
             ? half
             : 0;
}

typedef ssize_t sender(gnutls_session_t, const void *, size_t);
static sender *next_send;

static void find_next(void) {
  void *found = dlsym(RTLD_NEXT, "gnutls_record_send");
  memcpy(&next_send, &found, sizeof found);
}

/* In place of GnuTLS's. What it skips counts as sent. */
ssize_t gnutls_record_send(gnutls_session_t session, const void *bytes, size_t size) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  size_t skipped = bytes ? twin_head(bytes, size) : 0;
  pthread_once(&once, find_next);
  ssize_t sent = next_send(session, bytes ? (const char *)bytes + skipped : NULL, size - skipped);
  return sent > 0 ? sent + (ssize_t)skipped : sent;
}
