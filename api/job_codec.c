#include "api/job_codec.h"

#include <string.h>

static const char *const states[] = {"queued", "running", "succeeded", "failed", "cancelled"};

const char *api_job_kind_name(api_job_kind kind) {
  static const char *const names[API_JOB_KINDS] = {"embedding", "supermesh", "fetch"};
  return names[kind];
}
const char *api_job_state_name(api_job_state state) {
  return states[state];
}
int api_job_state_of_name(const char *name) {
  for (int i = 0; i < 5; i++) {
    if (strcmp(states[i], name) == 0) {
      return i;
    }
  }
  return -1;
}

void api_job_write(const api_job_view *job, api_text *out) {
  api_json_open(out, '{');
  api_json_member_string(out, "id", job->id);
  api_json_key(out, "url");
  api_text_printf(out, "\"/v1/jobs/%s\"", job->id);
  api_json_member_string(out, "kind", api_job_kind_name(job->kind));
  api_json_member_string(out, "state", states[job->state]);
  api_json_key(out, "stage");
  if (job->stage && job->stage[0]) {
    api_json_string(out, job->stage);
  } else {
    api_json_null(out);
  }
  api_json_member_number(out, "progress", job->progress);
  api_json_key(out, "seconds_left");
  if (job->state == API_JOB_RUNNING && job->seconds_left > 0) {
    api_text_printf(out, "%lld", (long long)job->seconds_left);
  } else {
    api_json_null(out);
  }
  api_json_key(out, "result");
  if (job->state == API_JOB_SUCCEEDED) {
    static const char *const results[API_JOB_KINDS] = {"embeddings", "supermeshes", "meshes"};
    api_text_printf(out, "\"/v1/%s/%s\"", results[job->kind], job->result);
  } else {
    api_json_null(out);
  }
  api_json_member_raw(out, "problem", job->problem);
  api_json_member_integer(out, "attempt", job->attempt);
  api_json_member_instant(out, "created", job->created);
  api_json_member_instant(out, "started", job->started);
  api_json_member_instant(out, "finished", job->finished);
  api_json_close(out, '}');
}
