/* The daemon's problems (RFC 9457), printed for people. */
#ifndef ORB_CLI_PROBLEM_H
#define ORB_CLI_PROBLEM_H

#include "http.h"

/* Print a problem, or a response that is an error; subject: the file or id it concerns, or NULL. Return CLI_REFUSED. */
int cli_problem(cli *c, const char *subject, const cJSON *problem);
int cli_refused(cli *c, const char *subject, const cli_reply *reply);

const char *cli_problem_type(const cJSON *problem); /* the last part of its type: "not-closed" */
/* What the owner of a mesh can do about a problem of this type; NULL if there is no advice. */
const char *cli_advice(const char *type);

#endif
