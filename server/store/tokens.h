/* Tokens: who may call. Of a token only the SHA-256 of its 32 random bytes is kept. */
#ifndef ORB_STORE_TOKENS_H
#define ORB_STORE_TOKENS_H

#include "store/catalogue.h"

enum { TOKEN_BYTES = 32, TOKEN_TEXT = 2 * TOKEN_BYTES + 1 };

typedef struct token_row {
  unsigned char hash[TOKEN_BYTES];
  char name[64];
  char tenant[64];     /* whose meshes and jobs it works with */
  int scopes;          /* route_scope, or-ed */
  int64_t quota, used; /* bytes of the meshes that the tenant owns; quota 0: no limit */
  int64_t jobs;        /* unfinished at once; 0: no limit */
  int priority;        /* 0 to 9: jobs of a higher one go first */
  int64_t created;
} token_row;

/* The hash of a token as callers send it: 64 hexadecimal digits. 0 if it is none. */
int token_hash(const char *text, unsigned char hash[TOKEN_BYTES]);

store_result catalogue_token_add(catalogue *cat, const token_row *row); /* STORE_CONFLICT: the name is taken */
/* Changes scopes, quota, jobs and priority, each where it is not −1. */
store_result catalogue_token_set(catalogue *cat, const token_row *row);
store_result catalogue_token_remove(catalogue *cat, const char *name);
/* All, by name. In memory of malloc(); NULL with *count −1 on error. */
token_row *catalogue_tokens(catalogue *cat, int *count);

#endif
