#include "store/s3.h"

#include <curl/curl.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "orbmorph/context.h"

enum {
  CONNECT_MS = 5000,
  SLOW_BYTES = 1024, /* a second, over SLOW_SECONDS: a store that is slower than that hangs */
  SLOW_SECONDS = 15,
  SMALL_MS = 30000,    /* limit of a request that has no file */
  PAUSE_MS = 100,      /* mean of the first pause between tries; each further one is twice as long */
  IDLE_MOST = 16,      /* connections kept open */
  TEXT_MOST = 4 << 20, /* a list of 1,000 names takes 0.4 MB */
  SKEW_SECONDS = 60,   /* S3 accepts signatures that differ from its time by up to 15 minutes */
};

struct s3 {
  s3_options options;
  pthread_mutex_t lock;
  CURL *idle[IDLE_MOST]; /* handles, whose connections stay open */
  int idles;
  int64_t date, date_ms; /* of S3's last answer, a Unix time; when it came, by orb_clock_ms(). 0: none came */
};

/* One try. */
typedef struct transfer {
  CURL *curl;
  const s3_request *request;
  s3_answer *out;
  uint64_t sent, taken;
  size_t room; /* of out->text */
  int no_space;
  curl_socket_t socket; /* of a connection that was used before; CURL_SOCKET_BAD: it is new */
  char date[64];        /* of the answer */
  int64_t signed_at;    /* of s3_clock() */
} transfer;

s3 *s3_open(const s3_options *options) {
  s3 *store = calloc(1, sizeof *store);
  if (!store || curl_global_init(CURL_GLOBAL_DEFAULT) != CURLE_OK) {
    free(store);
    return NULL;
  }
  store->options = *options;
  pthread_mutex_init(&store->lock, NULL);
  return store;
}

void s3_close(s3 *store) {
  if (!store) {
    return;
  }
  while (store->idles) {
    curl_easy_cleanup(store->idle[--store->idles]);
  }
  pthread_mutex_destroy(&store->lock);
  sodium_memzero(&store->options.keys, sizeof store->options.keys);
  free(store);
}

void s3_use_keys(s3 *store, const s3_keys *keys) {
  pthread_mutex_lock(&store->lock);
  store->options.keys = *keys;
  pthread_mutex_unlock(&store->lock);
}

static s3_keys keys_of(s3 *store) {
  pthread_mutex_lock(&store->lock);
  s3_keys keys = store->options.keys;
  pthread_mutex_unlock(&store->lock);
  return keys;
}

static CURL *take_handle(s3 *store) {
  CURL *curl = NULL;
  pthread_mutex_lock(&store->lock);
  if (store->idles) {
    curl = store->idle[--store->idles];
  }
  pthread_mutex_unlock(&store->lock);
  if (curl) {
    curl_easy_reset(curl); /* connections stay */
  }
  return curl ? curl : curl_easy_init();
}

static void give_handle(s3 *store, CURL *curl) {
  pthread_mutex_lock(&store->lock);
  if (curl && store->idles < IDLE_MOST) {
    store->idle[store->idles++] = curl;
    curl = NULL;
  }
  pthread_mutex_unlock(&store->lock);
  curl_easy_cleanup(curl);
}

static size_t give_body(char *out, size_t one, size_t size, void *user) {
  transfer *t = user;
  uint64_t left = t->request->size - t->sent;
  ssize_t n;
  size *= one;
  size = left < size ? (size_t)left : size;
  if (t->request->body) {
    memcpy(out, t->request->body + t->sent, size);
    n = (ssize_t)size;
  } else {
    do {
      n = pread(t->request->from, out, size, (off_t)(t->request->offset + t->sent));
    } while (n < 0 && errno == EINTR);
    if (n < 0 || (n == 0 && size)) {
      return CURL_READFUNC_ABORT;
    }
  }
  t->sent += (uint64_t)n;
  return (size_t)n;
}

/* libcurl rewinds to send a body again on a new connection. */
static int seek_body(void *user, curl_off_t offset, int origin) {
  transfer *t = user;
  if (origin != SEEK_SET || offset < 0) {
    return CURL_SEEKFUNC_FAIL;
  }
  t->sent = (uint64_t)offset;
  return CURL_SEEKFUNC_OK;
}

static int keep_text(transfer *t, const char *bytes, size_t size) {
  s3_answer *out = t->out;
  if (t->taken + size + 1 > TEXT_MOST) {
    return 0;
  }
  if (t->taken + size + 1 > t->room) {
    size_t room = 2 * (t->taken + size + 1);
    char *more = realloc(out->text, room);
    if (!more) {
      return 0;
    }
    out->text = more;
    t->room = room;
  }
  memcpy(out->text + t->taken, bytes, size);
  out->text[t->taken + size] = 0;
  return 1;
}

