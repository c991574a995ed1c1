#include "config_values.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "log.h"
#include "net/networks.h"
#include "net/s3_url.h"

static int to_log;

void config_complains_in_log(void) {
  to_log = 1;
}

void config_complain(const char *format, ...) {
  char text[1024];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  if (to_log) {
    log_error("SIGHUP: %s", text);
  } else {
    fprintf(stderr, "orbmorphd: %s\n", text);
  }
}

const char *config_catalogue(const config *options) {
  return strcmp(options->catalogue, "sqlite") == 0 ? NULL : options->catalogue;
}

int config_is_shared(const config *options) {
  return config_catalogue(options) != NULL && strcmp(options->objects, "files") != 0;
}

static int is_one_of(const char *name, const char *value, const char *const words[]) {
  char must[80] = "";
  for (int i = 0; words[i]; i++) {
    if (strcmp(value, words[i]) == 0) {
      return 1;
    }
    size_t n = strlen(must);
    snprintf(must + n, sizeof must - n, "%s%s", i == 0 ? "" : words[i + 1] ? ", " : " or ", words[i]);
  }
  config_complain("%s must be %s, not \"%s\"", name, must, value);
  return 0;
}

static int is_address(const char *name, const char *text) {
  const char *colon = strrchr(text, ':');
  size_t digits = colon ? strspn(colon + 1, "0123456789") : 0;
  int fine = strncmp(text, "unix:", 5) == 0
                 ? text[5] != 0
                 : digits > 0 && digits <= 5 && colon[1 + digits] == 0 && strtol(colon + 1, NULL, 10) <= 65535;
  if (!fine) {
    config_complain("%s must be ADDR:PORT, [V6]:PORT (a port from 0 to 65535) or unix:PATH, not \"%s\"", name, text);
  }
  return fine;
}

/* Whether all are origins as browsers send them: a scheme, a host, optionally a port, and no path. */
static int are_origins(const char *list) {
  if (strcmp(list, "*") == 0) {
    return 1;
  }
  for (const char *at = list + strspn(list, ", "); *at;) {
    size_t length = strcspn(at, ", ");
    const char *host = strstr(at, "://");
    size_t scheme = host ? (size_t)(host - at) : length;
    int fine = scheme > 0 && scheme + 3 < length && !memchr(host + 3, '/', length - scheme - 3);
    if (!fine && (length != 4 || strncmp(at, "null", 4) != 0)) {
      config_complain("cors must be *, or a list of origins such as https://app.example.org, not \"%.*s\"", (int)length,
                      at);
      return 0;
    }
    at += length;
    at += strspn(at, ", ");
  }
  return 1;
}

/* Whether all are hosts with an optional port, and not URLs. */
static int are_hosts(const char *list) {
  for (const char *at = list + strspn(list, ", "); *at; at += strspn(at, ", ")) {
    size_t length = strcspn(at, ", ");
    if (memchr(at, '/', length) || memchr(at, '@', length)) {
      config_complain("hosts must be *, or a list of names such as morph.example.org or 192.0.2.7:8080, not \"%.*s\"",
                      (int)length, at);
      return 0;
    }
    at += length;
  }
  return 1;
}

static int is_catalogue(const char *text) {
  int fine = strcmp(text, "sqlite") == 0 || strncmp(text, "postgresql://", 13) == 0;
  if (!fine) { /* what is wrong may hold a password */
    config_complain("catalogue must be sqlite, or a URL that begins with postgresql://");
  }
  return fine;
}

static int is_objects(const char *text) {
  s3_place place;
  const char *why;
  int fine = strcmp(text, "files") == 0 || s3_url_read(text, &place, &why);
  if (!fine) {
    config_complain("objects must be files, or a URL s3://BUCKET[/PREFIX]?endpoint=URL&region=R; %s", why);
  }
  return fine;
}

static int is_role(const config *options) {
  static const char *const roles[] = {"all", "serve", "work", NULL};
  int fine = is_one_of("role", options->role, roles);
  if (fine && strcmp(options->role, "all") != 0 && !config_is_shared(options)) {
    config_complain("role may be %s only with a catalogue in PostgreSQL and objects in S3", options->role);
    return 0;
  }
  return fine;
}

