#include "input.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "terminal.h"
#include "text.h"

/* How deep --set nests: in its dotted name, and again in its value. A request needs far less, and JSON parsers accept
 * far more (1,000). */
enum { SET_DEPTH_MOST = 64 };
/* Bytes of a file that is searched for landmarks: room for more landmarks than the daemon takes. */
enum { LANDMARK_FILE_MOST = 8 << 20 };

cJSON *cli_read_landmarks(const cli *c, const char *path) {
  size_t size;
  const char *end = NULL;
  char *text = cli_read_file(path, &size);
  if (!text) {
    return NULL;
  }
  cJSON *whole = cJSON_ParseWithLengthOpts(text, size + 1, &end, 1), *list = whole;
  if (!whole) {
    cli_error(c, "%s: not valid JSON at byte %zu", path, end ? (size_t)(end - text) : 0);
  } else if (cJSON_IsObject(whole)) {
    list = cJSON_DetachItemFromObjectCaseSensitive(whole, "landmarks");
    cJSON_Delete(whole);
  }
  free(text);
  if (whole && !cJSON_IsArray(list)) {
    cli_error(c, "%s: a landmark file is an array, or an object whose member \"landmarks\" is one", path);
    cJSON_Delete(list);
    return NULL;
  }
  for (cJSON *item = list ? list->child : NULL, *next; item; item = next) {
    next = item->next;
    if (!cJSON_IsArray(item)) {
      continue;
    }
    cJSON *landmark = cJSON_CreateObject(), *at = cJSON_AddArrayToObject(landmark, "at");
    for (const cJSON *vertex = item->child; vertex; vertex = vertex->next) {
      cJSON *place = cJSON_CreateObject();
      cJSON_AddItemToObject(place, "vertex", cJSON_Duplicate(vertex, 0));
      cJSON_AddItemToArray(at, place);
    }
    cJSON_ReplaceItemViaPointer(list, item, landmark);
  }
  return list;
}

int cli_holds_landmarks(const char *path) {
  struct stat info;
  size_t size;
  const char *dot = strrchr(path, '.');
  if (!dot || strcasecmp(dot, ".json") != 0 || stat(path, &info) != 0 || !S_ISREG(info.st_mode) ||
      info.st_size > LANDMARK_FILE_MOST) {
    return 0;
  }
  char *text = cli_read_file(path, &size);
  cJSON *whole = text ? cJSON_ParseWithLength(text, size) : NULL;
  int holds = cJSON_IsArray(whole) || cJSON_IsArray(cJSON_GetObjectItemCaseSensitive(whole, "landmarks"));
  cJSON_Delete(whole);
  free(text);
  return holds;
}

int cli_set_member(cJSON *object, const char *path, cJSON *value) {
  for (int depth = 0; depth < SET_DEPTH_MOST; depth++) {
    const char *dot = strchr(path, '.');
    char *name = cli_text("%.*s", (int)(dot ? dot - path : (long)strlen(path)), path);
    if (!dot) {
      int ok = *name && cJSON_IsObject(object);
      if (ok) {
        cJSON_DeleteItemFromObjectCaseSensitive(object, name);
        cJSON_AddItemToObject(object, name, value);
      } else {
        cJSON_Delete(value);
      }
      free(name);
      return ok;
    }
    cJSON *child = cJSON_GetObjectItemCaseSensitive(object, name);
    if (!child) {
      child = cJSON_AddObjectToObject(object, name);
    }
    free(name);
    if (!cJSON_IsObject(child)) {
      break;
    }
    object = child;
    path = dot + 1;
  }
  cJSON_Delete(value);
  return 0;
}

/* The nesting depth of the brackets of a JSON text. */
static int nesting(const char *text) {
  int depth = 0, most = 0, quoted = 0;
  for (; *text; text++) {
    if (quoted && *text == '\\' && text[1]) {
      text++;
    } else if (*text == '"') {
      quoted = !quoted;
    } else if (!quoted && (*text == '[' || *text == '{') && ++depth > most) {
      most = depth;
    } else if (!quoted && (*text == ']' || *text == '}')) {
      depth--;
    }
  }
  return most;
}

int cli_apply_sets(const cli *c, cJSON *request) {
  for (int i = 0; i < c->args.set_count; i++) {
    const char *text = c->args.sets[i], *equals = strchr(text, '=');
    char *path = equals ? cli_text("%.*s", (int)(equals - text), text) : NULL;
    cJSON *value = equals ? cJSON_ParseWithOpts(equals + 1, NULL, 1) : NULL;
    if (equals && !value) {
      value = cJSON_CreateString(equals + 1);
    }
    if (value && !cJSON_IsString(value) && nesting(equals + 1) > SET_DEPTH_MOST) {
      cJSON_Delete(value);
      value = NULL;
    }
    int ok = value && cli_set_member(request, path, value);
    free(path);
    if (!ok) {
      cli_error(c, "--set %s: expected NAME=VALUE, with dots between member names, nested at most %d deep", text,
                SET_DEPTH_MOST);
      return CLI_USAGE;
    }
  }
  return CLI_DONE;
}
