/* Members of a request by table: name, type, range, place in a struct. One table serves parsing (unknown members are
 * refused by name, values checked) and the canonical text (values that differ from the default, in table order). */
#ifndef ORB_API_OPTIONS_H
#define ORB_API_OPTIONS_H

#include <cjson/cJSON.h>

#include "api/problem.h"

typedef enum orb_option_kind {
  ORB_OPTION_NUMBER, /* double */
  ORB_OPTION_INT32,
  ORB_OPTION_INT64,
  ORB_OPTION_UINT64,
  ORB_OPTION_BOOL, /* int */
  ORB_OPTION_NAME, /* an enum; its names in words */
} orb_option_kind;

typedef struct orb_option {
  const char *name;
  orb_option_kind kind;
  size_t offset;
  double least, most;       /* of numbers, both allowed */
  const char *const *words; /* of names, NULL-terminated, in enum order */
} orb_option;

/* Reads the members of an object into base. where: for messages, e.g. "options". 1, or 0 with the problem. */
int orb_options_read(const cJSON *object, const char *where, const orb_option *table, size_t count, void *base,
                     orb_problem *problem);

/* Appends an object of the values; those equal to defaults are left out unless defaults is NULL. */
void orb_options_write(orb_text *out, const orb_option *table, size_t count, const void *base, const void *defaults);

/* Refuses members beside the names (NULL-terminated). 1 fine, 0 refused. */
int orb_members_known(const cJSON *object, const char *where, const char *const *names, orb_problem *problem);

#endif
