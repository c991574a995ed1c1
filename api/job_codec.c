#include "api/job_codec.h"

#include <string.h>

static const char *const states[] = {"queued", "running", "succeeded", "failed", "cancelled"};

const char *orb_job_kind_name(orb_job_kind kind) {
  return kind == ORB_JOB_EMBEDDING ? "embedding" : "supermesh";
}
const char *orb_job_state_name(orb_job_state state) {
  return states[state];
}
int orb_job_state_of_name(const char *name) {
  for (int i = 0; i < 5; i++) {
    if (strcmp(states[i], name) == 0) {
      return i;
    }
  }
  return -1;
}

void orb_job_write(const orb_job_view *job, orb_text *out) {
  orb_json_open(out, '{');
  orb_json_member_string(out, "id", job->id);
  orb_json_key(out, "url");
  orb_text_printf(out, "\"/v1/jobs/%s\"", job->id);
  orb_json_member_string(out, "kind", orb_job_kind_name(job->kind));
  orb_json_member_string(out, "state", states[job->state]);
  orb_json_key(out, "stage");
  if (job->stage && job->stage[0]) {
    orb_json_string(out, job->stage);
  } else {
    orb_json_null(out);
  }
  orb_json_member_number(out, "progress", job->progress);
  orb_json_key(out, "result");
  if (job->state == ORB_JOB_SUCCEEDED) {
    orb_text_printf(out, "\"/v1/%s/%s\"", job->kind == ORB_JOB_EMBEDDING ? "embeddings" : "supermeshes", job->key);
  } else {
    orb_json_null(out);
  }
  orb_json_member_raw(out, "problem", job->problem);
  orb_json_member_integer(out, "attempt", job->attempt);
  orb_json_member_instant(out, "created", job->created);
  orb_json_member_instant(out, "started", job->started);
  orb_json_member_instant(out, "finished", job->finished);
  orb_json_close(out, '}');
}
