/* Meshes as operands: an id, a file to upload, or a URL that the daemon fetches. */
#ifndef ORB_CLI_MESH_H
#define ORB_CLI_MESH_H

#include "http.h"

typedef struct cli_mesh {
  char *id, *name;
} cli_mesh;

/* Checks before any upload that an operand is an id, a URL or a file that can be read. CLI_DONE, or CLI_USAGE after
 * printing why. */
int cli_check_mesh(const cli *c, const char *operand);

/* Looks an id up, which may be given by its first digits, or takes a file or URL in. */
int cli_mesh_of(cli *c, const char *operand, cli_mesh *out);
void cli_mesh_free(cli_mesh *mesh);

/* Uploads a file; the response goes into reply whatever its status. name NULL: the file's name; repair NULL: the
 * daemon's default. */
int cli_upload(cli *c, const char *path, const char *name, const char *repair, cli_reply *reply);

/* Likewise for a file or a URL. The daemon fetches a URL in a job, and this waits for it; name NULL: the daemon chooses
 * the name. */
int cli_take_in(cli *c, const char *operand, const char *name, const char *repair, cli_reply *reply);

#endif
