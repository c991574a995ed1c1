#include "http/certificate.h"

#include <gnutls/abstract.h>
#include <gnutls/gnutls.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/ids.h"
#include "log.h"

enum { CHAIN_MOST = 16, FILE_MOST = 1 << 20 }; /* certificates of a chain; bytes of a file */

/* A handshake may use a certificate after a newer one is loaded, for as long as it takes. So all stay until the end:
 * some kilobytes a renewal. */
typedef struct certificate {
  struct certificate *older;
  gnutls_pcert_st chain[CHAIN_MOST];
  unsigned count;
  gnutls_privkey_t key;
  char id[API_ID_SIZE]; /* of the bytes of both files */
} certificate;

static certificate *newest; /* __atomic: handshakes read it on other threads */

static gnutls_datum_t read_file(const char *path) {
  FILE *file = fopen(path, "rb");
  gnutls_datum_t text = {file ? malloc(FILE_MOST) : NULL, 0};
  text.size = text.data ? (unsigned)fread(text.data, 1, FILE_MOST, file) : 0;
  if (file) {
    fclose(file);
  }
  if (text.size == 0) {
    log_error("%s cannot be read", path);
  } else if (text.size == FILE_MOST) {
    log_error("%s is too long for a certificate or a key", path);
    text.size = 0;
  }
  return text;
}

/* A hash of both files: a reload without a renewal changes nothing. */
static void identify(const gnutls_datum_t *chain, const gnutls_datum_t *key, char id[API_ID_SIZE]) {
  api_hash hash;
  api_hash_begin(&hash);
  api_hash_add(&hash, chain->data, chain->size);
  api_hash_add(&hash, key->data, key->size);
  api_hash_end(&hash, id);
}

/* GnuTLS itself tests whether the key belongs to the certificate only where it holds both. */
static int match(const gnutls_datum_t *chain, const gnutls_datum_t *key) {
  gnutls_certificate_credentials_t both;
  int code = gnutls_certificate_allocate_credentials(&both);
  if (code == GNUTLS_E_SUCCESS) {
    code = gnutls_certificate_set_x509_key_mem(both, chain, key, GNUTLS_X509_FMT_PEM);
    gnutls_certificate_free_credentials(both);
  }
  return code;
}

static int parse(const gnutls_datum_t *chain, const gnutls_datum_t *key, certificate *out) {
  unsigned count = CHAIN_MOST;
  int code = match(chain, key);
  if (code >= 0) {
    code = gnutls_pcert_list_import_x509_raw(out->chain, &count, chain, GNUTLS_X509_FMT_PEM, 0);
    out->count = code >= 0 ? count : 0;
  }
  if (code >= 0) {
    code = gnutls_privkey_init(&out->key);
  }
  if (code >= 0) {
    code = gnutls_privkey_import_x509_raw(out->key, key, GNUTLS_X509_FMT_PEM, NULL, 0);
  }
  return code;
}

static void free_one(certificate *one) {
  for (unsigned i = 0; one && i < one->count; i++) {
    gnutls_pcert_deinit(&one->chain[i]);
  }
  if (one && one->key) {
    gnutls_privkey_deinit(one->key);
  }
  free(one);
}

int certificate_load(const char *chain_path, const char *key_path) {
  gnutls_datum_t chain = read_file(chain_path), key = read_file(key_path);
  certificate *made = chain.size && key.size ? calloc(1, sizeof *made) : NULL, *last = newest;
  int code = made ? GNUTLS_E_SUCCESS : GNUTLS_E_MEMORY_ERROR;
  if (made) {
    identify(&chain, &key, made->id);
    code = parse(&chain, &key, made);
  }
  if (chain.size && key.size && code < 0) {
    log_error("%s and %s are not a certificate and its key in PEM: %s", chain_path, key_path, gnutls_strerror(code));
  }
  if (code < 0 || (last && strcmp(last->id, made->id) == 0)) {
    free_one(made);
  } else {
    made->older = last;
    __atomic_store_n(&newest, made, __ATOMIC_RELEASE);
  }
  free(chain.data);
  if (key.data) {
    gnutls_memset(key.data, 0, key.size);
  }
  free(key.data);
  return code >= 0;
}

int certificate_is_loaded(void) {
  return __atomic_load_n(&newest, __ATOMIC_ACQUIRE) != NULL;
}

static int retrieve(gnutls_session_t session, const struct gnutls_cert_retr_st *info, gnutls_pcert_st **chain,
                    unsigned *count, gnutls_ocsp_data_st **ocsp, unsigned *ocsp_count, gnutls_privkey_t *key,
                    unsigned *flags) {
  certificate *one = __atomic_load_n(&newest, __ATOMIC_ACQUIRE);
  (void)session;
  (void)info;
  *chain = one->chain;
  *count = one->count;
  *key = one->key;
  *ocsp = NULL;
  *ocsp_count = 0;
  *flags = 0; /* the daemon keeps them */
  return 0;
}

void *certificate_callback(void) {
  gnutls_certificate_retrieve_function3 *callback = retrieve;
  void *out;
  memcpy(&out, &callback, sizeof out); /* C has no cast between them; POSIX makes them the same size */
  return out;
}

void certificate_free(void) {
  for (certificate *one = newest; one;) {
    certificate *older = one->older;
    free_one(one);
    one = older;
  }
  newest = NULL;
}
