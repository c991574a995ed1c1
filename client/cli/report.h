/* Resources in words: on the terminal, and as a report in Markdown. */
#ifndef ORB_CLI_REPORT_H
#define ORB_CLI_REPORT_H

#include "http.h"

void cli_print_mesh(const cJSON *mesh);
void cli_print_repairs(const cJSON *mesh); /* the repairs made at upload */
void cli_print_embedding(const cJSON *embedding);
void cli_print_supermesh(const cJSON *supermesh);
void cli_print_job(const cJSON *job);

/* Writes Markdown if the path ends in .md, else the daemon's JSON. Returns CLI_DONE, or CLI_USAGE after printing the
 * error. */
int cli_write_report(cli *c, const char *path, const cli_reply *supermesh);

#endif
