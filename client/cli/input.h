/* User input that becomes part of a request: landmark files and --set. */
#ifndef ORB_CLI_INPUT_H
#define ORB_CLI_INPUT_H

#include <cjson/cJSON.h>

#include "cli.h"

/* Reads a landmark file: an array of landmarks, or an object whose member "landmarks" is one. A landmark may also be an
 * array of vertex numbers, one for each shape. Returns the array, or NULL after printing the error. */
cJSON *cli_read_landmarks(const cli *c, const char *path);

/* Whether a file that is named as a mesh is a landmark file: a .json that cli_read_landmarks() reads. */
int cli_holds_landmarks(const char *path);

/* Sets the member at a dotted path and creates missing parents; takes ownership of the value. Returns 0 if the path is
 * not valid or a parent is not an object. */
int cli_set_member(cJSON *object, const char *path, cJSON *value);

/* Applies each --set NAME=VALUE to the request. Returns CLI_DONE, or CLI_USAGE after printing the error. */
int cli_apply_sets(const cli *c, cJSON *request);

#endif
