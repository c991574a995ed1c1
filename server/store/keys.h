/* Signing keys, whose holders may sign URLs. The catalogue stores their secrets as they are, because the daemon has to
 * compute the same signatures. The catalogue counts what a key uses each day (UTC), so its limits survive a restart. */
#ifndef ORB_STORE_KEYS_H
#define ORB_STORE_KEYS_H

#include "store/catalogue.h"

enum { KEY_NAME = 64, KEY_SECRET = 65, KEY_ORIGINS = 512 };

typedef struct key_row {
  char name[KEY_NAME];
  char tenant[64];                                 /* whose meshes its URLs name, and who owns what they make */
  char secret[KEY_SECRET], old_secret[KEY_SECRET]; /* 64 hexadecimal digits; old_secret "": none */
  int64_t old_until;                               /* Unix time in seconds until which the old secret is valid */
  char origins[KEY_ORIGINS];                       /* comma-separated; "": all */
  int64_t requests, cpu_seconds;                   /* limits for each day; 0: none */
  int64_t created;                                 /* Unix time in ms */
  int64_t day, used_requests, used_ms;             /* days since 1970, and what was used on that day */
} key_row;

store_result catalogue_key_add(catalogue *cat, const key_row *row); /* STORE_CONFLICT: the name is taken */
/* Gives a key a new secret; the old one stays valid until a Unix time in seconds. */
store_result catalogue_key_rotate(catalogue *cat, const char *name, const char *secret, int64_t old_until);
store_result catalogue_key_remove(catalogue *cat, const char *name);
/* All keys by name, allocated with malloc(); NULL with *count −1 on error. */
key_row *catalogue_keys(catalogue *cat, int *count);
/* Adds to what a key has used on a day. Does not wait for the commit; a key that was removed is ignored. */
void catalogue_key_use(catalogue *cat, const char *name, int64_t day, int64_t requests, int64_t ms);
/* Waits until all uses so far are stored. */
void catalogue_key_settle(catalogue *cat);
/* Milliseconds of work that a key has used on a day; −1: they cannot be read. */
int64_t catalogue_key_ms(catalogue *cat, const char *name, int64_t day);

#endif
