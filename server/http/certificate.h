/* The certificate of the service and its key. SIGHUP reads them again, as tools that renew certificates expect; open
 * connections keep the one they began with. One for the process: libmicrohttpd passes its callback no state. */
#ifndef SERVER_HTTP_CERTIFICATE_H
#define SERVER_HTTP_CERTIFICATE_H

/* Reads a certificate chain and its key (PEM files) and uses them for handshakes from now on. Returns 0 with the reason
 * logged where a file is unreadable or invalid, or the key belongs to another certificate; the previous certificate
 * then stays in use. Main thread only. */
int certificate_load(const char *chain_path, const char *key_path);

/* Whether the service has a certificate. */
int certificate_is_loaded(void);

/* For MHD_OPTION_HTTPS_CERT_CALLBACK2: a gnutls_certificate_retrieve_function3. */
void *certificate_callback(void);

/* Frees all loaded certificates. No handshake may run. */
void certificate_free(void);

#endif
