#include "http/target.h"

#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

#include "api/problem.h"

static void write_refusal(int fd, const char *number) {
  char head[256];
  api_problem problem = {0};
  api_text body = {0};
  api_refuse(&problem, "uri-too-long", "The query has more than %d parameters.", TARGET_PARAMETERS);
  api_problem_write(&problem, &body);
  int n = snprintf(head, sizeof head,
                   "HTTP/1.1 414 URI Too Long\r\nContent-Type: application/problem+json\r\nCache-Control: no-store\r\n"
                   "X-Request-Id: %s\r\nConnection: close\r\nContent-Length: %zu\r\n\r\n",
                   number, body.size);
  struct iovec parts[2] = {{head, (size_t)n}, {body.data, body.size}};
  struct msghdr message = {.msg_iov = parts, .msg_iovlen = 2};
  if (!body.failed) {
    ssize_t sent = sendmsg(fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL); /* a few hundred bytes: whole or not at all */
    (void)sent;
  }
  api_text_free(&body);
  api_problem_free(&problem);
}

int target_refused(const char *target, const char *number, int tls, struct MHD_Connection *connection) {
  int parameters = 0;
  for (const char *at = strchr(target, '?'); at; at = strchr(at + 1, '&')) {
    parameters++;
  }
  if (parameters <= TARGET_PARAMETERS) {
    return 0;
  }
  const union MHD_ConnectionInfo *fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  if (fd && !tls) {
    write_refusal(fd->connect_fd, number);
  }
  if (fd) {
    shutdown(fd->connect_fd, SHUT_WR); /* what the library would send fails */
  }
  return 1;
}
