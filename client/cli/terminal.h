/* Messages and the progress bar on standard error. */
#ifndef ORB_CLI_TERMINAL_H
#define ORB_CLI_TERMINAL_H

#include "cli.h"

void cli_error(const cli *c, const char *format, ...) __attribute__((format(printf, 2, 3)));
void cli_note(const cli *c, const char *format, ...) __attribute__((format(printf, 2, 3))); /* silent with --quiet */

/* Does nothing unless c->bar is set. */
void cli_bar(cli *c, const char *label, double fraction);
void cli_bar_end(cli *c);

#endif
