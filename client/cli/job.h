/* Waiting for a job. */
#ifndef ORB_CLI_JOB_H
#define ORB_CLI_JOB_H

#include <cjson/cJSON.h>

#include "cli.h"

/* Waits until a job, given as the daemon's JSON, has ended. *result is the path of what it made; the caller frees it.
 * Returns CLI_DONE if the job succeeded. */
int cli_wait(cli *c, const cJSON *job, char **result);

#endif
