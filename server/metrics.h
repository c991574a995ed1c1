/* Counters for /metrics; any thread. */
#ifndef ORB_METRICS_H
#define ORB_METRICS_H

#include <stdint.h>

#include "api/text.h"

/* kind: an api_job_kind. */
void metrics_job(int kind, int succeeded, double seconds);
void metrics_stage(int kind, const char *stage, double seconds); /* after the stage has ended */
void metrics_webhook(int delivered);                             /* after an attempt */
void metrics_cache(int hit);
void metrics_flips(int64_t flips);
int64_t metrics_quarantined_count(void);
void metrics_quarantined(void);                   /* an object that did not match its hash */
void metrics_request(int status, double seconds); /* seconds < 0: it waited for a job; its time is not counted */
void metrics_bytes(int64_t received, int64_t sent);
void metrics_connection(int change);
int64_t metrics_connections(void);
/* Appends all of them in the Prometheus text format. */
void metrics_write(api_text *out);
/* Appends the HELP and TYPE lines of a metric family. */
void metrics_family(api_text *out, const char *name, const char *type, const char *help);

#endif