static size_t take_body(char *bytes, size_t one, size_t size, void *user) {
  transfer *t = user;
  long status = 0;
  size *= one;
  curl_easy_getinfo(t->curl, CURLINFO_RESPONSE_CODE, &status);
  if (t->request->to < 0 || status < 200 || status > 299) {
    if (!keep_text(t, bytes, size)) {
      return 0;
    }
    t->taken += size;
    return size;
  }
  for (size_t done = 0; done < size;) {
    ssize_t n = pwrite(t->request->to, bytes + done, size - done, (off_t)(t->taken + done));
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      t->no_space = errno == ENOSPC || errno == EDQUOT || errno == EFBIG;
      return 0;
    }
    done += (size_t)n;
  }
  t->taken += size;
  return size;
}

/* A header's value without spaces around it. 0: another header. */
static int read_header(const char *line, size_t size, const char *name, char *out, size_t room) {
  size_t n = strlen(name);
  if (size <= n || strncasecmp(line, name, n) != 0 || line[n] != ':') {
    return 0;
  }
  line += n + 1;
  size -= n + 1;
  for (; size && (*line == ' ' || *line == '\t'); line++) {
    size--;
  }
  while (size && strchr(" \t\r\n", line[size - 1])) {
    size--;
  }
  if (size < room) {
    memcpy(out, line, size);
    out[size] = 0;
  }
  return 1;
}

/* Acknowledges what has arrived. Some servers, such as Ceph's, send the body after the headers, and Nagle's algorithm
 * holds it back until these are acknowledged. This end would do that 40 ms later, in the hope of data to send along.
 * The first bytes of a new connection are acknowledged at once. */
static void acknowledge(const transfer *t) {
  const int now = 1;
  if (t->socket != CURL_SOCKET_BAD) {
    setsockopt(t->socket, IPPROTO_TCP, TCP_QUICKACK, &now, sizeof now);
  }
}

static size_t take_header(char *line, size_t one, size_t size, void *user) {
  transfer *t = user;
  s3_answer *out = t->out;
  size *= one;
  if (!read_header(line, size, "ETag", out->tag, sizeof out->tag) &&
      !read_header(line, size, "Date", t->date, sizeof t->date)) {
    read_header(line, size, "x-amz-meta-sha256", out->meta, sizeof out->meta);
  }
  if (line[0] == '\r' || line[0] == '\n') { /* the end of the headers */
    acknowledge(t);
  }
  return size;
}

static void note_date(s3 *store, const char *text) {
  int64_t date = *text ? (int64_t)curl_getdate(text, NULL) : -1;
  if (date > 0) {
    pthread_mutex_lock(&store->lock);
    store->date = date;
    store->date_ms = orb_clock_ms();
    pthread_mutex_unlock(&store->lock);
  }
}

int64_t s3_clock(s3 *store) {
  pthread_mutex_lock(&store->lock);
  int64_t now = store->date ? store->date + (orb_clock_ms() - store->date_ms) / 1000 : (int64_t)time(NULL);
  pthread_mutex_unlock(&store->lock);
  return now;
}

static int append(struct curl_slist **list, const char *line) {
  struct curl_slist *more = curl_slist_append(*list, line);
  *list = more ? more : *list;
  return more != NULL;
}

