/* Problems: RFC 9457 documents for everything that can go wrong on the wire. */
#ifndef ORB_API_PROBLEM_H
#define ORB_API_PROBLEM_H

#include "api/text.h"
#include "orbmorph/context.h"

/* name: of /problems/NAME; must be one of the table in problem.c, which holds title and status. */
typedef struct api_problem {
  const char *name; /* a literal; NULL: no problem */
  char detail[512];
  api_text facts; /* members without braces: "\"genus\":1"; may be empty */
} api_problem;

int api_problem_status(const char *name);
const char *api_problem_title(const char *name);
void api_problem_free(api_problem *problem);

/* Fills *problem (freed first) and returns 0, so that a parser can `return api_refuse(…)`. */
int api_refuse(api_problem *problem, const char *name, const char *format, ...) ORB_PRINTF(3, 4);

/* From an error of the library, with its facts. */
void api_problem_of_error(const orb_error *error, api_problem *problem);

/* Appends the document. extra: further members without braces, or NULL. */
void api_problem_write(const api_problem *problem, api_text *out);

/* All names, for the document of the API: NULL-terminated by name. */
const char *api_problem_name_at(size_t index);

#endif
