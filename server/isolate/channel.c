#include "isolate/channel.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

typedef struct head {
  uint32_t version, type;
  uint64_t size;
} head;

/* After a call that failed. */
static channel_result closed_or_failed(void) {
  return errno == EPIPE || errno == ECONNRESET ? CHANNEL_CLOSED : CHANNEL_FAILED;
}

static channel_result wait_for(int fd, short events, channel_continues continues, void *user) {
  while (!continues || continues(user)) {
    struct pollfd one = {.fd = fd, .events = events};
    int ready = poll(&one, 1, continues ? CHANNEL_LOOK_MS : -1);
    if (ready > 0) {
      return CHANNEL_OK;
    }
    if (ready < 0 && errno != EINTR) {
      return CHANNEL_FAILED;
    }
  }
  return CHANNEL_STOPPED;
}

/* Sends what the socket takes now; moves the parts on. *full: it took nothing. */
static channel_result send_some(int fd, struct msghdr *message, int *passed, int *full) {
  char control[CMSG_SPACE(sizeof(int))] = {0};
  message->msg_control = NULL;
  message->msg_controllen = 0;
  if (*passed >= 0) {
    message->msg_control = control;
    message->msg_controllen = sizeof control;
    struct cmsghdr *item = CMSG_FIRSTHDR(message);
    item->cmsg_level = SOL_SOCKET;
    item->cmsg_type = SCM_RIGHTS;
    item->cmsg_len = CMSG_LEN(sizeof(int));
    memcpy(CMSG_DATA(item), passed, sizeof(int));
  }
  ssize_t sent = sendmsg(fd, message, MSG_NOSIGNAL | MSG_DONTWAIT);
  *full = sent < 0;
  if (sent < 0) {
    return errno == EINTR || errno == EAGAIN ? CHANNEL_OK : closed_or_failed();
  }
  *passed = -1; /* it went with the first byte */
  for (size_t left = (size_t)sent; left > 0 && message->msg_iovlen > 0;) {
    struct iovec *part = message->msg_iov;
    size_t taken = part->iov_len < left ? part->iov_len : left;
    part->iov_base = (char *)part->iov_base + taken;
    part->iov_len -= taken;
    left -= taken;
    if (part->iov_len == 0) {
      message->msg_iov++;
      message->msg_iovlen--;
    }
  }
  return CHANNEL_OK;
}

channel_result channel_send(int fd, frame_type type, const struct iovec *parts, int count, int passed,
                            channel_continues continues, void *user) {
  head begin = {.version = CHANNEL_VERSION, .type = (uint32_t)type};
  struct iovec all[1 + CHANNEL_PARTS] = {{&begin, sizeof begin}};
  int used = 1;
  for (int i = 0; i < count && i < CHANNEL_PARTS; i++) {
    begin.size += parts[i].iov_len;
    if (parts[i].iov_len > 0) {
      all[used++] = parts[i];
    }
  }
  struct msghdr message = {.msg_iov = all, .msg_iovlen = (size_t)used};
  channel_result result = begin.size <= CHANNEL_MOST ? CHANNEL_OK : CHANNEL_BAD;
  for (int full = 0; result == CHANNEL_OK && message.msg_iovlen > 0;) {
    result = full ? wait_for(fd, POLLOUT, continues, user) : CHANNEL_OK;
    result = result == CHANNEL_OK ? send_some(fd, &message, &passed, &full) : result;
  }
  return result;
}

/* Keeps the first descriptor that arrives and closes all others. */
static void take_passed(struct msghdr *message, int *passed) {
  for (struct cmsghdr *item = CMSG_FIRSTHDR(message); item; item = CMSG_NXTHDR(message, item)) {
    if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SCM_RIGHTS) {
      continue;
    }
    for (size_t i = 0; CMSG_LEN((i + 1) * sizeof(int)) <= item->cmsg_len; i++) {
      int fd;
      memcpy(&fd, CMSG_DATA(item) + i * sizeof fd, sizeof fd);
      if (*passed < 0) {
        *passed = fd;
      } else {
        close(fd);
      }
    }
  }
}

/* parts: of the frame so far. */
static channel_result receive_all(int fd, void *to, size_t size, int *passed, int *parts, channel_continues continues,
                                  void *user) {
  for (size_t done = 0; done < size;) {
    if (++*parts > CHANNEL_UNASKED && continues && !continues(user)) {
      return CHANNEL_STOPPED;
    }
    char control[CMSG_SPACE(4 * sizeof(int))];
    struct iovec part = {(char *)to + done, size - done};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    ssize_t got = recvmsg(fd, &message, (continues ? MSG_DONTWAIT : 0) | MSG_CMSG_CLOEXEC);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
      channel_result ready = errno == EAGAIN ? wait_for(fd, POLLIN, continues, user) : CHANNEL_OK;
      if (ready != CHANNEL_OK) {
        return ready;
      }
      continue;
    }
    if (got <= 0) {
      return got == 0 ? CHANNEL_CLOSED : closed_or_failed();
    }
    take_passed(&message, passed);
    done += (size_t)got;
  }
  return CHANNEL_OK;
}

channel_result channel_receive(int fd, size_t most, frame *out, channel_continues continues, void *user) {
  head begin;
  int parts = 0;
  *out = (frame){.fd = -1};
  channel_result result = receive_all(fd, &begin, sizeof begin, &out->fd, &parts, continues, user);
  if (result == CHANNEL_OK &&
      (begin.version != CHANNEL_VERSION || begin.type == 0 || begin.type >= FRAME_TYPES || begin.size > most)) {
    result = CHANNEL_BAD;
  }
  if (result == CHANNEL_OK && !(out->bytes = malloc(begin.size + 1))) {
    result = CHANNEL_FAILED;
  }
  if (result == CHANNEL_OK) {
    out->type = (frame_type)begin.type;
    out->size = begin.size;
    out->bytes[begin.size] = 0;
    result = receive_all(fd, out->bytes, begin.size, &out->fd, &parts, continues, user);
  }
  if (result != CHANNEL_OK) {
    frame_free(out);
  }
  return result;
}

void frame_free(frame *f) {
  if (f->fd >= 0) {
    close(f->fd);
  }
  free(f->bytes);
  *f = (frame){.fd = -1};
}
