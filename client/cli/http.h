/* HTTP requests to the daemon. */
#ifndef ORB_CLI_HTTP_H
#define ORB_CLI_HTTP_H

#include <cjson/cJSON.h>

#include "cli.h"

typedef struct cli_reply {
  long status; /* 0: no response */
  char *body;  /* zero-terminated; NULL if it was empty or went to a file */
  size_t size;
  char *location;
  long retry_after; /* seconds; −1: no such header */
  cJSON *json;      /* the parsed body; NULL if it is not JSON */
} cli_reply;

typedef struct cli_request {
  const char *method, *path; /* path: from the slash after the authority on */
  const char *json;          /* body, or NULL */
  FILE *upload;              /* body streamed from a file, or NULL */
  curl_off_t upload_size;
  FILE *download;    /* receives the body of a 2xx response; NULL: the reply holds it */
  const char *label; /* of the progress bar; NULL: no bar */
  int patient;       /* repeat for a while if the daemon does not respond */
} cli_request;

/* Sends a request and receives the response. Waits and repeats if the daemon asks for that with Retry-After. Returns
 * CLI_DONE for a response of any status, CLI_UNREACHABLE for none, or CLI_USAGE if `download` cannot be written; prints
 * the error. The caller frees the reply in all cases. */
int cli_send(cli *c, const cli_request *request, cli_reply *out);
int cli_get(cli *c, const char *path, cli_reply *out);
void cli_reply_free(cli_reply *reply);
int cli_ok(const cli_reply *reply); /* the status is 2xx */

#endif