static int is_metrics_address(const config *options) {
  if (options->metrics_listen[0] && strcmp(options->role, "work") != 0) {
    config_complain("metrics-listen is for the role work; the role %s answers /metrics where it listens",
                    options->role);
    return 0;
  }
  return !options->metrics_listen[0] || is_address("metrics-listen", options->metrics_listen);
}

static int is_readable(const char *name, const char *path) {
  int fine = !*path || access(path, R_OK) == 0;
  if (!fine) {
    config_complain("%s: %s cannot be read: %s", name, path, strerror(errno));
  }
  return fine;
}

static int is_collector(const char *url) {
  const char *host = strncmp(url, "http://", 7) == 0 ? url + 7 : strncmp(url, "https://", 8) == 0 ? url + 8 : NULL;
  int fine = !*url || (host && *host && *host != '/' && !strpbrk(host, " ?#@"));
  if (!fine) {
    config_complain("traces must be a URL such as http://localhost:4318, without a user or a query");
  }
  return fine;
}

static int is_mode(const char *text) {
  char *end;
  long mode = strtol(text, &end, 8);
  int fine = end != text && !*end && mode >= 0 && mode <= 0777;
  if (!fine) {
    config_complain("socket-mode must be an octal number from 0 to 777, not \"%s\"", text);
  }
  return fine;
}

static int are_networks(const char *name, const char *list) {
  networks set;
  char wrong[NETWORKS_WRONG];
  int fine = networks_read(list, &set, wrong);
  if (!fine) {
    config_complain(
        "%s must be networks such as 10.1.0.0/16 or fd00::/8, comma-separated, at most %d; \"%s\" is not valid", name,
        NETWORKS_MOST, wrong);
  }
  return fine;
}

int config_is_consistent(config *out) {
  static const char *const limits[] = {"remote", "all", "off", NULL}, *const auth[] = {"loopback", "on", "off", NULL},
                           *const isolate[] = {"on", "off", "strict", NULL},
                           *const levels[] = {"debug", "info", "warn", "error", NULL},
                           *const formats[] = {"json", "text", NULL};
  static const char *const assets[] = {"stream", "redirect", NULL};
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
  if (out->workers == 0) {
    out->workers = cores > 0 ? (cores < 256 ? cores : 256) : 1;
  }
  if (out->job_memory == 0) {
    out->job_memory = (int64_t)sysconf(_SC_PHYS_PAGES) / 2 * sysconf(_SC_PAGESIZE);
  }
  const int64_t parts = out->decode_memory > out->encoded_bytes ? out->decode_memory : out->encoded_bytes;
  const int64_t least = parts + parts / 2; /* one owner gets two thirds (http/held.h) */
  out->request_memory = least > out->request_memory ? least : out->request_memory;
  if ((out->tls_certificate[0] == 0) != (out->tls_key[0] == 0)) {
    config_complain("tls-certificate and tls-key must both be set, or neither");
    return 0;
  }
  return is_address("listen", out->listen) && is_catalogue(out->catalogue) && is_objects(out->objects) &&
         is_role(out) && is_metrics_address(out) && is_mode(out->socket_mode) &&
         is_one_of("limits", out->limits, limits) && is_one_of("auth", out->auth, auth) &&
         is_one_of("assets", out->assets, assets) && is_readable("s3-keys", out->s3_keys) &&
         is_one_of("isolate", out->isolate, isolate) && is_one_of("log-level", out->log_level, levels) &&
         is_one_of("log-format", out->log_format, formats) && are_origins(out->cors) && are_hosts(out->hosts) &&
         is_collector(out->traces) && is_readable("tls-certificate", out->tls_certificate) &&
         is_readable("tls-key", out->tls_key) && is_readable("tls-authorities", out->tls_authorities) &&
         are_networks("webhook-allow", out->webhook_allow) && are_networks("fetch-allow", out->fetch_allow);
}
