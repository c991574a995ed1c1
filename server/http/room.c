#include "http/room.h"

#include "evict.h"
#include "store/owners.h"
#include "store/usage.h"

enum { PAGE = 16 };

store_result room_measure(const request *r, room *out) {
  int64_t own = r->caller   ? __atomic_load_n(&r->caller->row.quota_derived, __ATOMIC_RELAXED)
                : r->signer ? callers_quota_derived(r->srv->callers, access_tenant(r))
                            : 0;
  *out = (room){.quota = own};
  if (own == 0 && (r->caller || r->signer)) {
    out->quota = __atomic_load_n(&r->srv->options->quota_derived, __ATOMIC_RELAXED);
  }
  if (out->quota == 0) {
    return STORE_OK;
  }
  out->used = catalogue_tenant_derived(r->srv->cat, access_tenant(r));
  out->left = out->quota - out->used;
  return out->used < 0 ? STORE_ERROR : STORE_OK;
}

int room_make(const request *r, int64_t bytes) {
  const evict_env env = {.cat = r->srv->cat, .store = r->srv->store, .descriptions = r->srv->descriptions};
  const char *tenant = access_tenant(r);
  const int64_t before = catalogue_tenant_derived(r->srv->cat, tenant);
  char ids[PAGE][API_ID_SIZE];
  int made = 0;
  for (int64_t now = before; now >= 0 && before - now < bytes;) {
    int n = catalogue_alignments_of(r->srv->cat, tenant, PAGE, ids), gone = 0;
    for (int i = 0; i < n && now >= 0 && before - now < bytes; i++) {
      gone += evict_one(&env, RESOURCE_ALIGNMENT, ids[i]) == STORE_OK;
      now = catalogue_tenant_derived(r->srv->cat, tenant);
    }
    if (gone == 0) {
      break;
    }
    made = 1;
  }
  return made;
}

void room_refuse(request *r, const room *space, int64_t needs) {
  api_problem problem = {0};
  const char *tenant = access_tenant(r);
  int64_t pending = space->quota - space->used - space->left;
  api_refuse(
      &problem, "quota-exceeded",
      "The tenant \"%s\" may store %lld bytes of embeddings, supermeshes and requests of unfinished jobs. It stores "
      "%lld, its unfinished jobs take about %lld with their results, and this job needs about %lld, which does not fit "
      "in the rest. Wait until jobs end, or cancel some. Delete results that are not needed, or ask the operator for a "
      "larger quota (orbmorphd token set NAME --quota-derived BYTES).",
      tenant, (long long)space->quota, (long long)space->used, (long long)pending, (long long)needs);
  api_json_member_integer(&problem.facts, "quota", space->quota);
  api_json_member_integer(&problem.facts, "used", space->used);
  api_json_member_integer(&problem.facts, "pending", pending);
  reply_problem(r, &problem);
}
