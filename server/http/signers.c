#include "http/signers.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { VERIFIED = 4096, TARGET_HASH = crypto_shorthash_siphashx24_BYTES };

/* A target whose signature fits its key's current secret. A visitor's HMAC takes 4 µs, a tenth of the whole answer. */
typedef struct verified {
  unsigned char
      hash[TARGET_HASH]; /* of the target with its signature, keyed: so that no caller can choose a slot or its value */
  unsigned generation;
} verified;

struct signers {
  pthread_mutex_t lock;
  pthread_mutex_t reading; /* held from reading the catalogue to storing the values, so a later read wins */
  catalogue *cat;
  signer **all;
  int count;
  unsigned generation; /* of the keys in `all`; a reload makes all verified targets unknown */
  unsigned char hash_key[crypto_shorthash_siphashx24_KEYBYTES];
  verified verified[VERIFIED];
};

enum { DAY_S = 86400 };

void signer_release(signer *who) {
  if (who && __atomic_sub_fetch(&who->refs, 1, __ATOMIC_ACQ_REL) == 0) {
    sodium_memzero(&who->row, sizeof who->row);
    free(who);
  }
}

int signer_revoked(const signer *who) {
  return who && __atomic_load_n(&who->revoked, __ATOMIC_ACQUIRE);
}

/* Takes the key that has this name and was made at this time; a key that was removed and added again is another one. */
static signer *take_known(signers *s, const key_row *row) {
  for (int i = 0; i < s->count; i++) {
    signer *who = s->all[i];
    if (who && strcmp(who->row.name, row->name) == 0 && who->row.created == row->created) {
      s->all[i] = NULL;
      return who;
    }
  }
  return NULL;
}

static signer *make(const key_row *row) {
  signer *who = calloc(1, sizeof *who);
  if (who) {
    who->row = *row;
    who->counted = row->used_requests;
    who->refs = 1;
  }
  return who;
}

/* Copies what can change of a key. Its count in memory is ahead of the catalogue's. */
static void update(signer *who, const key_row *row) {
  memcpy(who->row.secret, row->secret, sizeof row->secret);
  memcpy(who->row.old_secret, row->old_secret, sizeof row->old_secret);
  who->row.old_until = row->old_until;
}

static int reload(signers *s) {
  int count, fine = 1;
  key_row *rows = catalogue_keys(s->cat, &count);
  signer **all = rows ? calloc((size_t)count + 1, sizeof(signer *)) : NULL;
  if (!all) {
    free(rows);
    return 0;
  }
  pthread_mutex_lock(&s->lock);
  for (int i = 0; i < count; i++) {
    all[i] = take_known(s, &rows[i]);
    if (all[i]) {
      update(all[i], &rows[i]);
    } else {
      all[i] = make(&rows[i]); /* NULL if out of memory: unknown until the next reload, which the result reports */
      fine &= all[i] != NULL;
    }
  }
  for (int i = 0; i < s->count; i++) {
    if (s->all[i]) {
      __atomic_store_n(&s->all[i]->revoked, 1, __ATOMIC_RELEASE);
      signer_release(s->all[i]);
    }
  }
  free(s->all);
  s->all = all;
  s->count = count;
  s->generation++;
  pthread_mutex_unlock(&s->lock);
  sodium_memzero(rows, (size_t)count * sizeof *rows);
  free(rows);
  return fine;
}

int signers_reload(signers *s) {
  pthread_mutex_lock(&s->reading);
  int fine = reload(s);
  pthread_mutex_unlock(&s->reading);
  return fine;
}

signers *signers_open(catalogue *cat) {
  signers *s = calloc(1, sizeof *s);
  if (!s) {
    return NULL;
  }
  s->cat = cat;
  randombytes_buf(s->hash_key, sizeof s->hash_key);
  pthread_mutex_init(&s->lock, NULL);
  pthread_mutex_init(&s->reading, NULL);
  if (!signers_reload(s)) {
    signers_close(s);
    return NULL;
  }
  return s;
}

void signers_close(signers *s) {
  for (int i = 0; s && i < s->count; i++) {
    signer_release(s->all[i]);
  }
  if (s) {
    free(s->all);
    pthread_mutex_destroy(&s->lock);
    pthread_mutex_destroy(&s->reading);
  }
  free(s);
}

void signers_store_use(signers *s) {
  pthread_mutex_lock(&s->lock);
  for (int i = 0; i < s->count; i++) {
    signer *who = s->all[i];
    if (who && who->since > 0) {
      catalogue_key_use(s->cat, who->row.name, who->row.day, who->since, 0);
      who->since = 0;
    }
  }
  pthread_mutex_unlock(&s->lock);
}

