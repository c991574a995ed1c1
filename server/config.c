#include "config.h"

#include <ctype.h>
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "orbmorph/status.h"

typedef struct entry {
  const char *name;
  size_t offset, size; /* size 0: a number */
  int64_t least, most;
  const char *standard; /* the default */
  const char *help;
} entry;

#define TEXT(field) offsetof(config, field), sizeof((config *)0)->field, 0, 0
#define NUMBER(field, least, most) offsetof(config, field), 0, least, most

/* Numbers may end in K, M or G (powers of 1024). */
static const entry table[] = {
    {"listen", TEXT(listen), "127.0.0.1:8080", "ADDR:PORT, [V6]:PORT or unix:PATH; port 0 picks a free one"},
    {"socket-mode", TEXT(socket_mode), "0660", "permissions of a Unix socket, in octal"},
    {"data", TEXT(data), "orbmorph-data", "the data folder: everything that the daemon stores"},
    {"catalogue", TEXT(catalogue), "sqlite",
     "where rows are stored; sqlite: in the data folder; postgresql://…: in a database of PostgreSQL 15 or later, "
     "which several daemons may share if their objects are in S3"},
    {"objects", TEXT(objects), "files",
     "where meshes and results are stored; files: in the data folder; s3://BUCKET[/PREFIX]?endpoint=URL&region=R: in a "
     "bucket of S3, with copies in the data folder"},
    {"s3-keys", TEXT(s3_keys), "",
     "file with aws_access_key_id and aws_secret_access_key; without it, those of the environment (AWS_ACCESS_KEY_ID, "
     "AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN)"},
    {"cache-bytes", NUMBER(cache_bytes, 1 << 20, INT64_C(1) << 50), "10G",
     "bytes of objects in S3 to keep as copies in the data folder, most recently used ones first"},
    {"assets", TEXT(assets), "stream",
     "stream: the daemon sends assets; redirect: with objects in S3, it answers 307 with a URL of S3 that is valid for "
     "15 minutes"},
    {"config", TEXT(file), "", "a file of lines NAME = VALUE with these names"},
    {"role", TEXT(role), "all",
     "of a node that shares its catalogue with others: serve (runs no jobs), work (serves no requests), or all"},
    {"metrics-listen", TEXT(metrics_listen), "",
     "address at which a node with the role work answers only /metrics, /livez and /readyz; as listen; without it: "
     "none"},
    {"lease-seconds", NUMBER(lease_seconds, 2, 3600), "30",
     "time without a sign of a node after which others take over its jobs"},
    {"workers", NUMBER(workers, 1, 256), "0", "jobs that run at once; 0: one per core"},
    {"worker-nice", NUMBER(worker_nice, 0, 19), "5",
     "nice value of jobs; the higher, the more they yield to other programs"},
    {"io-threads", NUMBER(io_threads, 1, 64), "6", "threads for queries and commits"},
    {"http-threads", NUMBER(http_threads, 2, 64), "2", "threads that serve connections"},
    {"max-connections", NUMBER(max_connections, 16, 1000000), "16384", "limit on open connections"},
    {"connections-per-address", NUMBER(connections_per_address, 0, 1000000), "256",
     "limit on open connections of one address, see --limits; 0: no limit"},
    {"requests-per-second", NUMBER(requests_per_second, 0, 1000000), "100",
     "limit on requests of one address, averaged over 10 s, see --limits; 0: no limit"},
    {"limits", TEXT(limits), "remote",
     "which addresses the two limits above apply to; remote: other machines, if tokens are needed; all; off"},
    {"idle-seconds", NUMBER(idle_seconds, 1, 3600), "30", "a connection is closed after this long without data"},
    {"header-seconds", NUMBER(header_seconds, 1, 3600), "15", "time limit for the headers of a request"},
    {"slow-seconds", NUMBER(slow_seconds, 1, 3600), "10", "time over which min-rate is measured"},
    {"min-rate", NUMBER(min_rate, 0, 1 << 30), "256",
     "slowest allowed transfer of a body or response, in bytes per second; 0: any"},
    {"slow-ms", NUMBER(slow_ms, 1, 3600000), "1000", "a request that takes longer is logged as slow"},
    {"max-body", NUMBER(max_body, 1024, INT64_C(1) << 40), "512M", "limit on the bytes of an upload"},
    {"max-json", NUMBER(max_json, 1024, 1 << 26), "1M", "limit on the bytes of a JSON body"},
    {"max-ratio", NUMBER(max_ratio, 2, 1000000), "200",
     "limit on the compression ratio of a body that decompresses to more than 1M"},
    {"request-memory", NUMBER(request_memory, 1 << 20, INT64_C(1) << 40), "64M",
     "bytes that JSON bodies, decompression and answers of all requests may hold at once, at least half as much again "
     "as each of the next two"},
    {"encoded-bytes", NUMBER(encoded_bytes, 0, INT64_C(1) << 40), "32M",
     "bytes of compressed answers and small assets to keep in memory; 0: none, and answers are not compressed"},
    {"decode-memory", NUMBER(decode_memory, 1 << 20, INT64_C(1) << 40), "32M",
     "bytes for decompressing all bodies at once"},
    {"max-triangles", NUMBER(max_triangles, 4, 500000000), "5000000", "limit on the triangles of a mesh"},
    {"queue-limit", NUMBER(queue_limit, 1, 1000000), "10000", "limit on unfinished jobs"},
    {"job-memory", NUMBER(job_memory, 1 << 20, INT64_C(1) << 46), "0",
     "memory limit of one job, and of all jobs on workers, in bytes; 0: half of the machine's memory"},
    {"job-seconds", NUMBER(job_seconds, 1, 864000), "3600", "time limit of one job"},
    {"check-seconds", NUMBER(check_seconds, 1, 864000), "30", "time limit of the check of one upload"},
    {"isolate", TEXT(isolate), "on",
     "on: meshes are read and jobs run in separate confined processes; strict: refuse to start if the kernel "
     "cannot confine them; off: within the daemon, for debugging"},
    {"disk-reserve", NUMBER(disk_reserve, 0, INT64_C(1) << 46), "64M", "bytes that the daemon leaves free on the disk"},
    {"drain-seconds", NUMBER(drain_seconds, 0, 3600), "8", "on SIGTERM, time for running jobs to end"},
    {"derived-bytes", NUMBER(derived_bytes, 1 << 20, INT64_C(1) << 50), "0",
     "bytes of embeddings, alignments and supermeshes to keep, most recently used ones first; 0: all"},
    {"quota-derived", NUMBER(quota_derived, 0, INT64_C(1) << 50), "0",
     "bytes of embeddings, alignments, supermeshes and requests of unfinished jobs that each tenant may keep, unless "
     "its token says otherwise; 0: any"},
    {"keep-jobs", NUMBER(keep_jobs, 0, INT64_C(1) << 40), "100000",
     "ended jobs to keep in the catalogue, newest first; 0: all"},
    {"lost-days", NUMBER(lost_days, 0, 36500), "30",
     "days that --gc keeps files without a row in lost+found before it deletes them"},
    {"scrub-rate", NUMBER(scrub_rate, 0, INT64_C(1) << 40), "1M",
     "bytes per second at which stored files are compared with their hashes in the background; 0: never"},
    {"scrub-seconds", NUMBER(scrub_seconds, 1, 31536000), "21600",
     "least time from the start of one such round to the start of the next"},
    {"hosts", TEXT(hosts), "",
     "further names of the daemon, which it checks if no token is needed, comma-separated, or *"},
    {"webhook-allow", TEXT(webhook_allow), "",
     "networks that webhooks may reach besides public addresses, such as 10.1.0.0/16, comma-separated; also by http"},
    {"webhook-retry-seconds", NUMBER(webhook_retry_seconds, 1, 3600), "5",
     "wait after the first failed attempt at a webhook; it doubles with each further one"},
    {"fetch-allow", TEXT(fetch_allow), "", "the same for meshes from a URL"},
    {"fetch-seconds", NUMBER(fetch_seconds, 1, 3600), "60", "time limit for fetching a mesh from a URL"},
    {"cors", TEXT(cors), "", "origins that browsers may call from, comma-separated, or *"},
    {"log-level", TEXT(log_level), "info", "debug, info, warn or error"},
    {"log-format", TEXT(log_format), "json", "json or text"},
    {"traces", TEXT(traces), "",
     "URL of a collector of OpenTelemetry, such as http://localhost:4318: it gets spans of requests and jobs as JSON "
     "over HTTP; without it: none"},
    {"tls-certificate", TEXT(tls_certificate), "", "PEM file; with tls-key, the daemon speaks https"},
    {"tls-key", TEXT(tls_key), "", "PEM file"},
    {"tls-authorities", TEXT(tls_authorities), "",
     "PEM file of the authorities that webhooks and fetches trust; without it, those of the system"},
    {"auth", TEXT(auth), "loopback",
     "loopback: tokens are needed unless the daemon listens on loopback; on: always; off: never, a proxy checks"},
};
enum { ENTRIES = sizeof table / sizeof table[0] };

