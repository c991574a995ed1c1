/* Tokens: who may call. The catalogue stores only the SHA-256 of a token's 32 random bytes. */
#ifndef ORB_STORE_TOKENS_H
#define ORB_STORE_TOKENS_H

#include "store/catalogue.h"

enum { TOKEN_BYTES = 32, TOKEN_TEXT = 2 * TOKEN_BYTES + 1 };

typedef struct token_row {
  unsigned char hash[TOKEN_BYTES];
  char name[64];
  char tenant[64];                /* the owner of what it makes */
  int scopes;                     /* values of route_scope, combined with | */
  int64_t quota, used;            /* bytes of the meshes that the tenant owns; quota 0: no limit */
  int64_t quota_derived, derived; /* bytes of what its jobs made; quota 0: that of the option quota-derived */
  int64_t jobs;                   /* limit on unfinished jobs; 0: no limit */
  int priority;                   /* 0 to 9: jobs of a higher priority go first */
  int64_t created;
  int64_t expires; /* Unix time in seconds from which it is refused; 0: never */
} token_row;

/* The hash of a token as callers send it, 64 hexadecimal digits. 0 if the text is not a token. */
int token_hash(const char *text, unsigned char hash[TOKEN_BYTES]);

/* A Unix time in seconds as 2027-01-31T00:00:00Z. */
enum { TOKEN_INSTANT = 32 };
void token_instant(int64_t seconds, char out[TOKEN_INSTANT]);

store_result catalogue_token_add(catalogue *cat, const token_row *row); /* STORE_CONFLICT: the name is taken */
/* Changes scopes, quota, quota_derived, jobs, priority and expires; −1 keeps the old value. */
store_result catalogue_token_set(catalogue *cat, const token_row *row);
store_result catalogue_token_remove(catalogue *cat, const char *name);
/* All tokens by name, allocated with malloc(); NULL with *count −1 on error. */
token_row *catalogue_tokens(catalogue *cat, int *count);

#endif
