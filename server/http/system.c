/* Health and metrics. */
#include <dirent.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "http/http.h"
#include "metrics.h"
#include "store/deliveries.h"
#include "store/usage.h"
#include "trace/send.h"

enum { TENANTS_SHOWN = 50 };

static void gauge(api_text *out, const char *name, const char *help, double value) {
  metrics_family(out, name, "gauge", help);
  api_text_printf(out, "%s %.17g\n", name, value);
}

static double count_entries(const char *folder) {
  DIR *dir = opendir(folder);
  double count = 0;
  for (struct dirent *entry; dir && (entry = readdir(dir));) {
    count += entry->d_name[0] != '.';
  }
  if (dir) {
    closedir(dir);
  }
  return count;
}

/* What the last round of the scrub found, and what requests and jobs have met since. */
static void read_scrub(const server *srv, scrub_report *out) {
  scrub_read(srv->scrub, out);
  out->catalogue_damaged |= catalogue_is_damaged(srv->cat);
}

static void write_scrub(const server *srv, api_text *text) {
  scrub_report found;
  read_scrub(srv, &found);
  metrics_family(text, "orbmorph_scrub_rounds_total", "counter", "Rounds over all stored files that have ended.");
  api_text_printf(text, "orbmorph_scrub_rounds_total %lld\n", (long long)found.rounds);
  metrics_family(text, "orbmorph_scrub_bytes_total", "counter", "Bytes of stored files that those rounds compared.");
  api_text_printf(text, "orbmorph_scrub_bytes_total %lld\n", (long long)found.bytes);
  gauge(text, "orbmorph_scrub_end_seconds", "Unix time at which the last round ended; 0: none has.",
        (double)found.ended);
  gauge(text, "orbmorph_objects_missing", "Stored files that a row names and that do not exist, at the last round.",
        (double)found.missing);
  gauge(text, "orbmorph_objects_unreadable", "Stored files that could not be read, at the last round.",
        (double)found.unreadable);
  gauge(text, "orbmorph_objects_without_row", "Stored files that no row names, at the last round.",
        (double)found.without_row);
  gauge(text, "orbmorph_catalogue_damaged", "1 if SQLite's quick_check, a request or a job has found damage.",
        found.catalogue_damaged);
}

/* The tenants that store most, and the others as one: 3 numbers of each, however many there are. */
static void write_tenants(catalogue *cat, api_text *text) {
  static const struct {
    const char *name, *type, *help;
  } families[] = {{"orbmorph_tenant_bytes", "gauge", "Bytes of the meshes and landmarks that a tenant owns."},
                  {"orbmorph_tenant_derived_bytes", "gauge", "Bytes of what a tenant's jobs made."},
                  {"orbmorph_tenant_worker_seconds_total", "counter", "Time for which workers had a tenant's jobs."}};
  usage_row rows[TENANTS_SHOWN + 1];
  int count = catalogue_usage_most(cat, TENANTS_SHOWN + 1, rows), last = count - 1;
  for (int i = 0; i < last; i++) {
    rows[last].bytes -= rows[i].bytes;
    rows[last].derived -= rows[i].derived;
    rows[last].worker_ms -= rows[i].worker_ms;
  }
  for (size_t f = 0; count > 0 && f < sizeof families / sizeof families[0]; f++) {
    metrics_family(text, families[f].name, families[f].type, families[f].help);
    for (int i = 0; i < (last == TENANTS_SHOWN ? count : last); i++) {
      double values[] = {(double)rows[i].bytes, (double)rows[i].derived, 1e-3 * (double)rows[i].worker_ms};
      api_text_printf(text, "%s{tenant=\"%s\"} %.17g\n", families[f].name, i < last ? rows[i].tenant : "(others)",
                      values[f]);
    }
  }
}

