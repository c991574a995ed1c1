#include "http.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>
#include <unistd.h>

#include "terminal.h"
#include "text.h"

enum {
  CONNECT_SECONDS = 10,
  STALL_SECONDS = 120,   /* a transfer that moves no byte for this long fails */
  PATIENCE_SECONDS = 60, /* how long a patient request waits for a daemon that does not respond */
  RETRIES = 8,           /* after responses with Retry-After */
  RETRY_AFTER_MOST = 15, /* seconds; a longer Retry-After ends the request */
};

typedef struct transfer {
  cli *c;
  const cli_request *request;
  cli_reply *reply;
  size_t room;
  int failed_write;
} transfer;

static size_t on_body(char *bytes, size_t size, size_t count, void *user) {
  transfer *t = user;
  size_t length = size * count;
  long status = 0;
  curl_easy_getinfo(t->c->curl, CURLINFO_RESPONSE_CODE, &status);
  if (t->request->download && status >= 200 && status < 300) {
    t->failed_write = fwrite(bytes, 1, length, t->request->download) != length;
    return t->failed_write ? 0 : length;
  }
  if (t->reply->size + length + 1 > t->room) {
    size_t room = 2 * (t->reply->size + length + 1);
    char *more = realloc(t->reply->body, room);
    if (!more) {
      return 0;
    }
    t->reply->body = more;
    t->room = room;
  }
  memcpy(t->reply->body + t->reply->size, bytes, length);
  t->reply->size += length;
  t->reply->body[t->reply->size] = 0;
  return length;
}

/* The value of a header line with this name, which the caller frees; NULL for other lines. */
static char *header_value(const char *line, size_t length, const char *name) {
  size_t n = strlen(name);
  if (length <= n || strncasecmp(line, name, n) != 0 || line[n] != ':') {
    return NULL;
  }
  const char *begin = line + n + 1, *end = line + length;
  while (begin < end && (*begin == ' ' || *begin == '\t')) {
    begin++;
  }
  while (end > begin && (end[-1] == '\r' || end[-1] == '\n' || end[-1] == ' ')) {
    end--;
  }
  return cli_text("%.*s", (int)(end - begin), begin);
}

static size_t on_header(char *line, size_t size, size_t count, void *user) {
  transfer *t = user;
  char *location = header_value(line, size * count, "location");
  char *after = header_value(line, size * count, "retry-after");
  if (location) {
    free(t->reply->location);
    t->reply->location = location;
  }
  if (after) {
    if (!cli_whole_number(after, 0, 86400, &t->reply->retry_after)) {
      t->reply->retry_after = -1;
    }
    free(after);
  }
  return size * count;
}

static size_t on_upload(char *out, size_t size, size_t count, void *user) {
  FILE *file = user;
  size_t got = fread(out, 1, size * count, file);
  return got == 0 && ferror(file) ? CURL_READFUNC_ABORT : got;
}

static int on_seek(void *user, curl_off_t offset, int origin) {
  return fseeko(user, (off_t)offset, origin) == 0 ? CURL_SEEKFUNC_OK : CURL_SEEKFUNC_FAIL;
}

static int on_progress(void *user, curl_off_t down_total, curl_off_t down, curl_off_t up_total, curl_off_t up) {
  transfer *t = user;
  if (t->request->label && t->request->upload && up_total > 0) {
    cli_bar(t->c, t->request->label, (double)up / (double)up_total);
  } else if (t->request->label && t->request->download && down_total > 0) {
    cli_bar(t->c, t->request->label, (double)down / (double)down_total);
  }
  return 0;
}

static struct curl_slist *headers_of(const cli *c, const cli_request *request) {
  struct curl_slist *list = curl_slist_append(NULL, "User-Agent: orbmorph/" CLI_VERSION);
  if (request->json) {
    list = curl_slist_append(list, "Content-Type: application/json");
  } else if (request->upload) {
    list = curl_slist_append(list, "Content-Type: application/octet-stream");
  }
  if (c->token) {
    char *line = cli_text("Authorization: Bearer %s", c->token);
    list = curl_slist_append(list, line);
    free(line);
  }
  return list;
}

static void set_body(CURL *curl, const cli_request *request) {
  if (request->upload) {
    curl_easy_setopt(curl, CURLOPT_POST, 1L);
    curl_easy_setopt(curl, CURLOPT_POSTFIELDS, NULL);
    curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE_LARGE, request->upload_size);
    curl_easy_setopt(curl, CURLOPT_READFUNCTION, on_upload);
    curl_easy_setopt(curl, CURLOPT_READDATA, request->upload);
    curl_easy_setopt(curl, CURLOPT_SEEKFUNCTION, on_seek);
    curl_easy_setopt(curl, CURLOPT_SEEKDATA, request->upload);
  } else if (request->json) {
    curl_easy_setopt(curl, CURLOPT_POST, 1L);
    curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE, (long)strlen(request->json));
    curl_easy_setopt(curl, CURLOPT_POSTFIELDS, request->json);
  }
}

