/* The daemon's resources: finding, making and downloading them. */
#ifndef ORB_CLI_RESOURCE_H
#define ORB_CLI_RESOURCE_H

#include "http.h"

/* The path of an operand: "/v1/jobs/ID" for an id or its first digits, the path of a URL, or a path as it is. The
 * caller frees *path. Where it does not return CLI_DONE, it has printed why, and *path is NULL. */
int cli_locate(cli *c, const char *collection, const char *operand, char **path);

/* Finds the collection that holds an id; fetches the resource into reply. The caller frees *path and the reply. */
int cli_find(cli *c, const char *operand, char **path, cli_reply *reply);

/* Prints that no resource of this kind has the id if the reply is 404, else what the reply says. Returns CLI_REFUSED.
 */
int cli_not_found(cli *c, const char *kind, const char *operand, const cli_reply *reply);

/* Posts a request, waits for its job and fetches the resource into `resource`. With --no-wait it prints the job, and
 * resource->json stays NULL. */
int cli_make(cli *c, const char *path, cJSON *body, cli_reply *resource);

/* Waits for the job in a reply and fetches what it made in place of the job. */
int cli_await(cli *c, cli_reply *reply);

/* Checks before any work that a file can be written and that its name fits what will be in it: it ends in one of the
 * `endings`, such as "glb" or "md json" (NULL: any), or has no ending. NULL, "-", devices and pipes pass. Returns
 * CLI_DONE, or CLI_USAGE after printing the error. */
int cli_can_write(const cli *c, const char *file, const char *endings);
/* Whether a name has no ending, or one of these. */
int cli_name_fits(const char *file, const char *endings);
/* Whether --profile is a known one; prints the error. */
int cli_check_profile(cli *c);
/* The path of an asset in the profile that --profile names. The caller frees it. */
char *cli_asset_path(const cli *c, const char *path);

/* Downloads a resource into a file ("-": standard output); a temporary file beside it receives the bytes first. */
int cli_download(cli *c, const char *path, const char *file);

#endif
