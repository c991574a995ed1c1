#include "trace/send.h"

#include <curl/curl.h>
#include <pthread.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "api/json.h"
#include "log.h"
#include "orbmorph/context.h"

/* KEPT spans are about 4 MB. A batch goes when it is full, or BATCH_MS after the one before it. A collector that does
 * not answer is asked again after 1 s, 2 s, … at most AGAIN_MOST_MS; a batch that it refuses so often is dropped. */
enum { KEPT = 8192, BATCH = 512, BATCH_MS = 1000, ANSWER_MS = 10000, CONNECT_MS = 3000 };
enum { AGAIN_MS = 1000, AGAIN_MOST_MS = 30000, TRIES = 8, STOP_MS = 2000 };

static struct {
  pthread_mutex_t lock;
  char *spans[KEPT]; /* a ring */
  int first, count;
  int on, stopping;                 /* __atomic */
  int64_t sent, dropped, in_flight; /* __atomic */
  CURLM *multi;
  CURL *curl;
  struct curl_slist *headers;
  pthread_t thread;
  /* Of the thread. */
  api_text body;
  int batch; /* spans in the body */
  int flies, tries, is_away;
  int64_t again_at; /* orb_clock_ms() */
  char url[1100], resource[512];
} sender = {.lock = PTHREAD_MUTEX_INITIALIZER};

int trace_is_on(void) {
  return __atomic_load_n(&sender.on, __ATOMIC_RELAXED);
}

static void add(int64_t *count, int64_t by) {
  __atomic_add_fetch(count, by, __ATOMIC_RELAXED);
}

void trace_send(char *span) {
  int full = 0, kept = 0;
  pthread_mutex_lock(&sender.lock);
  if (span && trace_is_on() && sender.count < KEPT) {
    sender.spans[(sender.first + sender.count++) % KEPT] = span;
    full = sender.count == BATCH;
    kept = 1;
  }
  pthread_mutex_unlock(&sender.lock);
  if (!kept) {
    free(span);
    add(&sender.dropped, 1);
  }
  if (full) {
    curl_multi_wakeup(sender.multi);
  }
}

void trace_count(trace_numbers *out) {
  pthread_mutex_lock(&sender.lock);
  *out = (trace_numbers){.sent = __atomic_load_n(&sender.sent, __ATOMIC_RELAXED),
                         .dropped = __atomic_load_n(&sender.dropped, __ATOMIC_RELAXED),
                         .waiting = sender.count + __atomic_load_n(&sender.in_flight, __ATOMIC_RELAXED)};
  pthread_mutex_unlock(&sender.lock);
}

/* Moves the oldest spans into the body. */
static void fill(void) {
  char *spans[BATCH];
  int count = 0;
  pthread_mutex_lock(&sender.lock);
  for (; count < BATCH && sender.count > 0; sender.count--) {
    spans[count++] = sender.spans[sender.first];
    sender.first = (sender.first + 1) % KEPT;
  }
  __atomic_store_n(&sender.in_flight, count, __ATOMIC_RELAXED);
  pthread_mutex_unlock(&sender.lock);
  sender.body.size = 0;
  api_text_add(&sender.body, "{\"resourceSpans\":[{\"resource\":");
  api_text_add(&sender.body, sender.resource);
  api_text_add(&sender.body, ",\"scopeSpans\":[{\"scope\":{\"name\":\"orbmorphd\"},\"spans\":[");
  for (int i = 0; i < count; i++) {
    api_text_add(&sender.body, i ? "," : "");
    api_text_add(&sender.body, spans[i]);
    free(spans[i]);
  }
  api_text_add(&sender.body, "]}]}]}");
  sender.batch = count;
  sender.tries = 0;
}

static void end_batch(int64_t *counted) {
  add(counted, sender.batch);
  __atomic_store_n(&sender.in_flight, 0, __ATOMIC_RELAXED);
  sender.batch = 0;
  api_text_free(&sender.body);
}

