/* POST /v1/meshes with a URL in JSON instead of a file: a job downloads it (worker/run_fetch.c). */
#include <string.h>

#include "api/fetch_codec.h"
#include "http/http.h"
#include "http/read_json.h"

/* The name, format and repair of a download are members of its body. */
static int check_query(request *r, api_problem *problem) {
  static const char *const members[] = {"name", "format", "repair", "handle_size", "part"};
  for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
    if (query_has(r, members[i])) {
      api_refuse(problem, "bad-query", "With \"url\", \"%s\" is a member of the body. Move it there.", members[i]);
      api_json_member_string(&problem->facts, "parameter", members[i]);
      return 0;
    }
  }
  return 1;
}

static void fetch_away(request *r) {
  api_fetch_request wish;
  wanted_result wanted = {.kind = RESOURCE_MESH};
  api_problem problem = {0};
  net_url url;
  cJSON *body = check_query(r, &problem) ? read_json(r, &problem) : NULL;
  int fine = body && read_webhook(r, body, &wanted, &problem) && api_fetch_request_read(body, &wish, &problem) &&
             check_url("\"url\"", wish.url, &r->srv->fetch_allowed, &url, &problem);
  json_done(body);
  if (fine) {
    strcpy(wish.url, url.text);
    wish.quota = r->caller ? __atomic_load_n(&r->caller->row.quota, __ATOMIC_RELAXED) : 0;
    api_fetch_request_write(&wish, &wanted.canonical);
    fine = (api_fetch_request_key(&wish, wanted.id) && !wanted.canonical.failed) ||
           api_refuse(&problem, "no-memory", "The server has no memory left; try again later.");
  }
  if (fine && access_has_room(r, 1, &problem)) {
    submit_wanted(r, &wanted);
  } else {
    reply_problem(r, &problem);
  }
  api_text_free(&wanted.canonical);
}

enum MHD_Result handle_mesh_upload(request *r) {
  if (!is_fetch(r)) {
    return handle_mesh_file(r);
  }
  int64_t wait = read_wait_ms(r);
  if (wait < 0) {
    return MHD_YES;
  }
  r->wait_until = wait ? orb_clock_ms() + wait : 0;
  r->waits_for_what = WAIT_RESULT;
  return request_go_away(r, r->srv->io, fetch_away);
}
