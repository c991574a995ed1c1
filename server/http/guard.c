/* Refuses ambiguous headers before anything else runs: forms that a proxy and this server could read differently
 * (request smuggling). */
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "http/http.h"

typedef struct seen {
  int hosts, lengths, encodings, codings, bad_name, bad_value, bad_length, bad_encoding;
  const char *length;
  const char *head, *head_end; /* the lines of the request, up to its body */
  const char *value_end;       /* where the last value ends; NULL: not known */
} seen;

/* Of CR and LF, which libmicrohttpd overwrites with zeros. */
enum { LINE_END = 2 };

/* The next line begins here. A value ends for libmicrohttpd at its first NUL: then more bytes follow than the end of a
 * line has. A NUL before a bare line feed looks like CR and LF. */
static void look_between(seen *s, const char *next, int line_ends) {
  s->bad_value |= s->value_end && next - s->value_end > line_ends * LINE_END;
}

static int is_in_head(const seen *s, const char *at) {
  return at && at >= s->head && at < s->head_end;
}

static enum MHD_Result look(void *user, enum MHD_ValueKind kind, const char *name, const char *value) {
  seen *s = user;
  (void)kind;
  const int is_whole = is_in_head(s, name); /* else the header is folded: its name was copied, and got the next line */
  if (is_whole) {
    look_between(s, name, 1);
  }
  s->value_end = is_whole && is_in_head(s, value) ? value + strlen(value) : NULL;
  for (const unsigned char *c = (const unsigned char *)name; *c; c++) {
    s->bad_name |= *c <= ' ' || *c == 0x7f;
  }
  if (strcasecmp(name, "Host") == 0) {
    s->hosts++;
  } else if (strcasecmp(name, "Content-Length") == 0) {
    s->lengths++;
    s->length = value;
    s->bad_length |= !value || !*value || value[strspn(value, "0123456789")] != 0 || strlen(value) > 18;
  } else if (strcasecmp(name, "Transfer-Encoding") == 0) {
    s->encodings++;
    s->bad_encoding |= !value || strcasecmp(value, "chunked") != 0;
  } else if (strcasecmp(name, "Content-Encoding") == 0) {
    s->codings++;
  }
  return MHD_YES;
}

static int bad(api_problem *problem, const char *why) {
  return api_refuse(problem, "bad-request", "%s", why);
}

int is_fetch(const request *r) {
  static const char json[] = "application/json";
  const char *type = r->route->id == ROUTE_MESH_UPLOAD ? header_of(r, "Content-Type") : NULL;
  size_t length = type ? strcspn(type, "; \t") : 0;
  return length == sizeof json - 1 && strncasecmp(type, json, length) == 0;
}

static int check_length(request *r, const seen *s, api_problem *problem) {
  const config *options = r->srv->options;
  route_body kind = r->route ? r->route->body : ROUTE_NO_BODY;
  int64_t length = s->lengths ? strtoll(s->length, NULL, 10) : 0;
  if (kind == ROUTE_NO_BODY) {
    return r->has_body && r->route ? bad(problem, "This route takes no body.") : 1;
  }
  if (!s->lengths && !s->encodings) {
    return api_refuse(problem, "length-required",
                      "The request has neither Content-Length nor chunked Transfer-Encoding. Send one of them.");
  }
  int64_t most = kind == ROUTE_JSON_BODY || is_fetch(r) ? options->max_json : options->max_body;
  if (length > most) {
    api_refuse(problem, "too-large", "The body has %lld bytes; the limit of this route is %lld. Send a smaller one.",
               (long long)length, (long long)most);
    api_json_member_integer(&problem->facts, "limit", most);
    return 0;
  }
  if (s->codings > 1 || coding_of(header_of(r, "Content-Encoding")) == CODING_UNKNOWN) {
    return api_refuse(problem, "unsupported-encoding",
                      "Content-Encoding names a coding other than gzip or zstd, or several codings. Send the body "
                      "compressed once, or not at all.");
  }
  return 1;
}

/* The method is the first word of the head, in the memory in which the library took its lines apart. */
static void look_at_all(const request *r, seen *s) {
  const union MHD_ConnectionInfo *info =
      MHD_get_connection_info(r->connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
  s->head = r->method;
  s->head_end = r->method + (info ? info->header_size : 0);
  MHD_get_connection_values(r->connection, MHD_HEADER_KIND, look, s);
  look_between(s, s->head_end, 2); /* an empty line follows the last one */
}

int guard_headers(request *r, const char *version, api_problem *problem) {
  seen s = {0};
  look_at_all(r, &s);
  r->has_body = s.encodings || (s.lengths && !s.bad_length && strtoll(s.length, NULL, 10) > 0);
  if (s.bad_name) {
    return bad(problem, "A header name contains a space or control character.");
  }
  if (s.bad_value) {
    r->has_body = 1;
    return bad(problem, "A header contains a NUL character.");
  }
  if (s.hosts > 1 || (s.hosts == 0 && strcmp(version, "HTTP/1.0") != 0)) {
    return bad(problem, "A request must have exactly one Host header.");
  }
  if (s.bad_length || s.lengths > 1) {
    r->has_body = 1;
    return bad(problem, "Content-Length must appear once and consist of digits.");
  }
  if (s.bad_encoding || s.encodings > 1) {
    return bad(problem, "Transfer-Encoding must appear once, as chunked.");
  }
  if (s.lengths && s.encodings) {
    return bad(problem, "A request must not have both Content-Length and Transfer-Encoding.");
  }
  return check_length(r, &s, problem);
}

const char *header_of(const request *r, const char *name) {
  return MHD_lookup_connection_value(r->connection, MHD_HEADER_KIND, name);
}

typedef struct lines {
  const char *name, **out;
  int count;
} lines;

static enum MHD_Result gather(void *user, enum MHD_ValueKind kind, const char *name, const char *value) {
  lines *found = user;
  (void)kind;
  if (value && strcasecmp(name, found->name) == 0) {
    found->out[found->count++] = value;
  }
  return found->count < HEADER_LINES ? MHD_YES : MHD_NO;
}

int header_lines(const request *r, const char *name, const char *out[HEADER_LINES]) {
  lines found = {.name = name, .out = out};
  MHD_get_connection_values(r->connection, MHD_HEADER_KIND, gather, &found);
  return found.count;
}