static void start_flight(void) {
  if (sender.batch == 0) {
    fill();
  }
  if (sender.body.failed) {
    end_batch(&sender.dropped);
    return;
  }
  sender.flies = curl_easy_setopt(sender.curl, CURLOPT_POSTFIELDS, sender.body.data) == CURLE_OK &&
                 curl_easy_setopt(sender.curl, CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)sender.body.size) == CURLE_OK &&
                 curl_multi_add_handle(sender.multi, sender.curl) == CURLM_OK;
  if (!sender.flies) {
    end_batch(&sender.dropped);
  }
}

/* The statuses that OTLP lets a sender repeat; 0: there was no answer. */
static int may_repeat(long status) {
  return status == 0 || status == 429 || status == 502 || status == 503 || status == 504;
}

static int64_t wait_ms(void) {
  curl_off_t after = 0;
  int64_t ms = (int64_t)AGAIN_MS << (sender.tries < 6 ? sender.tries - 1 : 5);
  ms = ms < AGAIN_MOST_MS ? ms : AGAIN_MOST_MS;
  curl_easy_getinfo(sender.curl, CURLINFO_RETRY_AFTER, &after);
  return (int64_t)after * 1000 > ms && after * 1000 <= AGAIN_MOST_MS ? (int64_t)after * 1000 : ms;
}

static void end_flight(CURLcode code) {
  long status = 0;
  curl_multi_remove_handle(sender.multi, sender.curl);
  sender.flies = 0;
  if (code == CURLE_OK) {
    curl_easy_getinfo(sender.curl, CURLINFO_RESPONSE_CODE, &status);
  }
  int fine = status >= 200 && status <= 299;
  if (!fine && !sender.is_away) {
    char answer[32];
    snprintf(answer, sizeof answer, "it answers %ld", status);
    log_warn("traces: spans cannot be sent: %s", status ? answer : curl_easy_strerror(code));
  } else if (fine && sender.is_away) {
    log_info("traces: spans are sent again");
  }
  sender.is_away = !fine;
  if (fine) {
    end_batch(&sender.sent);
  } else if (!may_repeat(status) || ++sender.tries >= TRIES) {
    end_batch(&sender.dropped);
  } else {
    sender.again_at = orb_clock_ms() + wait_ms();
  }
}

static void collect(void) {
  int left;
  for (CURLMsg *message; (message = curl_multi_info_read(sender.multi, &left));) {
    if (message->msg == CURLMSG_DONE) {
      end_flight(message->data.result);
    }
  }
}

static int waiting(void) {
  pthread_mutex_lock(&sender.lock);
  int count = sender.count;
  pthread_mutex_unlock(&sender.lock);
  return count;
}

static void *thread_main(void *argument) {
  int64_t next = orb_clock_ms() + BATCH_MS, until = 0;
  (void)argument;
  for (;;) {
    int running;
    const int stops = __atomic_load_n(&sender.stopping, __ATOMIC_ACQUIRE), left = waiting();
    int64_t now = orb_clock_ms();
    until = stops && !until ? now + STOP_MS : until;
    if (stops && ((!sender.flies && (sender.is_away || left + sender.batch == 0)) || now >= until)) {
      return NULL;
    }
    const int due = left + sender.batch > 0 && (left >= BATCH || now >= next || stops);
    if (!sender.flies && due && now >= sender.again_at) {
      start_flight();
      next = now + BATCH_MS;
    }
    curl_multi_perform(sender.multi, &running);
    collect();
    now = orb_clock_ms();
    const int64_t begins = waiting() >= BATCH || sender.again_at > next ? sender.again_at : next;
    int64_t wait = sender.flies ? BATCH_MS : begins - now;
    wait = wait < 1 ? (waiting() + sender.batch ? 0 : BATCH_MS) : wait < BATCH_MS ? wait : BATCH_MS;
    curl_multi_poll(sender.multi, NULL, 0, (int)wait, NULL);
  }
}

static size_t drop_answer(char *bytes, size_t one, size_t size, void *user) {
  (void)bytes;
  (void)one;
  (void)user;
  return size;
}

