#include "resource.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "job.h"
#include "prefix.h"
#include "problem.h"
#include "terminal.h"
#include "text.h"

static char *resource_path(const char *collection, const char *operand) {
  const char *authority = strstr(operand, "://");
  if (authority) {
    const char *slash = strchr(authority + 3, '/');
    return cli_text("%s", slash ? slash : "/");
  }
  return operand[0] == '/' ? cli_text("%s", operand) : cli_text("/v1/%s/%s", collection, operand);
}

int cli_not_found(cli *c, const char *kind, const char *operand, const cli_reply *reply) {
  if (reply->status != 404 || c->json || operand[0] == '/') {
    return cli_refused(c, operand, reply);
  }
  cli_error(c, "%s: not-found: no %s has this id; 'orbmorph ls' lists the ids", operand, kind);
  return CLI_REFUSED;
}

int cli_locate(cli *c, const char *collection, const char *operand, char **path) {
  if (cli_is_prefix(operand)) {
    return cli_resolve(c, operand, (const char *const[]){collection, NULL}, path);
  }
  *path = resource_path(collection, operand);
  return CLI_DONE;
}

int cli_find(cli *c, const char *operand, char **path, cli_reply *reply) {
  static const char *const collections[] = {"supermeshes", "meshes", "embeddings", "jobs", NULL};
  int rc = CLI_DONE;
  if (cli_is_prefix(operand)) {
    rc = cli_resolve(c, operand, collections, path);
    return rc == CLI_DONE ? cli_get(c, *path, reply) : rc;
  }
  for (size_t i = 0; i < 4; i++) {
    *path = resource_path(collections[i], operand);
    rc = cli_get(c, *path, reply);
    if (rc != CLI_DONE || reply->status != 404 || i == 3 || operand[0] == '/') {
      break;
    }
    cli_reply_free(reply);
    free(*path);
  }
  if (rc == CLI_DONE && !cli_ok(reply)) {
    rc = cli_not_found(c, "mesh, embedding, supermesh or job", operand, reply);
  }
  return rc;
}

/* Whether the bytes go straight to a device or a pipe. A file is replaced by one that was written beside it instead. */
static int is_stream(const char *file) {
  struct stat info;
  return !strcmp(file, "-") || (stat(file, &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode));
}

static char *part_of(const char *file) {
  return cli_text("%s.part-%ld", file, (long)getpid());
}

int cli_name_fits(const char *file, const char *endings) {
  const char *slash = strrchr(file, '/'), *name = slash ? slash + 1 : file, *dot = strrchr(name, '.');
  for (const char *word = endings; word && dot && dot > name && *word; word += strspn(word, " ")) {
    size_t length = strcspn(word, " ");
    if (strlen(dot + 1) == length && !strncasecmp(dot + 1, word, length)) {
      return 1;
    }
    word += length;
  }
  return !endings || !dot || dot == name;
}

int cli_can_write(const cli *c, const char *file, const char *endings) {
  struct stat info;
  if (!file || is_stream(file)) {
    return CLI_DONE;
  }
  if (!cli_name_fits(file, endings)) {
    char *base = cli_base_name(file);
    cli_error(c, "%s: this command cannot write that format; name the file %s.%.*s", file, base,
              (int)strcspn(endings, " "), endings);
    free(base);
    return CLI_USAGE;
  }
  char *part = part_of(file);
  FILE *out = NULL;
  if (stat(file, &info) == 0 && S_ISDIR(info.st_mode)) {
    errno = EISDIR;
  } else {
    out = fopen(part, "wb");
  }
  if (out) {
    fclose(out);
    unlink(part);
  } else {
    cli_error(c, "cannot write %s: %s", file, strerror(errno));
  }
  free(part);
  return out ? CLI_DONE : CLI_USAGE;
}

/* Copies a downloaded file to a device or a pipe, "-" for standard output. 0 on failure. */
static int copy_to(FILE *from, const char *file) {
  char block[1 << 16];
  FILE *to = strcmp(file, "-") ? fopen(file, "wb") : stdout;
  int fine = to != NULL;
  rewind(from);
  for (size_t got; fine && (got = fread(block, 1, sizeof block, from)) > 0;) {
    fine = fwrite(block, 1, got, to) == got;
  }
  if (to && to != stdout) {
    fine &= fclose(to) == 0;
  }
  return fine || to == stdout; /* main() checks standard output */
}

int cli_check_profile(cli *c) {
  const char *profile = c->args.value[OPT_PROFILE];
  int fine = !profile || !strcmp(profile, "float") || !strcmp(profile, "quantized") || !strcmp(profile, "meshopt");
  if (!fine) {
    cli_error(c, "--profile takes float, quantized or meshopt");
  }
  return fine;
}

char *cli_asset_path(const cli *c, const char *path) {
  const char *profile = c->args.value[OPT_PROFILE];
  return profile ? cli_text("%s?profile=%s", path, profile) : cli_text("%s", path);
}

int cli_download(cli *c, const char *path, const char *file) {
  int streams = is_stream(file);
  char *part = streams ? NULL : part_of(file);
  FILE *out = streams ? tmpfile() : fopen(part, "w+b");
  cli_reply reply = {0};
  if (!out) {
    cli_error(c, "%s: %s", file, strerror(errno));
    free(part);
    return CLI_USAGE;
  }
  cli_request request = {.method = "GET", .path = path, .download = out, .label = "download", .patient = 1};
  int rc = cli_send(c, &request, &reply);
  cli_bar_end(c);
  if (rc == CLI_DONE && !cli_ok(&reply)) {
    rc = cli_refused(c, path, &reply);
  }
  if (rc == CLI_DONE && streams && !copy_to(out, file)) {
    cli_error(c, "%s: %s", file, strerror(errno));
    rc = CLI_USAGE;
  }
  int closed = fclose(out) == 0;
  if (part && rc == CLI_DONE && (!closed || rename(part, file) != 0)) {
    cli_error(c, "%s: %s", file, strerror(errno));
    rc = CLI_USAGE;
  }
  if (part && rc != CLI_DONE) {
    unlink(part);
  }
  cli_reply_free(&reply);
  free(part);
  return rc;
}

int cli_await(cli *c, cli_reply *reply) {
  char *result = NULL;
  int rc = cli_wait(c, reply->json, &result);
  cli_reply_free(reply);
  if (rc == CLI_DONE) {
    cli_request get = {.method = "GET", .path = result, .patient = 1};
    rc = cli_send(c, &get, reply);
    if (rc == CLI_DONE && !cli_ok(reply)) {
      rc = cli_refused(c, NULL, reply);
    }
  }
  free(result);
  return rc;
}

int cli_make(cli *c, const char *path, cJSON *body, cli_reply *resource) {
  char *text = cJSON_PrintUnformatted(body);
  cli_request request = {.method = "POST", .path = path, .json = text};
  int rc = cli_send(c, &request, resource);
  if (rc == CLI_DONE && !cli_ok(resource)) {
    rc = cli_refused(c, NULL, resource);
  } else if (rc == CLI_DONE && resource->status == 202 && c->args.value[OPT_NO_WAIT]) {
    if (c->json) {
      puts(resource->body);
    } else {
      printf("%s\n", cli_string(resource->json, "url", "?"));
    }
    cli_reply_free(resource);
  } else if (rc == CLI_DONE && resource->status == 202) {
    rc = cli_await(c, resource);
  }
  free(text);
  return rc;
}
