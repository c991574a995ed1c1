/* The values of the configuration, and whether they are valid, each alone and together. */
#ifndef ORB_CONFIG_VALUES_H
#define ORB_CONFIG_VALUES_H

#include <limits.h>
#include <stdint.h>

#include "api/text.h"

typedef struct config {
  char listen[256]; /* ADDR:PORT or unix:PATH */
  char data[PATH_MAX / 2];
  char catalogue[1024]; /* sqlite, or the URL of a database in PostgreSQL */
  char objects[1024];   /* files, or the URL of a bucket in S3 */
  char s3_keys[PATH_MAX / 2];
  char assets[16]; /* stream, redirect */
  char file[PATH_MAX / 2];
  char hosts[512]; /* names in Host, comma-separated, or * */
  char cors[512];  /* origins, comma-separated, or * */
  char log_level[16], log_format[16];
  char traces[1024];                           /* URL of a collector of OpenTelemetry; "": off */
  char webhook_allow[1024], fetch_allow[1024]; /* networks, comma-separated */
  char tls_certificate[PATH_MAX / 2], tls_key[PATH_MAX / 2], tls_authorities[PATH_MAX / 2];
  char auth[16];            /* loopback, on, off */
  char limits[16];          /* remote, all, off */
  char socket_mode[8];      /* octal */
  char isolate[16];         /* on, off, strict */
  char role[16];            /* all, serve, work */
  char metrics_listen[256]; /* as listen; of the role work; "": no port */
  int64_t workers, worker_nice, io_threads, http_threads, max_connections, connections_per_address, idle_seconds;
  int64_t requests_per_second, header_seconds, slow_seconds, min_rate, slow_ms;
  int64_t max_body, max_json, max_ratio, decode_memory, encoded_bytes, request_memory, max_triangles, queue_limit;
  int64_t job_memory, job_seconds, check_seconds, disk_reserve, drain_seconds, derived_bytes, quota_derived, keep_jobs;
  int64_t cache_bytes, lost_days, scrub_rate, scrub_seconds;
  int64_t webhook_retry_seconds, fetch_seconds, lease_seconds;
} config;

/* Says what is wrong: on standard error, or in the log once the daemon runs. */
void config_complain(const char *format, ...) API_PRINTF(1, 2);
/* From now on the daemon runs, and config_complain() writes to the log. Only the main thread calls both. */
void config_complains_in_log(void);

/* Replaces 0 workers and 0 job-memory by what suits the machine, makes request-memory at least as large as its parts,
 * and checks all values that are not plain numbers. 0: a value is not valid, and config_complain() has said which. */
int config_is_consistent(config *out);

/* The URL of the catalogue; NULL: it is in the data folder. */
const char *config_catalogue(const config *options);
/* Whether other nodes may use the same catalogue and objects at the same time. */
int config_is_shared(const config *options);

#endif