/* Reads "NAME=VALUE" of at most `room` − 1 characters of `set` at *at, and the "&" after it. */
static int read_parameter(const char **at, const char *name, const char *set, char *out, size_t room) {
  size_t length = strlen(name), size;
  if (strncmp(*at, name, length) != 0 || (*at)[length] != '=') {
    return 0;
  }
  const char *value = *at + length + 1;
  size = strspn(value, set);
  if (size == 0 || size >= room || value[size] != '&') {
    return 0;
  }
  memcpy(out, value, size);
  out[size] = 0;
  *at = value + size + 1;
  return 1;
}

int signature_read(const char *target, signed_target *out) {
  static const char mark[] = "signature=";
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  const char *query = strchr(target, '?'), *at = NULL, *key = NULL;
  char expires[19];
  size_t size = 0;
  for (const char *c = query; c; c = strchr(c + 1, '&')) {
    if (strncmp(c + 1, mark, sizeof mark - 1) == 0) {
      at = at ? at : c + 1; /* the first: what follows it is not digits, so a second one makes it malformed */
    }
    if (!at && strncmp(c + 1, "key=", 4) == 0) {
      key = c + 1;
    }
  }
  if (!at) {
    return 0;
  }
  out->size = (size_t)(at - 1 - target);
  const char *digits = at + sizeof mark - 1;
  if (!key || !read_parameter(&key, "key", letters, out->name, sizeof out->name) ||
      !read_parameter(&key, "expires", "0123456789", expires, sizeof expires) || key != at || expires[0] == '0' ||
      strlen(digits) != 64 || strspn(digits, "0123456789abcdef") != 64) {
    return -1;
  }
  out->expires = strtoll(expires, NULL, 10);
  return sodium_hex2bin(out->signature, sizeof out->signature, digits, 64, NULL, &size, NULL) == 0 ? 1 : -1;
}

static int signs(const char *secret, const char *target, const signed_target *parts) {
  unsigned char made[crypto_auth_hmacsha256_BYTES];
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, (const unsigned char *)secret, strlen(secret));
  crypto_auth_hmacsha256_update(&state, (const unsigned char *)target, parts->size);
  crypto_auth_hmacsha256_final(&state, made);
  return sodium_memcmp(made, parts->signature, sizeof made) == 0;
}

static int is_genuine_locked(signers *s, const signer *who, const char *target, const signed_target *parts,
                             int64_t now) {
  unsigned char hash[TARGET_HASH];
  uint32_t slot;
  crypto_shorthash_siphashx24(hash, (const unsigned char *)target, strlen(target), s->hash_key);
  memcpy(&slot, hash, sizeof slot);
  verified *known = &s->verified[slot % VERIFIED];
  if (known->generation == s->generation && sodium_memcmp(known->hash, hash, sizeof hash) == 0) {
    return 1;
  }
  int old = who->row.old_secret[0] && now < who->row.old_until && signs(who->row.old_secret, target, parts);
  if (!signs(who->row.secret, target, parts)) {
    return old; /* never remembered: it ends with the overlap */
  }
  known->generation = s->generation;
  memcpy(known->hash, hash, sizeof hash);
  return 1;
}

/* Counts a request; 0 if the key has made all that it may make today. */
static int count_locked(signers *s, signer *who, int64_t now) {
  int64_t day = now / DAY_S;
  if (who->row.day < day) {
    if (who->since > 0) {
      catalogue_key_use(s->cat, who->row.name, who->row.day, who->since, 0);
    }
    who->row.day = day;
    who->counted = who->since = 0;
  }
  if (who->row.requests > 0 && who->counted >= who->row.requests) {
    return 0;
  }
  who->counted++;
  who->since++;
  return 1;
}

sign_result signers_check(signers *s, const char *target, const signed_target *parts, int64_t now, signer **out,
                          int64_t *limit) {
  sign_result result = SIGN_BAD;
  pthread_mutex_lock(&s->lock);
  for (int i = 0; i < s->count; i++) {
    signer *who = s->all[i];
    if (!who || strcmp(who->row.name, parts->name) != 0) {
      continue;
    }
    if (!is_genuine_locked(s, who, target, parts, now)) {
      break;
    }
    *limit = who->row.requests;
    result = parts->expires <= now ? SIGN_EXPIRED : count_locked(s, who, now) ? SIGN_OK : SIGN_TOO_MANY;
    if (result == SIGN_OK) {
      __atomic_add_fetch(&who->refs, 1, __ATOMIC_RELAXED);
      *out = who;
    }
    break;
  }
  pthread_mutex_unlock(&s->lock);
  return result;
}