/* The path of a server unix:PATH; NULL for a URL. */
static const char *socket_of(const cli *c) {
  return !strncmp(c->server, "unix:", 5) ? c->server + 5 : NULL;
}

static char *url_of(const cli *c, const char *path) {
  size_t length = strlen(c->server);
  return socket_of(c) ? cli_text("http://localhost%s", path)
                      : cli_text("%.*s%s", (int)(length - (c->server[length - 1] == '/')), c->server, path);
}

static CURLcode perform(transfer *t, const char *url) {
  CURL *curl = t->c->curl;
  curl_easy_reset(curl);
  if (socket_of(t->c)) {
    curl_easy_setopt(curl, CURLOPT_UNIX_SOCKET_PATH, socket_of(t->c));
    curl_easy_setopt(curl, CURLOPT_PROXY, ""); /* whatever the environment says */
  }
  struct curl_slist *headers = headers_of(t->c, t->request);
  curl_easy_setopt(curl, CURLOPT_URL, url);
  curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT, (long)CONNECT_SECONDS);
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_LIMIT, 1L);
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_TIME, (long)STALL_SECONDS);
  curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, on_body);
  curl_easy_setopt(curl, CURLOPT_WRITEDATA, t);
  curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, on_header);
  curl_easy_setopt(curl, CURLOPT_HEADERDATA, t);
  curl_easy_setopt(curl, CURLOPT_NOPROGRESS, t->c->bar && t->request->label ? 0L : 1L);
  curl_easy_setopt(curl, CURLOPT_XFERINFOFUNCTION, on_progress);
  curl_easy_setopt(curl, CURLOPT_XFERINFODATA, t);
  set_body(curl, t->request);
  curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, t->request->method);
  CURLcode code = curl_easy_perform(curl);
  curl_slist_free_all(headers);
  return code;
}

static int rewind_all(const cli_request *request) {
  if (request->upload && fseeko(request->upload, 0, SEEK_SET) != 0) {
    return 0;
  }
  if (request->download) {
    return fseeko(request->download, 0, SEEK_SET) == 0 && ftruncate(fileno(request->download), 0) == 0;
  }
  return 1;
}

/* The daemon may refuse a body before it has read all of it; then sending fails, but the response is there. */
static int answered(CURLcode code, const cli_reply *reply) {
  return code == CURLE_OK || (code == CURLE_SEND_ERROR && reply->status >= 400);
}

int cli_send(cli *c, const cli_request *request, cli_reply *out) {
  char *url = url_of(c, request->path);
  time_t give_up = time(NULL) + PATIENCE_SECONDS;
  int rc = CLI_UNREACHABLE;
  for (int attempt = 0;; attempt++) {
    memset(out, 0, sizeof *out);
    out->retry_after = -1;
    transfer t = {c, request, out, 0, 0};
    CURLcode code = perform(&t, url);
    curl_easy_getinfo(c->curl, CURLINFO_RESPONSE_CODE, &out->status);
    if (answered(code, out)) {
      int busy = (out->status == 429 || out->status == 503) && out->retry_after >= 0;
      if (busy && out->retry_after <= RETRY_AFTER_MOST && attempt < RETRIES && rewind_all(request)) {
        unsigned wait = (unsigned)(out->retry_after ? out->retry_after : 1);
        cli_reply_free(out);
        sleep(wait);
        continue;
      }
      rc = CLI_DONE;
      break;
    }
    if (t.failed_write) {
      cli_error(c, "cannot write the downloaded file; the disk may be full");
      rc = CLI_USAGE;
      break;
    }
    int may_repeat = request->patient && time(NULL) < give_up && code != CURLE_URL_MALFORMAT &&
                     code != CURLE_UNSUPPORTED_PROTOCOL && rewind_all(request);
    if (!may_repeat) {
      cli_error(c, "%s: %s\nIs the daemon running there? Set its address with --server or ORBMORPH_SERVER.", c->server,
                curl_easy_strerror(code));
      break;
    }
    cli_reply_free(out);
    usleep(300 * 1000);
  }
  if (rc == CLI_DONE && out->body) {
    out->json = cJSON_ParseWithLength(out->body, out->size);
  }
  free(url);
  return rc;
}

int cli_get(cli *c, const char *path, cli_reply *out) {
  cli_request request = {.method = "GET", .path = path};
  return cli_send(c, &request, out);
}

void cli_reply_free(cli_reply *reply) {
  free(reply->body);
  free(reply->location);
  cJSON_Delete(reply->json);
  memset(reply, 0, sizeof *reply);
}

int cli_ok(const cli_reply *reply) {
  return reply->status >= 200 && reply->status < 300;
}