/* The headers, with the signature over all that S3 looks at. now: when the request is signed. */
static int sign(s3 *store, const s3_request *r, const char *path, int64_t now, struct curl_slist **out) {
  if (r->signed_at) { /* the URL is signed */
    return append(out, "expect:");
  }
  static const char empty[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
  const s3_options *o = &store->options;
  const char *sha = r->sha ? r->sha : empty;
  s3_keys keys = keys_of(store);
  const char *token = keys.token;
  char date[S3_DATE], signature[S3_SIGNATURE], line[S3_TOKEN + 64];
  size_t room = S3_TOKEN + S3_HOST + 512;
  char *headers = malloc(room), names[160];
  if (!headers) {
    return 0;
  }
  s3_date((long long)now, date);
  snprintf(names, sizeof names, "host;x-amz-content-sha256;x-amz-date%s%s", r->meta ? ";x-amz-meta-sha256" : "",
           *token ? ";x-amz-security-token" : "");
  int n = snprintf(headers, room, "host:%s\nx-amz-content-sha256:%s\nx-amz-date:%s\n", o->place.host, sha, date);
  if (r->meta) {
    n += snprintf(headers + n, room - (size_t)n, "x-amz-meta-sha256:%s\n", r->meta);
  }
  if (*token) {
    snprintf(headers + n, room - (size_t)n, "x-amz-security-token:%s\n", token);
  }
  const s3_canonical canonical = {r->method, path, r->query ? r->query : "", headers, names, sha};
  s3_sign(&keys, o->place.region, "s3", date, &canonical, signature);
  int fine = 1;
  for (char *at = headers, *end; fine && (end = strchr(at, '\n')); at = end + 1) {
    *end = 0;
    fine = append(out, at);
  }
  snprintf(line, sizeof line,
           "authorization: AWS4-HMAC-SHA256 Credential=%s/%.8s/%s/s3/aws4_request,SignedHeaders=%s,Signature=%s",
           keys.access, date, o->place.region, names, signature);
  fine = fine && append(out, line) && append(out, "expect:") && append(out, "content-type:") &&
         append(out, "transfer-encoding:");
  sodium_memzero(&keys, sizeof keys);
  free(headers);
  return fine;
}

static int set_method(transfer *t) {
  CURL *c = t->curl;
  const s3_request *r = t->request;
  if (strcmp(r->method, "HEAD") == 0) {
    return curl_easy_setopt(c, CURLOPT_NOBODY, 1L) == CURLE_OK;
  }
  int sends = strcmp(r->method, "PUT") == 0 || strcmp(r->method, "POST") == 0;
  return curl_easy_setopt(c, CURLOPT_CUSTOMREQUEST, r->method) == CURLE_OK &&
         (!sends || (curl_easy_setopt(c, CURLOPT_UPLOAD, 1L) == CURLE_OK &&
                     curl_easy_setopt(c, CURLOPT_INFILESIZE_LARGE, (curl_off_t)r->size) == CURLE_OK &&
                     curl_easy_setopt(c, CURLOPT_READFUNCTION, give_body) == CURLE_OK &&
                     curl_easy_setopt(c, CURLOPT_READDATA, t) == CURLE_OK &&
                     curl_easy_setopt(c, CURLOPT_SEEKFUNCTION, seek_body) == CURLE_OK &&
                     curl_easy_setopt(c, CURLOPT_SEEKDATA, t) == CURLE_OK));
}

static int set_up(const s3 *store, transfer *t, const char *url, struct curl_slist *headers, char *error) {
  CURL *c = t->curl;
  const s3_request *r = t->request;
  int small = r->to < 0 && (r->body || r->size == 0);
  const char *authorities = store->options.authorities;
  return curl_easy_setopt(c, CURLOPT_URL, url) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, store->options.place.scheme) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_PROXY, "") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_NETRC, (long)CURL_NETRC_IGNORED) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HTTP_VERSION, (long)CURL_HTTP_VERSION_1_1) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_PATH_AS_IS, 1L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_USERAGENT, "orbmorph") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HTTPHEADER, headers) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_ERRORBUFFER, error) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take_body) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_WRITEDATA, t) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HEADERFUNCTION, take_header) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HEADERDATA, t) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)CONNECT_MS) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_LOW_SPEED_LIMIT, (long)SLOW_BYTES) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_LOW_SPEED_TIME, (long)SLOW_SECONDS) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, small ? (long)SMALL_MS : 0L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_FILETIME, 1L) == CURLE_OK &&
         (!*authorities || curl_easy_setopt(c, CURLOPT_CAINFO, authorities) == CURLE_OK) && set_method(t);
}

static void perform(s3 *store, transfer *t, const char *path, const char *url) {
  char error[CURL_ERROR_SIZE] = "";
  struct curl_slist *headers = NULL;
  long status = 0;
  curl_off_t length = -1, modified = -1;
  s3_answer *out = t->out;
  t->curl = take_handle(store);
  t->signed_at = s3_clock(store);
  t->socket = CURL_SOCKET_BAD;
  if (t->curl) {
    curl_easy_getinfo(t->curl, CURLINFO_ACTIVESOCKET, &t->socket);
  }
  if (!t->curl || !sign(store, t->request, path, t->signed_at, &headers) || !set_up(store, t, url, headers, error)) {
    snprintf(out->why, sizeof out->why, "the server has no memory left");
  } else {
    CURLcode code = curl_easy_perform(t->curl);
    curl_easy_getinfo(t->curl, CURLINFO_RESPONSE_CODE, &status);
    curl_easy_getinfo(t->curl, CURLINFO_CONTENT_LENGTH_DOWNLOAD_T, &length);
    curl_easy_getinfo(t->curl, CURLINFO_FILETIME_T, &modified);
    out->modified = (int64_t)modified;
    note_date(store, t->date);
    out->size = length >= 0 ? (uint64_t)length : t->taken;
    out->status = code == CURLE_OK ? (int)status : 0;
    if (t->no_space) {
      out->status = 507; /* WebDAV's Insufficient Storage: of this machine */
    } else if (code != CURLE_OK) {
      snprintf(out->why, sizeof out->why, "%.180s", error[0] ? error : curl_easy_strerror(code));
    }
  }
  curl_slist_free_all(headers);
  give_handle(store, t->curl);
}