static const entry *find(const char *name, size_t length) {
  for (size_t i = 0; i < ENTRIES; i++) {
    if (strlen(table[i].name) == length && strncmp(table[i].name, name, length) == 0) {
      return &table[i];
    }
  }
  return NULL;
}

int config_number(const char *text, int64_t *out) {
  char *end;
  errno = 0;
  long long value = strtoll(text, &end, 10);
  if (end == text || errno || value < 0) {
    return 0;
  }
  const char *units = "KMG";
  const char *unit = *end ? strchr(units, toupper((unsigned char)*end)) : NULL;
  if (unit && *end) {
    for (long i = 0; i <= unit - units; i++) {
      if (__builtin_mul_overflow(value, 1024, &value)) {
        return 0;
      }
    }
    end++;
  }
  *out = value;
  return *end == 0;
}

static int set(config *out, const entry *e, const char *value, const char *from) {
  char *at = (char *)out + e->offset;
  if (e->size) {
    if (strlen(value) >= e->size) {
      config_complain("%s: %s is too long", from, e->name);
      return 0;
    }
    strcpy(at, value);
    return 1;
  }
  int64_t number;
  int is_default = strcmp(value, e->standard) == 0; /* a default of 0 may lie outside the range: "by the machine" */
  if (!config_number(value, &number) || (!is_default && (number < e->least || number > e->most))) {
    int64_t standard; /* worth naming where it lies outside the range */
    int apart = config_number(e->standard, &standard) && (standard < e->least || standard > e->most);
    config_complain("%s: %s must be %s%sa number from %lld to %lld, not \"%s\"", from, e->name,
                    apart ? e->standard : "", apart ? " or " : "", (long long)e->least, (long long)e->most, value);
    return 0;
  }
  memcpy(at, &number, sizeof number);
  return 1;
}

