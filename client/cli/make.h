/* Making a resource: the request, its further members, the wait. */
#ifndef ORB_CLI_MAKE_H
#define ORB_CLI_MAKE_H

#include "cli.h"

/* Puts each --set NAME=VALUE into the request; CLI_DONE or CLI_USAGE, having said why. */
int cli_apply_sets(const cli *c, cJSON *request);

/* Posts a request, waits for its job and fetches the resource into reply. With --no-wait it prints the job, and
 * reply->json stays NULL. */
int cli_make(cli *c, const char *path, cJSON *body, cli_reply *resource);

#endif