/* What an answer that refuses says. */
static void explain(s3_answer *out) {
  char code[64] = "", message[120] = "";
  const char *at = out->text;
  if (at && s3_element(&at, "Code", code, sizeof code)) {
    at = out->text;
    s3_element(&at, "Message", message, sizeof message);
  }
  snprintf(out->why, sizeof out->why, "it answered %d%s%s%s%s", out->status, *code ? " " : "", code,
           *message ? ": " : "", message);
}

void s3_pause(int tried) {
  long mean = (long)PAUSE_MS << tried;
  long ms = mean / 2 + (long)randombytes_uniform((uint32_t)mean);
  struct timespec time = {ms / 1000, ms % 1000 * 1000000};
  nanosleep(&time, NULL);
}

/* A URL that carries its signature. */
static int link_to(s3 *store, const char *method, const char *path, int64_t at, long seconds, const char *more,
                   char *out, size_t size) {
  const s3_place *p = &store->options.place;
  s3_keys keys = keys_of(store);
  char date[S3_DATE];
  s3_date((long long)at, date);
  const s3_presigned url = {.method = method,
                            .region = p->region,
                            .host = p->host,
                            .path = path,
                            .date = date,
                            .seconds = seconds,
                            .more = more};
  int n = snprintf(out, size, "%s://%s%s?", p->scheme, p->host, path);
  int fits = n > 0 && (size_t)n < size && s3_presign(&keys, &url, out + n, size - (size_t)n);
  sodium_memzero(&keys, sizeof keys);
  return fits;
}

void s3_send(s3 *store, const s3_request *request, s3_answer *out) {
  const s3_place *p = &store->options.place;
  char path[1024], url[S3_TOKEN + 4096];
  snprintf(path, sizeof path, "%s%s%s", p->base, request->key ? p->prefix : "", request->key ? request->key : "");
  if (!request->key && path[1]) {
    path[strlen(path) - 1] = 0; /* "/BUCKET" */
  }
  snprintf(url, sizeof url, "%s://%s%s%s%s", p->scheme, p->host, path, request->query ? "?" : "",
           request->query ? request->query : "");
  if (request->signed_at && !link_to(store, request->method, path, request->signed_at, request->seconds,
                                     request->query ? request->query : "", url, sizeof url)) {
    memset(out, 0, sizeof *out);
    snprintf(out->why, sizeof out->why, "its URL is too long");
    return;
  }
  for (int tried = 0, corrected = request->signed_at != 0;; tried++) {
    memset(out, 0, sizeof *out);
    transfer t = {.request = request, .out = out};
    perform(store, &t, path, url);
    if (out->status == 403 && !corrected && llabs(s3_clock(store) - t.signed_at) > SKEW_SECONDS) {
      corrected = 1; /* the answer has told S3's time: sign again with it */
      free(out->text);
      tried--;
      continue;
    }
    if (out->status >= 300 || (out->status > 0 && out->status < 200)) {
      explain(out);
    }
    int again = out->status == 0 || out->status == 429 || (out->status >= 500 && out->status != 507);
    if (!again || tried + 1 >= request->tries) {
      return;
    }
    free(out->text);
    s3_pause(tried);
  }
}

int s3_link(s3 *store, const char *key, long seconds, const char *more, char *out, size_t size) {
  char path[1024];
  snprintf(path, sizeof path, "%s%s%s", store->options.place.base, store->options.place.prefix, key);
  return link_to(store, "GET", path, s3_clock(store), seconds, more, out, size);
}

static size_t decode_entity(const char *text, char *out) {
  static const struct {
    const char *name;
    char value;
  } entities[] = {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}, {"&#34;", '"'}};
  for (size_t i = 0; i < sizeof entities / sizeof entities[0]; i++) {
    if (strncmp(text, entities[i].name, strlen(entities[i].name)) == 0) {
      *out = entities[i].value;
      return strlen(entities[i].name);
    }
  }
  *out = *text;
  return 1;
}

int s3_element(const char **at, const char *name, char *out, size_t size) {
  char open[80], close[80];
  snprintf(open, sizeof open, "<%s>", name);
  snprintf(close, sizeof close, "</%s>", name);
  const char *from = strstr(*at, open), *end = from ? strstr(from, close) : NULL;
  if (!end) {
    return 0;
  }
  size_t n = 0;
  for (from += strlen(open); from < end; n++) {
    if (n + 1 >= size) {
      return 0;
    }
    from += decode_entity(from, out + n);
  }
  out[n] = 0;
  *at = end + strlen(close);
  return 1;
}