static char *trim(char *s) {
  while (isspace((unsigned char)*s)) {
    s++;
  }
  size_t n = strlen(s);
  while (n && isspace((unsigned char)s[n - 1])) {
    s[--n] = 0;
  }
  if (n >= 2 && s[0] == '"' && s[n - 1] == '"') {
    s[n - 1] = 0;
    s++;
  }
  return s;
}

static int read_file(config *out, const char *path) {
  FILE *file = fopen(path, "r");
  char line[4096];
  int number = 0, fine = 1;
  if (!file) {
    config_complain("the config file %s cannot be read: %s", path, strerror(errno));
    return 0;
  }
  while (fine && fgets(line, sizeof line, file)) {
    number++;
    char *at = trim(line), *equals = strchr(at, '=');
    if (*at == 0 || *at == '#') {
      continue;
    }
    char from[64];
    snprintf(from, sizeof from, "config file, line %d", number);
    if (equals) {
      *equals = 0;
    }
    char *name = trim(at);
    for (char *c = name; *c; c++) {
      *c = *c == '_' ? '-' : *c;
    }
    const entry *e = equals ? find(name, strlen(name)) : NULL;
    if (!equals) {
      config_complain("%s: a line must be NAME = VALUE, not \"%s\"", from, name);
      fine = 0;
    } else if (!e) {
      config_complain("%s: unknown name \"%s\"; see --help", from, name);
      fine = 0;
    } else {
      fine = set(out, e, trim(equals + 1), from);
    }
  }
  if (fine && ferror(file)) {
    config_complain("the config file %s cannot be read: %s", path, strerror(errno));
    fine = 0;
  }
  fclose(file);
  return fine;
}

