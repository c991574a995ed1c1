/* `orbmorphd key add|rotate|remove|list`. The command goes to the running daemon as a line over its control socket. If
 * none runs, it changes the catalogue directly. */
#ifndef ORB_KEY_COMMAND_H
#define ORB_KEY_COMMAND_H

#include "api/text.h"
#include "config.h"
#include "store/catalogue.h"

typedef struct key_command {
  const char *verb, *name, *tenant; /* tenant NULL: the name */
  char origins[512];                /* comma-separated; "": all */
  int64_t requests, cpu_seconds;    /* 0: no limit */
  int64_t overlap;                  /* seconds for which the old secret stays valid */
} key_command;

/* Reads the command from argv[2…] and removes its own words, so that the rest can be read as options of the daemon. 0
 * after printing what is wrong. */
int key_command_read(key_command *out, int *argc, char **argv);
/* Asks the running daemon: its exit status, or −1 if none runs. */
int key_command_ask(const key_command *command, const config *options);
/* Without a daemon; the caller holds the lock of the data folder. Returns the exit status. */
int key_command_run(const key_command *command, const config *options);
/* Carries out a line of the control socket. Returns the exit status; 0 is success. */
int key_command_apply(catalogue *cat, const char *line, api_text *reply);

#endif
