#include "audit.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "api/json.h"
#include "log.h"

static const char name[] = "audit.pending";

static void path_of(const char *data, char path[PATH_MAX]) {
  snprintf(path, PATH_MAX, "%s/%s", data, name);
}

/* The members that name a user. The name is left out where the system knows none. */
static void write_user(uid_t who, api_text *out) {
  char room[4096];
  struct passwd entry, *found = NULL;
  api_json_member_integer(out, "uid", (int64_t)who);
  if (getpwuid_r(who, &entry, room, sizeof room, &found) == 0 && found) {
    api_json_member_string(out, "user", entry.pw_name);
  }
}

/* Logs the members of an object. */
static void log_members(api_text *object, const char *message) {
  api_json_close(object, '}');
  if (!object->failed) {
    object->data[object->size - 1] = 0;
    log_write(LOG_INFO, object->data + 1, "%s", message);
  }
  api_text_free(object);
}

void audit_log(uid_t who, const char *message) {
  api_text object = {0};
  api_json_open(&object, '{');
  api_json_member_string(&object, "audit", "command");
  write_user(who, &object);
  log_members(&object, message);
}

/* Opens what a command appends to: an ordinary file under this one name. Root must not write to another file that the
 * daemon's user has linked there, nor give it away. */
static int open_file(const char *data, const char *path) {
  enum { FLAGS = O_WRONLY | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK };
  struct stat folder, found;
  int file = open(path, FLAGS | O_CREAT | O_EXCL, 0600);
  int fine = file >= 0;
  if (fine && geteuid() == 0) { /* the daemon's user, who owns the folder, has to read it */
    fine = stat(data, &folder) == 0 && fchown(file, folder.st_uid, folder.st_gid) == 0;
  } else if (!fine && errno == EEXIST) {
    file = open(path, FLAGS);
    fine = file >= 0 && fstat(file, &found) == 0;
    if (fine && (!S_ISREG(found.st_mode) || found.st_nlink != 1)) {
      errno = EMLINK;
      fine = 0;
    }
  }
  if (!fine && file >= 0) {
    int why = errno;
    close(file);
    errno = why;
  }
  return fine ? file : -1;
}

int audit_open(const char *data) {
  char path[PATH_MAX];
  path_of(data, path);
  int file = open_file(data, path);
  if (file < 0) {
    log_error("nothing was done: the command cannot be recorded for the audit log in %s: %s", path, strerror(errno));
  }
  return file;
}

int audit_keep(int file, const char *message) {
  struct timespec now;
  api_text line = {0};
  clock_gettime(CLOCK_REALTIME, &now);
  api_json_open(&line, '{');
  api_json_member_instant(&line, "made", (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000);
  api_json_member_string(&line, "message", message);
  write_user(geteuid(), &line);
  api_json_close(&line, '}');
  api_text_add(&line, "\n");
  const off_t before = lseek(file, 0, SEEK_END);
  errno = line.failed ? ENOMEM : ENOSPC; /* a write that is cut short says nothing */
  int fine = !line.failed && write(file, line.data, line.size) == (ssize_t)line.size && fsync(file) == 0;
  if (!fine) {
    log_error("the audit log will lack \"%s\": %s", message, strerror(errno));
    if (before < 0 || ftruncate(file, before) != 0) { /* or half a line would spoil the next one */
      log_error("the end of the file %s cannot be removed: %s", name, strerror(errno));
    }
  }
  api_text_free(&line);
  close(file);
  return fine;
}

/* Logs a line of the file. 0: it is none, such as half of one after a crash. */
static int bring_line(const char *text) {
  cJSON *line = cJSON_Parse(text);
  const cJSON *made = cJSON_GetObjectItemCaseSensitive(line, "made");
  const cJSON *message = cJSON_GetObjectItemCaseSensitive(line, "message");
  const cJSON *uid = cJSON_GetObjectItemCaseSensitive(line, "uid");
  const cJSON *user = cJSON_GetObjectItemCaseSensitive(line, "user");
  int fine = cJSON_IsString(made) && cJSON_IsString(message) && cJSON_IsNumber(uid);
  if (fine) {
    api_text object = {0};
    api_json_open(&object, '{');
    api_json_member_string(&object, "audit", "command");
    api_json_member_integer(&object, "uid", (int64_t)uid->valuedouble);
    if (cJSON_IsString(user)) {
      api_json_member_string(&object, "user", user->valuestring);
    }
    api_json_member_bool(&object, "without_daemon", 1);
    api_json_member_string(&object, "made", made->valuestring);
    log_members(&object, message->valuestring);
  }
  cJSON_Delete(line);
  return fine;
}

void audit_bring(const char *data) {
  char path[PATH_MAX], *text = NULL;
  size_t room = 0;
  int bad = 0;
  if (!log_wants(LOG_INFO)) { /* they wait for a daemon that logs them */
    return;
  }
  path_of(data, path);
  FILE *in = fopen(path, "re");
  if (!in) {
    if (errno != ENOENT) {
      log_warn("the audit log may lack commands that were given without the daemon: %s: %s", path, strerror(errno));
    }
    return;
  }
  while (getline(&text, &room, in) > 0) {
    bad += !bring_line(text);
  }
  if (bad || ferror(in)) {
    log_warn("the audit log may lack commands that were given without the daemon: %s has %d line%s that cannot be read",
             path, bad, bad == 1 ? "" : "s");
  }
  const int is_read = !ferror(in);
  free(text);
  fclose(in);
  if (is_read && unlink(path) != 0) {
    log_warn("the audit log will have commands that were given without the daemon twice: %s: %s", path,
             strerror(errno));
  }
}
