/* The configuration. A flag overrides the environment (ORBMORPH_NAME), which overrides the config file, which overrides
 * the default. A new option: its field here, its line in the table of config.c, deploy/man/orbmorphd.8. */
#ifndef ORB_CONFIG_H
#define ORB_CONFIG_H

#include <limits.h>
#include <stdint.h>

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
  int64_t max_body, max_json, max_ratio, decode_memory, encoded_bytes, max_triangles, queue_limit;
  int64_t job_memory, job_seconds, check_seconds, disk_reserve, drain_seconds, derived_bytes, quota_derived, keep_jobs;
  int64_t cache_bytes, lost_days, scrub_rate, scrub_seconds;
  int64_t webhook_retry_seconds, fetch_seconds, lease_seconds;
} config;

typedef enum config_action {
  CONFIG_RUN,
  CONFIG_PRINTED, /* --help, --version: done */
  CONFIG_BAD,     /* the reason is on standard error */
  CONFIG_CHECKED, /* --check-config */
  CONFIG_CHECK_DATA,
  CONFIG_GC,
} config_action;

enum { CONFIG_UNFIT = 78 }; /* EX_CONFIG, the status of a process whose catalogue or data folder does not fit */

/* Parses a number ≥ 0 with an optional suffix K, M or G (powers of 1024). 0 if malformed. */
int config_number(const char *text, int64_t *out);
/* Reads the configuration again and applies the options that may change at run time (log-level, queue-limit,
 * derived-bytes, quota-derived, keep-jobs). Calls `changed` for each option that differs; `taken` says whether it was
 * applied. 0 if the new configuration is invalid: nothing changes, and the reason is in the log. Other threads must
 * load derived_bytes and quota_derived atomically. */
int config_reload(config *live, int argc, char **argv, void (*changed)(const char *name, int taken));
/* The URL of the catalogue; NULL: it is in the data folder. */
const char *config_catalogue(const config *options);
/* Whether other nodes may use the same catalogue and objects at the same time. */
int config_is_shared(const config *options);
config_action config_read(config *out, int argc, char **argv);

#endif
