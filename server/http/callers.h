/* The tokens that open this daemon, as they are now: read from the catalogue, and again whenever a command or SIGHUP
 * says so, while requests use them. A request holds its caller; a caller whose token is gone is revoked, and what it
 * still has open ends.
 */
#ifndef ORB_HTTP_CALLERS_H
#define ORB_HTTP_CALLERS_H

#include "store/tokens.h"

typedef struct caller {
  token_row row; /* hash, name, tenant and created never change; the rest, and `revoked`, under __atomic */
  int revoked, refs;
} caller;

typedef struct callers callers;
callers *callers_open(catalogue *cat); /* NULL where they cannot be read */
void callers_close(callers *c);
/* Reads them again; 0 where that fails: they stay as they are, but a new one may be refused until the next time. */
int callers_reload(callers *c);
/* After the meshes of a tenant changed: the bytes that its tokens have used. Blocks. */
void callers_recount(callers *c, const char *tenant);
int callers_count(callers *c);
/* By the hash of the token, compared in constant time; referenced. NULL: none. */
caller *callers_find(callers *c, const unsigned char hash[TOKEN_BYTES]);
void caller_release(caller *who);
int caller_revoked(const caller *who); /* NULL: no */

#endif
