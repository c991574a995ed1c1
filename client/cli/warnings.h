/* Warnings about a supermesh, from its report. */
#ifndef ORB_CLI_WARNINGS_H
#define ORB_CLI_WARNINGS_H

#include <cjson/cJSON.h>
#include <stdio.h>

/* Writes a line for each warning, beginning with `bullet`; returns their number. The limits are those of
 * docs/report.md.
 */
int cli_warnings(FILE *out, const char *bullet, const cJSON *supermesh);

#endif