static void write_traces(api_text *text) {
  trace_numbers n;
  trace_count(&n);
  metrics_family(text, "orbmorph_spans_total", "counter", "Spans of traces, by what became of them.");
  api_text_printf(text, "orbmorph_spans_total{result=\"sent\"} %lld\norbmorph_spans_total{result=\"dropped\"} %lld\n",
                  (long long)n.sent, (long long)n.dropped);
  gauge(text, "orbmorph_spans_waiting", "Spans that are still to be sent.", (double)n.waiting);
}

static void metrics_away(request *r) {
  server *srv = r->srv;
  api_text text = {0};
  queue_numbers n;
  queue_count(srv->q, &n);
  metrics_write(&text);
  metrics_family(&text, "orbmorph_jobs", "gauge", "Unfinished jobs; waiting: for embeddings that they need.");
  api_text_printf(&text, "orbmorph_jobs{state=\"queued\"} %d\norbmorph_jobs{state=\"waiting\"} %d\n", n.queued,
                  n.waiting);
  api_text_printf(&text, "orbmorph_jobs{state=\"running\"} %d\n", n.running);
  metrics_family(&text, "orbmorph_jobs_running", "gauge", "Running jobs by stage.");
  for (size_t i = 0; i < sizeof n.stages / sizeof n.stages[0] && n.stages[i].jobs > 0; i++) {
    api_text_printf(&text, "orbmorph_jobs_running{stage=\"%s\"} %d\n", n.stages[i].name, n.stages[i].jobs);
  }
  metrics_family(&text, "orbmorph_jobs_ended_total", "counter", "Jobs that ended since the start.");
  for (int s = API_JOB_SUCCEEDED; s <= API_JOB_CANCELLED; s++) {
    api_text_printf(&text, "orbmorph_jobs_ended_total{state=\"%s\"} %lld\n", api_job_state_name((api_job_state)s),
                    (long long)n.ended[s]);
  }
  gauge(&text, "orbmorph_queue_oldest_seconds", "Age of the oldest job that waits for a worker.",
        1e-3 * (double)n.oldest_ms);
  gauge(&text, "orbmorph_waiting_connections", "Connections that wait for a job to end.", n.waiters);
  int64_t stored = catalogue_bytes(srv->cat, 0);
  if (stored >= 0) {
    gauge(&text, "orbmorph_stored_bytes", "Bytes of stored objects.", (double)stored);
  }
  int64_t pending = catalogue_deliveries_pending(srv->cat);
  if (pending >= 0) {
    gauge(&text, "orbmorph_webhook_pending", "Messages to webhooks that are still to be delivered.", (double)pending);
  }
  write_tenants(srv->cat, &text);
  gauge(&text, "orbmorph_disk_free_bytes", "Free bytes of the file system that holds the data folder.",
        (double)objects_free_bytes(srv->store));
  write_scrub(srv, &text);
  write_traces(&text);
  gauge(&text, "orbmorph_queue_limit", "Largest number of unfinished jobs.", (double)srv->options->queue_limit);
  gauge(&text, "orbmorph_decoding_bytes", "Bytes held by decoders of compressed bodies.",
        (double)__atomic_load_n(&srv->decoding, __ATOMIC_RELAXED));
  gauge(&text, "process_open_fds", "Open file descriptors.", count_entries("/proc/self/fd"));
  gauge(&text, "process_threads", "Threads.", count_entries("/proc/self/task"));
  long resident = 0;
  FILE *statm = fopen("/proc/self/statm", "r");
  if (statm) {
    if (fscanf(statm, "%*d %ld", &resident) != 1) {
      resident = 0;
    }
    fclose(statm);
  }
  gauge(&text, "process_resident_memory_bytes", "Resident memory.", (double)sysconf(_SC_PAGESIZE) * (double)resident);
  reply_text(r, 200, "text/plain; version=0.0.4; charset=utf-8", &text);
}