static int read_environment(config *out) {
  for (size_t i = 0; i < ENTRIES; i++) {
    char name[64] = "ORBMORPH_";
    size_t n = strlen(name);
    for (const char *c = table[i].name; *c; c++) {
      name[n++] = *c == '-' ? '_' : (char)toupper((unsigned char)*c);
    }
    name[n] = 0;
    const char *value = getenv(name);
    if (value && !set(out, &table[i], value, name)) {
      return 0;
    }
  }
  return 1;
}

static void print_help(void) {
  puts(
      "orbmorphd: merges closed meshes into one GLB that morphs between them, over HTTP\n\n"
      "  orbmorphd [--NAME VALUE]…      run the daemon\n"
      "  orbmorphd --check-config       check the configuration and exit\n"
      "  orbmorphd --check-data         verify all objects and rows of the data folder\n"
      "  orbmorphd --gc                 delete derived objects beyond derived-bytes, ended jobs beyond\n"
      "                                 keep-jobs; move objects without a row to lost+found\n"
      "  orbmorphd backup DIR           copy the data folder to DIR as it is now, also while the daemon runs;\n"
      "                                 again into the same DIR: copies only what is new\n"
      "  orbmorphd restore DIR --data NEW\n"
      "                                 make a data folder from a backup; NEW must not exist or be empty;\n"
      "                                 again after a kill: goes on\n"
      "  orbmorphd migrate --from-data DIR [--from-catalogue URL] [--from-objects URL] [--from-s3-keys FILE]\n"
      "                    --data NEW [--catalogue URL] [--objects URL]\n"
      "                                 copy a deployment to another place, such as PostgreSQL and S3, or back;\n"
      "                                 no daemon runs meanwhile; again after a kill: goes on\n"
      "  orbmorphd token add NAME --scope read,write,admin [--tenant NAME] [--quota BYTES]\n"
      "                                 [--quota-derived BYTES] [--quota-jobs N] [--priority 0..9] [--expires "
      "30d|YYYY-MM-DD|never]\n"
      "  orbmorphd token set NAME [--scope …] [--quota …] [--quota-derived …] [--quota-jobs …]\n"
      "                                 [--priority …] [--expires …]\n"
      "  orbmorphd token list | token remove NAME\n"
      "                                 manage tokens, also while the daemon runs; give the same --data.\n"
      "                                 --tenant: the owner of what the token makes, by default NAME;\n"
      "                                 --quota: bytes of its meshes; --quota-derived: of what its jobs make;\n"
      "                                 --quota-jobs: its unfinished jobs\n"
      "  orbmorphd key add NAME [--tenant NAME] [--origin URL]… [--requests-per-day N] [--cpu-seconds-per-day N]\n"
      "  orbmorphd key rotate NAME [--overlap 7d]\n"
      "  orbmorphd key list | key remove NAME\n"
      "                                 manage the keys of signed URLs\n"
      "  orbmorphd webhook add NAME --url URL [--events succeeded,failed,cancelled] [--tenant NAME]\n"
      "  orbmorphd webhook rotate NAME [--overlap 7d]\n"
      "  orbmorphd webhook list | webhook remove NAME\n"
      "  orbmorphd webhook secret [--tenant NAME]\n"
      "                                 manage the webhooks that announce the ends of jobs; secret: print the secret\n"
      "                                 of webhooks that requests name\n"
      "  orbmorphd crash list | crash clear NAME\n"
      "                                 list the work whose processes died; clear allows it again\n"
      "  orbmorphd --version, --help\n\n"
      "Each NAME is also an environment variable (ORBMORPH_NAME) and a line of the config file. A flag overrides the\n"
      "environment, which overrides the file, which overrides the default in brackets.\n");
  for (size_t i = 0; i < ENTRIES; i++) {
    printf("  --%-24s %s [%s]\n", table[i].name, table[i].help, table[i].standard);
  }
}

