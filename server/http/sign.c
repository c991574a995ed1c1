/* Signed URLs: a signature replaces the token on routes that only read the results of one recipe. */
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "http/http.h"

/* What a signature is good for. A list would show what the holder cannot name. */
static int takes_signatures(const route *found) {
  return found && (found->id == ROUTE_MORPH || found->id == ROUTE_SUPERMESH_GET || found->id == ROUTE_SUPERMESH_ASSET ||
                   found->id == ROUTE_SUPERMESH_PLACES || found->id == ROUTE_SUPERMESH_SPHERE);
}

static void refuse_too_many(request *r, const char *name, int64_t limit, int64_t now, api_problem *problem) {
  r->retry_s = 86400 - now % 86400;
  api_refuse(problem, "quota-exceeded",
             "The key \"%s\" has made its %lld requests of today; it may make more from "
             "midnight UTC.",
             name, (long long)limit);
  api_json_member_integer(&problem->facts, "quota", limit);
}

int sign_check(request *r, const char *path, api_problem *problem) {
  signed_target parts;
  char id[API_ID_SIZE], allow[64];
  const route *found = strcmp(r->method, "OPTIONS") == 0 ? api_route_find("GET", path, id, allow) : r->route;
  int there = takes_signatures(found) ? signature_read(parse_target(r->target), &parts) : 0;
  int64_t now = (int64_t)time(NULL), limit = 0;
  if (there == 0) {
    return 1;
  }
  switch (there < 0 ? SIGN_BAD
                    : signers_check(r->srv->signers, parse_target(r->target), &parts, now, &r->signer, &limit)) {
    case SIGN_OK:
      r->expires = parts.expires;
      return 1;
    case SIGN_EXPIRED:
      api_refuse(problem, "expired-signature",
                 "The signature of this URL was valid until %lld (Unix time). Ask for a "
                 "new URL.",
                 (long long)parts.expires);
      api_json_member_integer(&problem->facts, "expires", parts.expires);
      return 0;
    case SIGN_TOO_MANY:
      refuse_too_many(r, parts.name, limit, now, problem);
      return 0;
    default:
      return api_refuse(
          problem, "bad-signature",
          "The signature does not belong to this URL: a character of it was changed after signing, or the "
          "key does not exist. A signed URL ends in &key=KEY&expires=UNIX_SECONDS&signature=HEX.");
  }
}

int sign_may_work(request *r, api_problem *problem) {
  int64_t now = (int64_t)time(NULL), limit = r->signer ? r->signer->row.cpu_seconds : 0;
  int64_t used = limit > 0 ? catalogue_key_ms(r->srv->cat, r->signer->row.name, now / 86400) : 0;
  if (limit == 0 || (used >= 0 && used < 1000 * limit)) {
    return 1;
  }
  r->retry_s = 86400 - now % 86400;
  api_refuse(problem, "quota-exceeded",
             "The key \"%s\" has used its %lld seconds of processor time of today; morphs that "
             "exist are still served.",
             r->signer->row.name, (long long)limit);
  api_json_member_integer(&problem->facts, "quota", limit);
  return 0;
}
