/* One run of the program. */
#ifndef ORB_CLI_CLI_H
#define ORB_CLI_CLI_H

#include <curl/curl.h>

#include "options.h"
#include "program.h"

typedef struct cli {
  const char *server, *token; /* token: NULL if none is set */
  int json, quiet;
  int bar;                    /* draw progress bars: standard error is a terminal */
  int bar_drawn, bar_percent; /* the bar that is on the terminal now */
  char bar_label[32];
  CURL *curl;
  cli_commands commands;
  cli_args args;
} cli;

#endif
