/* The tokens of the catalogue in memory. A token command or SIGHUP reloads them while requests use them. A request
 * holds a reference to its caller. When a token is removed, its caller is revoked: its open event streams and waiting
 * requests end.
 */
#ifndef ORB_HTTP_CALLERS_H
#define ORB_HTTP_CALLERS_H

#include "store/tokens.h"

typedef struct caller {
  token_row row; /* hash, name, tenant and created never change; the rest, and `revoked`, under __atomic */
  int revoked, refs;
} caller;

typedef struct callers callers;
callers *callers_open(catalogue *cat); /* NULL if the tokens cannot be read */
void callers_close(callers *c);
/* Reads the tokens again. 0 on failure: known tokens keep their values, and a new one may stay unknown until the next
 * reload. */
int callers_reload(callers *c);
/* Updates the bytes used by a tenant's tokens after its meshes changed. Blocks. */
void callers_recount(callers *c, const char *tenant);
/* The least quota of derived bytes that a token of this tenant has; 0: none has one. For signed URLs. */
int64_t callers_quota_derived(callers *c, const char *tenant);
int callers_count(callers *c);
/* Finds a token by its hash, in constant time; adds a reference. NULL: unknown. */
caller *callers_find(callers *c, const unsigned char hash[TOKEN_BYTES]);
void caller_release(caller *who);
int caller_expired(const caller *who); /* its time has passed; NULL: no */
int caller_revoked(const caller *who); /* it was removed, or has expired; NULL: no */

#endif
