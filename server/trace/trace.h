/* Traces for OpenTelemetry: spans that say what a request and its job did, and when. Nothing is recorded unless send.h
 * is started; each call then costs one look at a flag.
 *
 * A span is named by a traceparent of W3C Trace Context: "00-TRACE-SPAN-FLAGS". The code that begins a span gets its
 * name, and spans below it name it as their parent, also on another node, because the row of a job stores it. If the
 * traceparent of a request says that its sender does not record, nothing is recorded for it. */
#ifndef ORB_TRACE_TRACE_H
#define ORB_TRACE_TRACE_H

#include <stdint.h>

enum { TRACE_PARENT = 56, TRACE_ATTRIBUTES = 8 };

typedef enum trace_kind { TRACE_INTERNAL = 1, TRACE_SERVER = 2 } trace_kind; /* numbers of OTLP */

typedef struct trace_attribute {
  const char *key;
  const char *text; /* NULL: the number */
  int64_t number;
} trace_attribute;

typedef struct trace_span {
  const char *self, *parent; /* parent "": it begins a trace */
  const char *name;
  trace_kind kind;
  int64_t start_us, end_us; /* Unix time; an end before the start becomes the start: clocks of nodes differ */
  const char *error;        /* what went wrong; NULL: nothing */
  trace_attribute attributes[TRACE_ATTRIBUTES]; /* up to the first without a key */
} trace_span;

/* Names a span below a parent ("": it begins a trace). self becomes "" if nothing is to be recorded. */
void trace_begin(const char *parent, char self[TRACE_PARENT]);
/* The same, but "" where the parent is "": what belongs to a request belongs to nothing without it. */
void trace_begin_below(const char *parent, char self[TRACE_PARENT]);
/* Records a span that has ended. self "": nothing. */
void trace_end(const trace_span *span);
int64_t trace_now_us(void);

#endif
