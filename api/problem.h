/* Problems: the RFC 9457 documents of all errors on the wire. */
#ifndef ORB_API_PROBLEM_H
#define ORB_API_PROBLEM_H

#include "api/text.h"
#include "orbmorph/context.h"

/* name: the NAME of /problems/NAME. The table in problem.c lists all names with title and status. */
typedef struct api_problem {
  const char *name; /* a literal; NULL: no problem */
  char detail[512];
  api_text facts; /* further members without braces, such as "\"genus\":1"; may be empty */
} api_problem;

int api_problem_status(const char *name);
/* The literal of this name; "internal" where no problem has it. */
const char *api_problem_name(const char *name);
void api_problem_free(api_problem *problem);

/* Frees *problem, fills it and returns 0, so that a parser can `return api_refuse(…)`. */
int api_refuse(api_problem *problem, const char *name, const char *format, ...) API_PRINTF(3, 4);

/* Fills *problem from an error of the library, with its facts. */
void api_problem_of_error(const orb_error *error, api_problem *problem);

/* Leaves out the last loops of a refusal for handles, so that those that stay take at most `most` bytes; loops_left_out
 * counts them. Facts of at most `most` bytes stay as they are; others must be valid JSON. Without memory facts.failed
 * is set. */
void api_problem_shorten(api_problem *problem, size_t most);

/* Appends the document. */
void api_problem_write(const api_problem *problem, api_text *out);

#endif
