/* Limits. Both the decoded size and the size on the wire count against the limit of the route. Beyond the first
 * MEBIBYTE the decoded size may be at most max-ratio times the size on the wire, so that a decompression bomb is
 * refused early. All decoders together may hold decode-memory bytes, and bodies and decoders what held.h allows; a body
 * that would exceed either gets 503.
 *
 * libmicrohttpd accepts a response only before the first byte of a body or after its last one. So the rest of a
 * refused body is read and dropped. After DROP_MOST bytes the refusal is written to the socket directly, past the
 * library, and the connection closes. Over TLS the connection then closes without a response.
 */
#include "http/body.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>

#include "metrics.h"

enum { MEBIBYTE = 1 << 20, DROP_MOST = 64 << 20 };
#define BODIES_HELD                                                                                               \
  "The server holds as many bytes of requests and answers as it may, or this caller its part of them; try again " \
  "soon, and send less at once."

static int64_t limit_of(const request *r) {
  const config *options = r->srv->options;
  return r->route->body == ROUTE_JSON_BODY || is_fetch(r) ? options->max_json : options->max_body;
}

static void refuse_size(request *r) {
  api_problem problem = {0};
  long long most = (long long)limit_of(r);
  api_refuse(&problem, "too-large", "The%s body has more than %lld bytes, the limit of this route. Send a smaller one.",
             r->decoder ? " decompressed" : "", most);
  api_json_member_integer(&problem.facts, "limit", most);
  reply_problem(r, &problem);
}

/* Updates the counts of memory; 0 with a refusal if decoders or requests together hold too much. */
static int account(request *r) {
  int64_t now = r->decoder ? (int64_t)decoder_memory(r->decoder) : 0, more = now - r->decoder_bytes;
  int64_t all = __atomic_add_fetch(&r->srv->decoding, more, __ATOMIC_RELAXED);
  r->decoder_bytes = now;
  if (more > 0 && all > r->srv->options->decode_memory) {
    reply_refuse(r, "unavailable",
                 "The server is decompressing too many bodies; try again soon, or send the body uncompressed.");
    return 0;
  }
  if (!request_holds(r, &r->body_bytes, now + (int64_t)r->body.capacity)) {
    reply_refuse(r, "unavailable", BODIES_HELD);
    return 0;
  }
  return 1;
}

/* A form would have to be taken apart; a body that is the file itself streams to the disk as it is. */
static void refuse_form(request *r) {
  if (r->route->body == ROUTE_MESH_BODY) {
    reply_refuse(
        r, "unsupported-media-type",
        "A form cannot be uploaded. Send the bytes of the file as the body, and name, format and repair in the "
        "query: curl --data-binary @FILE 'URL/v1/meshes?name=NAME', or fetch(url, {method: 'POST', body: file}).");
  } else {
    reply_refuse(r, "unsupported-media-type",
                 "A form cannot be read. Send the JSON as the body, with Content-Type: application/json.");
  }
}

void body_begin(request *r) {
  const char *type = header_of(r, "Content-Type");
  if (type && strncasecmp(type, "multipart/", 10) == 0) {
    refuse_form(r);
    return;
  }
  coding which = coding_of(header_of(r, "Content-Encoding"));
  if (which != CODING_NONE) {
    r->decoder = decoder_create(which);
    if (!r->decoder) {
      reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
      return;
    }
    if (!account(r)) {
      body_free(r);
      return;
    }
  }
  if (r->route->id == ROUTE_MESH_UPLOAD && !is_fetch(r)) {
    handle_mesh_begin(r);
  }
}

/* Takes decoded bytes; 0 if they were refused. */
static int take_plain(void *user, const char *bytes, size_t size) {
  request *r = user;
  r->received += (int64_t)size;
  if (r->received > limit_of(r)) {
    refuse_size(r);
  } else if (r->decoder && r->received > MEBIBYTE && r->received / r->srv->options->max_ratio >= r->wire) {
    api_problem problem = {0};
    api_refuse(&problem, "too-large", "The body decompresses to more than %lld times its size; send it uncompressed.",
               (long long)r->srv->options->max_ratio);
    api_json_member_integer(&problem.facts, "ratio_limit", r->srv->options->max_ratio);
    reply_problem(r, &problem);
  } else if (r->route->body == ROUTE_MESH_BODY && !is_fetch(r)) {
    handle_mesh_bytes(r, bytes, size);
  } else {
    const size_t before = r->body.capacity;
    api_text_append(&r->body, bytes, size);
    if (r->body.capacity > before) {
      account(r);
    }
  }
  return r->response == NULL;
}

static void refuse_coding(request *r, const char *why) {
  api_problem problem = {0};
  api_refuse(&problem, "malformed-encoding",
             "The body cannot be decompressed: %s. Compress it again, or send it as it is.", why);
  api_json_member_integer(&problem.facts, "offset", r->wire);
  reply_problem(r, &problem);
}

static void unpack(request *r, const char *bytes, size_t size) {
  switch (decoder_feed(r->decoder, bytes, size, take_plain, r)) {
    case DECODE_BROKEN:
      refuse_coding(r, "it does not match its Content-Encoding, or was damaged on the way");
      break;
    case DECODE_WINDOW:
      refuse_coding(r, "it needs a window of more than 8 MB (zstd without --long or --ultra needs less)");
      break;
    case DECODE_NO_MEMORY:
      reply_refuse(r, "no-memory", "The server has no memory left; try again later.");
      break;
    default:
      if (!r->response) {
        account(r);
      }
  }
}

/* Writes the refusal to the socket past the library, for a client that never stops sending. */
static void write_refusal(request *r) {
  const union MHD_ConnectionInfo *fd = MHD_get_connection_info(r->connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  char head[256];
  if (!fd || r->srv->options->tls_key[0] || !r->refusal.data) {
    return;
  }
  int n = snprintf(head, sizeof head,
                   "HTTP/1.1 %u Refused\r\nContent-Type: application/problem+json\r\nCache-Control: no-store\r\n"
                   "X-Request-Id: %s\r\nConnection: close\r\nContent-Length: %zu\r\n\r\n",
                   r->status, r->number, r->refusal.size);
  struct iovec parts[2] = {{head, (size_t)n}, {r->refusal.data, r->refusal.size}};
  struct msghdr message = {.msg_iov = parts, .msg_iovlen = 2};
  r->closes = sendmsg(fd->connect_fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL) >
              0; /* a few hundred bytes: sent whole or not at all */
}

int body_take(request *r, const char *bytes, size_t size) {
  r->wire += (int64_t)size;
  if (!r->response) {
    if (r->decoder && r->wire > limit_of(r)) {
      refuse_size(r); /* compressed data without output would never reach the limit on the decoded size */
    } else if (r->decoder) {
      unpack(r, bytes, size);
    } else {
      take_plain(r, bytes, size);
    }
    if (r->response) {
      upload_abandon(r);
      body_free(r);
    }
    return 1;
  }
  r->dropped += (int64_t)size;
  if (r->dropped > DROP_MOST) {
    write_refusal(r);
    return 0;
  }
  return 1;
}

int body_end(request *r) {
  metrics_bytes(r->wire, 0);
  if (r->decoder && !r->response && !decoder_complete(r->decoder)) {
    refuse_coding(r, "its end is missing");
  }
  if (r->decoder) {
    decoder_free(r->decoder); /* frees its window while the request waits */
    r->decoder = NULL;
    account(r);
  }
  return r->response == NULL;
}

void body_free(request *r) {
  decoder_free(r->decoder);
  r->decoder = NULL;
  api_text_free(&r->body);
  account(r);
}
