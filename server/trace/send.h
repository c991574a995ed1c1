/* Sends spans to a collector: OTLP over HTTP in its JSON form, in batches, from one thread. No caller waits for
 * it: spans that do not fit into its bounded buffer are dropped and counted. */
#ifndef ORB_TRACE_SEND_H
#define ORB_TRACE_SEND_H

#include <stdint.h>

typedef struct trace_options {
  const char *url;         /* of the collector; without a path: /v1/traces */
  const char *authorities; /* PEM file of certificate authorities; "": those of the system */
  const char *role;        /* of this node */
} trace_options;

/* Once in a process, after net_start(). 0: out of memory. */
int trace_start(const trace_options *options);
/* Sends what is there, for at most two seconds, and ends the thread. Nothing if it was not started. */
void trace_stop(void);
int trace_is_on(void);
/* Takes over the JSON of a span, of malloc(); NULL: out of memory, which counts as dropped. */
void trace_send(char *span);

typedef struct trace_numbers {
  int64_t sent, dropped, waiting;
} trace_numbers;
void trace_count(trace_numbers *out);

#endif
