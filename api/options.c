#include "api/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double EXACT = 9007199254740992.0; /* 2^53: doubles represent all integers up to it exactly */

int api_members_known(const cJSON *object, const char *where, const char *const *names, api_problem *problem) {
  for (const cJSON *m = object->child; m; m = m->next) {
    size_t i = 0;
    while (names[i] && strcmp(names[i], m->string) != 0) {
      i++;
    }
    if (!names[i]) {
      api_refuse(problem, "unknown-member", "There is no member \"%.100s\" in %s. Correct its spelling or remove it.",
                 m->string, where);
      api_json_member_string(&problem->facts, "member", m->string);
      return 0;
    }
  }
  return 1;
}

static int bad(api_problem *problem, const char *where, const char *name, const char *must) {
  api_refuse(problem, "bad-option", "\"%s\" in %s must be %s.", name, where, must);
  api_json_member_string(&problem->facts, "member", name);
  return 0;
}

static int read_number(const cJSON *value, const char *where, const api_option *o, char *to, api_problem *problem) {
  char must[120];
  double x = value->valuedouble;
  int whole = o->kind != API_OPTION_NUMBER;
  snprintf(must, sizeof must, whole ? "a whole number from %.17g to %.17g" : "a number from %.10g to %.10g", o->least,
           o->most);
  if (!cJSON_IsNumber(value) || !(x >= o->least && x <= o->most) || (whole && (x != floor(x) || fabs(x) > EXACT))) {
    return bad(problem, where, o->name, must);
  }
  if (o->kind == API_OPTION_NUMBER) {
    x = x == 0 ? 0 : x; /* −0 is 0 */
    memcpy(to, &x, sizeof x);
  } else if (o->kind == API_OPTION_INT32) {
    memcpy(to, &(int32_t){(int32_t)x}, sizeof(int32_t));
  } else {
    memcpy(to, &(int64_t){(int64_t)x}, sizeof(int64_t));
  }
  return 1;
}

static int read_name(const cJSON *value, const char *where, const api_option *o, char *to, api_problem *problem) {
  char must[256] = "one of";
  for (int i = 0; o->words[i]; i++) {
    if (cJSON_IsString(value) && strcmp(o->words[i], value->valuestring) == 0) {
      memcpy(to, &i, sizeof i);
      return 1;
    }
    size_t used = strlen(must);
    snprintf(must + used, sizeof must - used, "%s %s", i ? "," : "", o->words[i]);
  }
  return bad(problem, where, o->name, must);
}

static int read_one(const cJSON *value, const char *where, const api_option *o, void *base, api_problem *problem) {
  char *to = (char *)base + o->offset;
  if (o->kind == API_OPTION_BOOL) {
    if (!cJSON_IsBool(value)) {
      return bad(problem, where, o->name, "true or false");
    }
    memcpy(to, &(int){cJSON_IsTrue(value)}, sizeof(int));
    return 1;
  }
  return o->kind == API_OPTION_NAME ? read_name(value, where, o, to, problem)
                                    : read_number(value, where, o, to, problem);
}

int api_options_read(const cJSON *object, const char *where, const api_option *table, size_t count, void *base,
                     api_problem *problem) {
  if (!cJSON_IsObject(object)) {
    return api_refuse(problem, "invalid-request", "%s must be a JSON object.", where);
  }
  for (const cJSON *m = object->child; m; m = m->next) {
    size_t i = 0;
    while (i < count && strcmp(table[i].name, m->string) != 0) {
      i++;
    }
    if (i == count) {
      static const char *const none[] = {NULL};
      return api_members_known(&(cJSON){.child = (cJSON *)m}, where, none, problem);
    }
    if (!read_one(m, where, &table[i], base, problem)) {
      return 0;
    }
  }
  return 1;
}

static size_t size_of(const api_option *o) {
  return o->kind == API_OPTION_INT32 || o->kind == API_OPTION_BOOL || o->kind == API_OPTION_NAME ? 4 : 8;
}

static void write_one(api_text *out, const api_option *o, const char *from) {
  double number;
  int64_t wide;
  int32_t narrow;
  api_json_key(out, o->name);
  switch (o->kind) {
    case API_OPTION_NUMBER:
      memcpy(&number, from, sizeof number);
      api_json_number(out, number);
      break;
    case API_OPTION_INT64:
      memcpy(&wide, from, sizeof wide);
      api_json_integer(out, wide);
      break;
    default:
      memcpy(&narrow, from, sizeof narrow);
      if (o->kind == API_OPTION_NAME) {
        api_json_string(out, o->words[narrow]);
      } else if (o->kind == API_OPTION_BOOL) {
        api_json_bool(out, narrow);
      } else {
        api_json_integer(out, narrow);
      }
  }
}

void api_options_write(api_text *out, const api_option *table, size_t count, const void *base, const void *defaults) {
  api_json_open(out, '{');
  for (size_t i = 0; i < count; i++) {
    const char *from = (const char *)base + table[i].offset;
    if (!defaults || memcmp(from, (const char *)defaults + table[i].offset, size_of(&table[i])) != 0) {
      write_one(out, &table[i], from);
    }
  }
  api_json_close(out, '}');
}
