/* Ids that are given by their first digits. */
#ifndef ORB_CLI_PREFIX_H
#define ORB_CLI_PREFIX_H

#include "http.h"

/* Whether a text is the beginning of an id: 4 to 63 hexadecimal digits in lower case, but not 32, which are the id of a
 * job. */
int cli_is_prefix(const char *text);

/* Finds the only entry of these collections (a list that ends in NULL) whose id begins with the digits. *path: its
 * path, which the caller frees; NULL unless CLI_DONE. If there are several, prints them. */
int cli_resolve(cli *c, const char *digits, const char *const *collections, char **path);

#endif