/* Reads the flags. Called twice: the first pass only looks for --config. */
static config_action read_flags(config *out, int argc, char **argv, int only_file) {
  config_action action = CONFIG_RUN;
  for (int i = 1; i < argc; i++) {
    const char *flag = argv[i];
    static const struct {
      const char *flag;
      config_action action;
    } actions[] = {{"--check-config", CONFIG_CHECKED}, {"--check-data", CONFIG_CHECK_DATA}, {"--gc", CONFIG_GC}};
    size_t k = 0;
    while (k < 3 && strcmp(flag, actions[k].flag) != 0) {
      k++;
    }
    if (k < 3) {
      action = actions[k].action;
      continue;
    }
    if (strcmp(flag, "--version") == 0) {
      puts(ORB_ENGINE);
      return CONFIG_PRINTED;
    }
    if (strcmp(flag, "--help") == 0 || strcmp(flag, "-h") == 0) {
      print_help();
      return CONFIG_PRINTED;
    }
    const char *equals = strchr(flag, '=');
    size_t length = equals ? (size_t)(equals - flag) : strlen(flag);
    const entry *e = length > 2 && strncmp(flag, "--", 2) == 0 ? find(flag + 2, length - 2) : NULL;
    const char *value = equals ? equals + 1 : i + 1 < argc ? argv[++i] : NULL;
    if (!e || !value) {
      config_complain(e ? "%s needs a value" : "unknown option %s; see --help", flag);
      return CONFIG_BAD;
    }
    if ((!only_file || strcmp(e->name, "config") == 0) && !set(out, e, value, flag)) {
      return CONFIG_BAD;
    }
  }
  return action;
}

config_action config_read(config *out, int argc, char **argv) {
  memset(out, 0, sizeof *out);
  for (size_t i = 0; i < ENTRIES; i++) {
    if (!set(out, &table[i], table[i].standard, "default")) {
      return CONFIG_BAD;
    }
  }
  config_action action = read_flags(out, argc, argv, 1);
  if (action == CONFIG_BAD || action == CONFIG_PRINTED) {
    return action;
  }
  const char *from_environment = getenv("ORBMORPH_CONFIG");
  if (!out->file[0] && from_environment && !set(out, find("config", 6), from_environment, "ORBMORPH_CONFIG")) {
    return CONFIG_BAD;
  }
  if (out->file[0] && !read_file(out, out->file)) {
    return CONFIG_BAD;
  }
  if (!read_environment(out)) {
    return CONFIG_BAD;
  }
  action = read_flags(out, argc, argv, 0);
  return action == CONFIG_BAD || !config_is_consistent(out) ? CONFIG_BAD : action;
}

static int can_change(const char *name) {
  return strcmp(name, "log-level") == 0 || strcmp(name, "queue-limit") == 0 || strcmp(name, "derived-bytes") == 0 ||
         strcmp(name, "quota-derived") == 0 || strcmp(name, "keep-jobs") == 0;
}

int config_reload(config *live, int argc, char **argv, void (*changed)(const char *name, int taken)) {
  static config fresh; /* static because it is large; only the main thread gets here */
  config_complains_in_log();
  if (config_read(&fresh, argc, argv) != CONFIG_RUN) {
    return 0;
  }
  for (size_t i = 0; i < ENTRIES; i++) {
    const entry *e = &table[i];
    char *to = (char *)live + e->offset;
    const char *from = (const char *)&fresh + e->offset;
    if (e->size ? strcmp(to, from) == 0 : memcmp(to, from, sizeof(int64_t)) == 0) {
      continue;
    }
    int taken = can_change(e->name);
    if (taken && e->size) {
      memcpy(to, from, e->size);
    } else if (taken) {
      __atomic_store_n((int64_t *)(void *)to, *(const int64_t *)(const void *)from, __ATOMIC_RELAXED);
    }
    changed(e->name, taken);
  }
  return 1;
}
