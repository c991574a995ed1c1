/* Meshes as operands: an id, a file to upload, or a URL that the daemon fetches. */
#ifndef ORB_CLI_MESH_H
#define ORB_CLI_MESH_H

#include "http.h"

typedef struct cli_mesh {
  char *id, *name;
} cli_mesh;

/* What the daemon may do to a file. NULL: its default. */
typedef struct cli_repairs {
  const char *list, *handle_size, *part;
} cli_repairs;

/* Checks before any upload that all operands are ids, URLs or files that can be read, and that the options of repairs
 * fit them. CLI_DONE, or CLI_USAGE after printing why. */
int cli_check_meshes(const cli *c);

/* Looks up the id that an operand is, which may be given by its first digits, or takes a file or URL in. */
int cli_mesh_of(cli *c, int operand, cli_mesh *out);
void cli_mesh_free(cli_mesh *mesh);

/* Uploads a file; the response goes into reply whatever its status. name NULL: the file's name. */
int cli_upload(cli *c, const char *path, const char *name, const cli_repairs *repairs, cli_reply *reply);

/* Likewise for an operand that is a file or a URL, with the repairs of the options. The daemon fetches a URL in a job,
 * and this waits for it; name NULL: the daemon chooses the name. */
int cli_take_in(cli *c, int operand, const char *name, cli_reply *reply);

#endif
