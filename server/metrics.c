#include "metrics.h"

#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

enum { BOUNDS = 9 };
static const double bounds[BOUNDS] = {0.005, 0.02, 0.1, 0.5, 1, 5, 20, 60, 300};

typedef struct histogram {
  atomic_llong counts[BOUNDS + 1], micros;
} histogram;

/* The stages that jobs report. */
static const char *const stages[] = {"read",   "check",    "simplify", "embed", "certify", "align",
                                     "remesh", "transfer", "write",    "store", "download"};
enum { STAGES = sizeof stages / sizeof stages[0] };

enum { KINDS = 3 };
static histogram jobs[KINDS], requests, staged[KINDS][STAGES];
static const char *const kinds[KINDS] = {"embedding", "supermesh", "fetch"}; /* by api_job_kind */
static atomic_llong job_failed[KINDS], cache[2], flips, quarantined, statuses[6], received_bytes, sent_bytes,
    connections, webhooks[2];

static void observe(histogram *h, double seconds) {
  int i = 0;
  while (i < BOUNDS && seconds > bounds[i]) {
    i++;
  }
  atomic_fetch_add(&h->counts[i], 1);
  atomic_fetch_add(&h->micros, (long long)(seconds * 1e6));
}

void metrics_job(int kind, int succeeded, double seconds) {
  observe(&jobs[kind], seconds);
  if (!succeeded) {
    atomic_fetch_add(&job_failed[kind], 1);
  }
}
void metrics_stage(int kind, const char *stage, double seconds) {
  for (int i = 0; i < STAGES; i++) {
    if (strcmp(stages[i], stage) == 0) {
      observe(&staged[kind][i], seconds);
    }
  }
}
void metrics_webhook(int delivered) {
  atomic_fetch_add(&webhooks[delivered ? 1 : 0], 1);
}
void metrics_cache(int hit) {
  atomic_fetch_add(&cache[hit ? 1 : 0], 1);
}
void metrics_flips(int64_t n) {
  atomic_fetch_add(&flips, n);
}
void metrics_quarantined(void) {
  atomic_fetch_add(&quarantined, 1);
}
int64_t metrics_quarantined_count(void) {
  return atomic_load(&quarantined);
}
void metrics_request(int status, double seconds) {
  atomic_fetch_add(&statuses[status / 100 < 6 ? status / 100 : 0], 1);
  if (seconds >= 0) {
    observe(&requests, seconds);
  }
}
void metrics_bytes(int64_t received, int64_t sent) {
  atomic_fetch_add(&received_bytes, received);
  atomic_fetch_add(&sent_bytes, sent);
}
void metrics_connection(int change) {
  atomic_fetch_add(&connections, change);
}
int64_t metrics_connections(void) {
  return atomic_load(&connections);
}

static int seen(histogram *h) {
  long long sum = 0;
  for (int i = 0; i <= BOUNDS; i++) {
    sum += atomic_load(&h->counts[i]);
  }
  return sum > 0;
}

static void write_histogram(api_text *out, const char *name, const char *label, histogram *h) {
  long long sum = 0;
  const char *comma = label[0] ? "," : "";
  for (int i = 0; i <= BOUNDS; i++) {
    sum += atomic_load(&h->counts[i]);
    if (i < BOUNDS) {
      api_text_printf(out, "%s_bucket{%s%sle=\"%g\"} %lld\n", name, label, comma, bounds[i], sum);
    }
  }
  api_text_printf(out, "%s_bucket{%s%sle=\"+Inf\"} %lld\n", name, label, comma, sum);
  api_text_printf(out, "%s_sum%s%s%s %.6f\n", name, label[0] ? "{" : "", label, label[0] ? "}" : "",
                  1e-6 * (double)atomic_load(&h->micros));
  api_text_printf(out, "%s_count%s%s%s %lld\n", name, label[0] ? "{" : "", label, label[0] ? "}" : "", sum);
}

void metrics_family(api_text *out, const char *name, const char *type, const char *help) {
  api_text_printf(out, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

void metrics_write(api_text *out) {
  metrics_family(out, "orbmorph_job_seconds", "histogram", "Time of attempts at jobs, by kind.");
  for (int kind = 0; kind < KINDS; kind++) {
    char label[32];
    snprintf(label, sizeof label, "kind=\"%s\"", kinds[kind]);
    write_histogram(out, "orbmorph_job_seconds", label, &jobs[kind]);
  }
  metrics_family(out, "orbmorph_stage_seconds", "histogram", "Time of stages of jobs.");
  for (int kind = 0; kind < KINDS; kind++) {
    for (int i = 0; i < STAGES; i++) {
      char labels[64];
      snprintf(labels, sizeof labels, "kind=\"%s\",stage=\"%s\"", kinds[kind], stages[i]);
      if (seen(&staged[kind][i])) {
        write_histogram(out, "orbmorph_stage_seconds", labels, &staged[kind][i]);
      }
    }
  }
  metrics_family(out, "orbmorph_job_failures_total", "counter", "Attempts that did not succeed.");
  for (int kind = 0; kind < KINDS; kind++) {
    api_text_printf(out, "orbmorph_job_failures_total{kind=\"%s\"} %lld\n", kinds[kind],
                    atomic_load(&job_failed[kind]));
  }
  metrics_family(out, "orbmorph_webhook_attempts_total", "counter", "Attempts to deliver messages to webhooks.");
  api_text_printf(out, "orbmorph_webhook_attempts_total{result=\"delivered\"} %lld\n", atomic_load(&webhooks[1]));
  api_text_printf(out, "orbmorph_webhook_attempts_total{result=\"failed\"} %lld\n", atomic_load(&webhooks[0]));
  metrics_family(out, "orbmorph_http_request_seconds", "histogram",
                 "Time of requests, except those that wait for a job.");
  write_histogram(out, "orbmorph_http_request_seconds", "", &requests);
  metrics_family(out, "orbmorph_http_responses_total", "counter", "Responses by status class.");
  for (int i = 1; i < 6; i++) {
    api_text_printf(out, "orbmorph_http_responses_total{class=\"%dxx\"} %lld\n", i, atomic_load(&statuses[i]));
  }
  const struct {
    const char *name, *type, *help;
    long long value;
  } single[] = {
      {"orbmorph_cache_hits_total", "counter", "Descriptions found in memory.", atomic_load(&cache[1])},
      {"orbmorph_cache_misses_total", "counter", "Descriptions read from the catalogue.", atomic_load(&cache[0])},
      {"orbmorph_flips_total", "counter", "Flipped triangles found in results; always 0.", atomic_load(&flips)},
      {"orbmorph_objects_quarantined_total", "counter", "Stored files that did not match their hash.",
       atomic_load(&quarantined)},
      {"orbmorph_received_bytes_total", "counter", "Bytes of bodies received.", atomic_load(&received_bytes)},
      {"orbmorph_sent_bytes_total", "counter", "Bytes of bodies sent.", atomic_load(&sent_bytes)},
      {"orbmorph_connections", "gauge", "Open connections.", atomic_load(&connections)},
  };
  for (size_t i = 0; i < sizeof single / sizeof single[0]; i++) {
    metrics_family(out, single[i].name, single[i].type, single[i].help);
    api_text_printf(out, "%s %lld\n", single[i].name, single[i].value);
  }
}
