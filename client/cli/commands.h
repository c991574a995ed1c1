/* The commands. Each returns the exit status of the program. */
#ifndef ORB_CLI_COMMANDS_H
#define ORB_CLI_COMMANDS_H

#include "cli.h"

int cli_run_morph(cli *c);
int cli_run_merge(cli *c);
int cli_run_upload(cli *c);
int cli_run_embed(cli *c);
int cli_run_job(cli *c);
int cli_run_ls(cli *c);
int cli_run_usage(cli *c);
int cli_run_get(cli *c);
int cli_run_rm(cli *c);
int cli_run_doctor(cli *c);
int cli_run_view(cli *c);
int cli_run_sign(cli *c);
int cli_run_studio(cli *c);
int cli_run_completions(cli *c);

#endif
