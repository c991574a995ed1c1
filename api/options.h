/* Tables of request members: name, kind, range and offset in a struct. The same table drives the parser, which refuses
 * unknown members by name and checks values, and the writer of the canonical text, which follows the order of the
 * table. */
#ifndef ORB_API_OPTIONS_H
#define ORB_API_OPTIONS_H

#include <cjson/cJSON.h>

#include "api/problem.h"

typedef enum api_option_kind {
  API_OPTION_NUMBER, /* double */
  API_OPTION_INT32,
  API_OPTION_INT64,
  API_OPTION_BOOL, /* int */
  API_OPTION_NAME, /* an enum, whose names are in words */
} api_option_kind;

typedef struct api_option {
  const char *name;
  api_option_kind kind;
  size_t offset;
  double least, most;       /* the range of a number, inclusive */
  const char *const *words; /* the names in enum order, NULL-terminated */
} api_option;

/* Reads the members of an object into base. Returns 1, or 0 with *problem filled. where: names the object in messages,
 * such as "options". */
int api_options_read(const cJSON *object, const char *where, const api_option *table, size_t count, void *base,
                     api_problem *problem);

/* Appends an object with the values that differ from defaults, or with all values if defaults is NULL. */
void api_options_write(api_text *out, const api_option *table, size_t count, const void *base, const void *defaults);

/* Refuses members that are not in the NULL-terminated list. Returns 1, or 0 with *problem filled. */
int api_members_known(const cJSON *object, const char *where, const char *const *names, api_problem *problem);

#endif
