/* The JSON of jobs. */
#ifndef ORB_API_JOB_CODEC_H
#define ORB_API_JOB_CODEC_H

#include "api/text.h"

/* The catalogue stores these numbers. */
typedef enum api_job_kind { API_JOB_EMBEDDING = 0, API_JOB_SUPERMESH, API_JOB_FETCH, API_JOB_KINDS } api_job_kind;
typedef enum api_job_state {
  API_JOB_QUEUED = 0,
  API_JOB_RUNNING,
  API_JOB_SUCCEEDED,
  API_JOB_FAILED,
  API_JOB_CANCELLED
} api_job_state;

typedef struct api_job_view {
  const char *id, *stage;
  const char *result;  /* the id of the result, read only if the job has succeeded */
  const char *problem; /* its JSON document, or NULL */
  api_job_kind kind;
  api_job_state state;
  double progress;
  int64_t seconds_left; /* of a job that runs; 0 or less: not known yet */
  int attempt;
  int64_t created, started, finished;
} api_job_view;

const char *api_job_kind_name(api_job_kind kind);
const char *api_job_state_name(api_job_state state);
/* Returns −1 for an unknown name. */
int api_job_state_of_name(const char *name);
static inline int api_job_ended(api_job_state state) {
  return state >= API_JOB_SUCCEEDED;
}

void api_job_write(const api_job_view *job, api_text *out);

#endif