/* For ?verbose: what is wrong with the stored data. */
static void write_integrity(const scrub_report *found, api_text *json) {
  api_json_key(json, "integrity");
  api_json_open(json, '{');
  api_json_member_string(json, "catalogue", found->catalogue_damaged ? "damaged" : "ok");
  api_json_member_integer(json, "quarantined", metrics_quarantined_count());
  api_json_member_integer(json, "missing", found->missing);
  api_json_member_integer(json, "unreadable", found->unreadable);
  api_json_member_integer(json, "without_row", found->without_row);
  api_json_member_integer(json, "scrubs", found->rounds);
  api_json_member_integer(json, "scrubbed_objects", found->objects);
  api_json_close(json, '}');
}

static enum MHD_Result ready(request *r) {
  server *srv = r->srv;
  scrub_report found;
  int up = __atomic_load_n(&srv->ready, __ATOMIC_ACQUIRE) && !__atomic_load_n(&srv->stopping, __ATOMIC_ACQUIRE);
  if (!up) {
    reply_refuse(r, "unavailable", "The daemon is starting or stopping; try again soon.");
    return MHD_YES;
  }
  read_scrub(srv, &found);
  if (found.catalogue_damaged) {
    reply_refuse(r, "unavailable", "The catalogue is damaged: stop the daemon and restore a backup.");
    return MHD_YES;
  }
  if (catalogue_is_away(srv->cat)) {
    reply_refuse(r, "unavailable", "The catalogue (PostgreSQL) does not answer; the server's log says why.");
    return MHD_YES;
  }
  if (objects_are_away(srv->store)) {
    reply_refuse(r, "unavailable",
                 "The store of objects (S3) does not answer. Try again soon; the daemon's log tells the operator why.");
    return MHD_YES;
  }
  api_text json = {0};
  api_json_open(&json, '{');
  api_json_member_string(&json, "status", "ready");
  if (query_has(r, "verbose") && access_is_operator(r)) {
    queue_numbers n; /* for operators only: counting walks all jobs under the queue's lock */
    queue_count(srv->q, &n);
    api_json_member_integer(&json, "queued", n.queued);
    api_json_member_integer(&json, "waiting", n.waiting);
    api_json_member_integer(&json, "running", n.running);
    api_json_member_integer(&json, "queue_limit", srv->options->queue_limit);
    api_json_member_integer(&json, "oldest_ms", n.oldest_ms);
    api_json_member_integer(&json, "workers", srv->options->workers);
    api_json_member_integer(&json, "connections", metrics_connections());
    api_json_member_integer(&json, "max_connections", srv->options->max_connections);
    api_json_member_integer(&json, "waiting_connections", n.waiters);
    api_json_member_integer(&json, "disk_free_bytes", (int64_t)objects_free_bytes(srv->store));
    api_json_member_integer(&json, "uptime_seconds", (orb_clock_ms() - srv->started_ms) / 1000);
    api_json_member_string(&json, "engine", ORB_ENGINE);
    api_json_member_bool(&json, "read_only", objects_is_read_only(srv->store));
    write_integrity(&found, &json);
  }
  api_json_close(&json, '}');
  reply_json(r, 200, &json);
  return MHD_YES;
}

enum MHD_Result handle_system(request *r) {
  switch (r->route->id) {
    case ROUTE_LIVEZ: {
      api_text json = {0};
      api_json_open(&json, '{');
      api_json_member_string(&json, "status", "alive");
      api_json_close(&json, '}');
      reply_json(r, 200, &json);
      return MHD_YES;
    }
    case ROUTE_READYZ:
      return ready(r);
    case ROUTE_METRICS:
      return request_go_away(r, r->srv->io, metrics_away);
    case ROUTE_OPENAPI:
      handle_page(r, "/openapi.json");
      return MHD_YES;
    case ROUTE_DOCS:
      handle_page(r, "/docs");
      return MHD_YES;
    default:
      handle_page(r, "/");
      return MHD_YES;
  }
}
