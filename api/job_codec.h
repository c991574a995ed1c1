/* Jobs on the wire. */
#ifndef ORB_API_JOB_CODEC_H
#define ORB_API_JOB_CODEC_H

#include "api/text.h"

typedef enum orb_job_kind { ORB_JOB_EMBEDDING = 0, ORB_JOB_SUPERMESH } orb_job_kind;
typedef enum orb_job_state {
  ORB_JOB_QUEUED = 0,
  ORB_JOB_RUNNING,
  ORB_JOB_SUCCEEDED,
  ORB_JOB_FAILED,
  ORB_JOB_CANCELLED
} orb_job_state;

typedef struct orb_job_view {
  const char *id, *key, *stage;
  const char *problem; /* a document, or NULL */
  orb_job_kind kind;
  orb_job_state state;
  double progress;
  int attempt;
  int64_t created, started, finished;
} orb_job_view;

const char *orb_job_kind_name(orb_job_kind kind);
const char *orb_job_state_name(orb_job_state state);
/* −1 for an unknown name. */
int orb_job_state_of_name(const char *name);
static inline int orb_job_ended(orb_job_state state) {
  return state >= ORB_JOB_SUCCEEDED;
}

void orb_job_write(const orb_job_view *job, orb_text *out);

#endif
