/* Members of a request by table: name, type, range, place in a struct. One table serves parsing (unknown members are
 * refused by name, values checked) and the canonical text (values that differ from the default, in table order). */
#ifndef ORB_API_OPTIONS_H
#define ORB_API_OPTIONS_H

#include <cjson/cJSON.h>

#include "api/problem.h"

typedef enum api_option_kind {
  API_OPTION_NUMBER, /* double */
  API_OPTION_INT32,
  API_OPTION_INT64,
  API_OPTION_BOOL, /* int */
  API_OPTION_NAME, /* an enum; its names in words */
} api_option_kind;

typedef struct api_option {
  const char *name;
  api_option_kind kind;
  size_t offset;
  double least, most;       /* of numbers, both allowed */
  const char *const *words; /* of names, NULL-terminated, in enum order */
} api_option;

/* Reads the members of an object into base. where: for messages, e.g. "options". 1, or 0 with the problem. */
int api_options_read(const cJSON *object, const char *where, const api_option *table, size_t count, void *base,
                     api_problem *problem);

/* Appends an object of the values; those equal to defaults are left out unless defaults is NULL. */
void api_options_write(api_text *out, const api_option *table, size_t count, const void *base, const void *defaults);

/* Refuses members beside the names (NULL-terminated). 1 fine, 0 refused. */
int api_members_known(const cJSON *object, const char *where, const char *const *names, api_problem *problem);

#endif
