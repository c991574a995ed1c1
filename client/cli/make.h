/* Making a resource: the request, its further members, the wait. */
#ifndef ORB_CLI_MAKE_H
#define ORB_CLI_MAKE_H

#include "cli.h"

/* A landmark file is an array, or an object with one as its member `landmarks`. A landmark may also be a plain array
 * of vertex numbers, one a shape. The array; NULL, having said why. */
cJSON *cli_read_landmarks(const cli *c, const char *path);

/* Sets the member at a dotted path, its parents made where they are missing; takes the value. 0 if there is no place. */
int cli_set_member(cJSON *object, const char *path, cJSON *value);

/* Puts each --set NAME=VALUE into the request; CLI_DONE or CLI_USAGE, having said why. */
int cli_apply_sets(const cli *c, cJSON *request);

/* Posts a request, waits for its job and fetches the resource into reply. With --no-wait it prints the job, and
 * reply->json stays NULL. */
int cli_make(cli *c, const char *path, cJSON *body, cli_reply *resource);

#endif
