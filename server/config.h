/* The configuration. A flag overrides the environment (ORBMORPH_NAME), which overrides the config file, which overrides
 * the default. A new option: its field in config_values.h, its line in the table of config.c, deploy/man/orbmorphd.8.
 */
#ifndef ORB_CONFIG_H
#define ORB_CONFIG_H

#include "config_values.h"

typedef enum config_action {
  CONFIG_RUN,
  CONFIG_PRINTED, /* --help, --version: done */
  CONFIG_BAD,     /* the reason is on standard error */
  CONFIG_CHECKED, /* --check-config */
  CONFIG_CHECK_DATA,
  CONFIG_GC,
} config_action;

enum { CONFIG_UNFIT = 78 }; /* EX_CONFIG, the status of a process whose catalogue or data folder does not fit */

/* Parses a number ≥ 0 with an optional suffix K, M or G (powers of 1024). 0 if malformed. */
int config_number(const char *text, int64_t *out);
/* Reads the configuration again and applies the options that may change at run time (log-level, queue-limit,
 * derived-bytes, quota-derived, keep-jobs). Calls `changed` for each option that differs; `taken` says whether it was
 * applied. 0 if the new configuration is invalid: nothing changes, and the reason is in the log. Other threads must
 * load derived_bytes and quota_derived atomically. */
int config_reload(config *live, int argc, char **argv, void (*changed)(const char *name, int taken));
config_action config_read(config *out, int argc, char **argv);

#endif
