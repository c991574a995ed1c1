/* Maintenance of the data folder while the service is stopped: --check-data and --gc. */
#ifndef ORB_MAINTAIN_H
#define ORB_MAINTAIN_H

#include "config.h"

/* Verifies the catalogue and the hash of every object, and prints all damage. 0: no damage; else 1. */
int maintain_check(const config *options);
/* Moves objects without a row to lost+found, deletes those that were there for lost-days, derived objects beyond
 * derived-bytes and ended jobs beyond keep-jobs. Backups wait for it. 0: done. */
int maintain_gc(const config *options);

#endif
