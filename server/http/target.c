#include "http/target.h"

#include <gnutls/gnutls.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

#include "api/problem.h"

/* RECORD: of a parameter, header or cookie, beside its text. ANSWER: the largest head of an answer. */
enum { RECORD = 64, ANSWER = 2048 };

/* A few hundred bytes: whole or not at all. */
static void write_bytes(const char *bytes, size_t size, int fd, gnutls_session_t session) {
  if (session) {
    gnutls_record_send(session, bytes, size);
    gnutls_bye(session, GNUTLS_SHUT_WR);
  } else {
    ssize_t sent = send(fd, bytes, size, MSG_DONTWAIT | MSG_NOSIGNAL);
    (void)sent;
  }
}

/* status: with further headers, if any. */
static void refuse(struct MHD_Connection *connection, const char *number, const char *status, api_problem *problem) {
  const union MHD_ConnectionInfo *fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD),
                                 *tls = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);
  api_text body = {0}, all = {0};
  api_problem_write(problem, &body);
  api_text_printf(&all,
                  "HTTP/1.1 %s\r\nContent-Type: application/problem+json\r\nCache-Control: no-store\r\n"
                  "X-Request-Id: %s\r\nConnection: close\r\nContent-Length: %zu\r\n\r\n",
                  status, number, body.size);
  api_text_append(&all, body.data ? body.data : "", body.size);
  if (fd && !body.failed && !all.failed) {
    write_bytes(all.data, all.size, fd->connect_fd, tls ? tls->tls_session : NULL);
  }
  if (fd) {
    shutdown(fd->connect_fd, SHUT_WR); /* so that nothing that the library sends later reaches the client */
  }
  api_text_free(&all);
  api_text_free(&body);
  api_problem_free(problem);
}

int target_refused(const char *target, const char *number, struct MHD_Connection *connection) {
  size_t parameters = 0, size = strlen(target);
  api_problem problem = {0};
  for (const char *at = strchr(target, '?'); at; at = strchr(at + 1, '&')) {
    parameters++;
  }
  if (parameters <= TARGET_PARAMETERS && size + RECORD * parameters <= TARGET_BYTES) {
    return 0;
  }
  if (parameters > TARGET_PARAMETERS) {
    api_refuse(&problem, "uri-too-long", "The query has more than %d parameters. Send at most that many.",
               TARGET_PARAMETERS);
  } else {
    api_refuse(&problem, "uri-too-long",
               "The target has %zu bytes and %zu parameters; bytes and %d for each parameter must be at most %d. "
               "Send long requests as JSON, and landmarks as a resource (POST /v1/landmarks).",
               size, parameters, RECORD, TARGET_BYTES);
  }
  refuse(connection, number, "414 URI Too Long", &problem);
  return 1;
}

void target_lacks_room(const char *number, struct MHD_Connection *connection) {
  api_problem problem = {0};
  api_refuse(&problem, "unavailable",
             "The server holds as many bytes of requests and answers as it may, or this caller its part of them; try "
             "again soon, or with a shorter target.");
  refuse(connection, number, "503 Service Unavailable\r\nRetry-After: 2", &problem);
}

typedef struct taken {
  size_t bytes, records;
} taken;

/* What the library keeps of one parameter, header or cookie. Cookies are copied before it takes them apart. */
static enum MHD_Result take_one(void *user, enum MHD_ValueKind kind, const char *name, const char *value) {
  taken *t = user;
  t->records++;
  t->bytes += RECORD + (kind == MHD_COOKIE_KIND ? strlen(name) + (value ? strlen(value) : 0) + 2 : 0);
  return MHD_YES;
}

int target_headers_refused(const char *number, struct MHD_Connection *connection) {
  const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
  api_problem problem = {0};
  taken all = {0};
  if (!info) {
    return 0;
  }
  /* Always counted: 180 lines of 26 bytes fill the memory, so the size alone says little. */
  MHD_get_connection_values(connection, MHD_HEADER_KIND | MHD_COOKIE_KIND | MHD_GET_ARGUMENT_KIND, take_one, &all);
  if (info->header_size + all.bytes + ANSWER <= TARGET_MEMORY) {
    return 0;
  }
  api_refuse(&problem, "headers-too-large",
             "The headers have %zu bytes and %zu lines, cookies and parameters; shorten them.", info->header_size,
             all.records);
  refuse(connection, number, "431 Request Header Fields Too Large", &problem);
  return 1;
}
