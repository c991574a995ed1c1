/* What tenants use: bytes, jobs' time, crashes, and what their tokens allow. */
#ifndef ORB_STORE_USAGE_H
#define ORB_STORE_USAGE_H

#include "store/catalogue.h"
#include "store/transactions.h"

typedef struct usage_row {
  char tenant[64];
  int64_t meshes, bytes, derived;           /* bytes: of meshes and landmarks; derived: of what jobs made */
  int64_t worker_ms;                        /* for which workers had its jobs */
  int64_t crashes;                          /* deaths of processes, until an administrator clears them */
  int64_t quota, quota_derived, quota_jobs; /* the least of its tokens; 0: no limit */
} usage_row;

/* Tenants by name, without the first `skip`: those that own something, those that have a token, and `own`. only: just
 * this one; NULL: all. Returns the number of rows, or −1. O(all meshes of the tenants listed), through an index. */
int catalogue_usage(catalogue *cat, const char *own, const char *only, int64_t skip, int limit, usage_row *out);
/* The tenants that store most, with tenant, bytes, derived and worker_ms only, then a row of the name "" with the sums
 * of all tenants. O(tenants). */
int catalogue_usage_most(catalogue *cat, int limit, usage_row *out);
/* Bytes of what jobs made for a tenant; −1: they cannot be read. */
int64_t catalogue_tenant_derived(catalogue *cat, const char *tenant);

/* Adds time of workers to a tenant. Within a transaction of the writer; and without waiting for the commit. */
int usage_add_time(database *db, const char *tenant, int64_t ms);
void catalogue_add_time(catalogue *cat, const char *tenant, int64_t ms);

#endif