/* The URL is the operator's, unlike those of net/client.h, and may lead anywhere. */
static int set_up(const trace_options *o) {
  CURL *c = sender.curl;
  struct curl_slist *type = curl_slist_append(NULL, "Content-Type: application/json");
  sender.headers = type ? curl_slist_append(type, "Expect:") : NULL;
  if (!sender.headers) {
    curl_slist_free_all(type);
    return 0;
  }
  return curl_easy_setopt(c, CURLOPT_URL, sender.url) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "http,https") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_PROXY, "") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_USERAGENT, "orbmorph") == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_HTTPHEADER, sender.headers) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, drop_answer) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, (long)ANSWER_MS) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)CONNECT_MS) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L) == CURLE_OK &&
         curl_easy_setopt(c, CURLOPT_QUICK_EXIT, 1L) == CURLE_OK &&
         (!*o->authorities || curl_easy_setopt(c, CURLOPT_CAINFO, o->authorities) == CURLE_OK);
}

static void attribute(api_text *json, const char *key, const char *value) {
  api_json_open(json, '{');
  api_json_member_string(json, "key", key);
  api_json_key(json, "value");
  api_json_open(json, '{');
  api_json_member_string(json, "stringValue", value);
  api_json_close(json, '}');
  api_json_close(json, '}');
}

/* What all spans of this process have in common. */
static int describe(const trace_options *o) {
  char host[65] = "", instance[2 * 8 + 1];
  unsigned char random[8];
  api_text json = {0};
  randombytes_buf(random, sizeof random);
  sodium_bin2hex(instance, sizeof instance, random, sizeof random);
  gethostname(host, sizeof host - 1);
  api_json_open(&json, '{');
  api_json_key(&json, "attributes");
  api_json_open(&json, '[');
  attribute(&json, "service.name", "orbmorphd");
  attribute(&json, "service.version", ORB_ENGINE);
  attribute(&json, "service.instance.id", instance);
  attribute(&json, "host.name", host);
  attribute(&json, "orbmorph.role", o->role);
  api_json_close(&json, ']');
  api_json_close(&json, '}');
  int fine = !json.failed && json.size < sizeof sender.resource;
  if (fine) {
    memcpy(sender.resource, json.data, json.size + 1);
  }
  api_text_free(&json);
  return fine;
}

int trace_start(const trace_options *options) {
  const char *host = strstr(options->url, "://");
  const char *path = host ? strchr(host + 3, '/') : NULL;
  snprintf(sender.url, sizeof sender.url, "%s%s", options->url, !path ? "/v1/traces" : path[1] ? "" : "v1/traces");
  sender.multi = curl_multi_init();
  sender.curl = curl_easy_init();
  int fine = sender.multi && sender.curl && describe(options) && set_up(options) &&
             pthread_create(&sender.thread, NULL, thread_main, NULL) == 0;
  __atomic_store_n(&sender.on, fine, __ATOMIC_RELEASE);
  return fine;
}

void trace_stop(void) {
  if (trace_is_on()) {
    __atomic_store_n(&sender.stopping, 1, __ATOMIC_RELEASE);
    curl_multi_wakeup(sender.multi);
    pthread_join(sender.thread, NULL);
    pthread_mutex_lock(&sender.lock);
    __atomic_store_n(&sender.on, 0, __ATOMIC_RELEASE);
    for (; sender.count > 0; sender.count--) {
      free(sender.spans[sender.first]);
      sender.first = (sender.first + 1) % KEPT;
    }
    pthread_mutex_unlock(&sender.lock);
    api_text_free(&sender.body);
  }
  if (sender.flies) {
    curl_multi_remove_handle(sender.multi, sender.curl);
  }
  curl_easy_cleanup(sender.curl);
  curl_multi_cleanup(sender.multi);
  curl_slist_free_all(sender.headers);
  sender.curl = NULL;
  sender.multi = NULL;
  sender.headers = NULL;
}
