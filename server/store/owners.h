/* Which tenant owns which mesh, embedding and supermesh. Equal uploads and equal requests are stored once; every tenant
 * that sent them owns the result and sees nothing else. When the last owner deletes it, it is removed. The tenant is ""
 * where no token was needed. Every row has an owner: rows older than ownership that no job names belong to "". Only old
 * alignments have none. The tenant whose job made an alignment owns it, so that its bytes count; no caller sees it.
 *
 * owner.bytes counts meshes and landmarks, owner.derived counts everything that jobs make. Triggers keep the sums of
 * both in the rows of tenants.
 *
 * The first owner sees the resource's own description. Another owner gets a copy where the original would reveal
 * something about the first owner: the name it chose, and the time.
 */
#ifndef ORB_STORE_OWNERS_H
#define ORB_STORE_OWNERS_H

#include "store/catalogue.h"
#include "store/transactions.h"

/* Functions with a database argument run inside a transaction of the writer. */
/* Makes the owner of a job that succeeded an owner of its result. SQL_CONSTRAINT if the result does not exist. */
int owner_of_job(database *db, const char *job, int64_t now, int made);
/* Makes the tenant that requests a job an owner of the meshes that it names, so that another owner's DELETE does not
 * remove them. SQL_NOTFOUND if `all` is set and a mesh does not exist. */
int owner_of_meshes(database *db, const char *request, const char *tenant, int64_t now, int all);

/* Adds a mesh or landmarks if absent, and makes the tenant an owner. STORE_CONFLICT: the tenant would exceed its quota
 * in bytes (0: no limit); nothing changes. *fresh: 0 if the tenant owned it before; PUT_SHARED: others do, and their
 * row stays; PUT_FIRST: the row is the given one, and all see it as it is. */
enum { PUT_SHARED = 1, PUT_FIRST };
store_result catalogue_put_for(catalogue *cat, const resource *r, const char *tenant, int64_t quota, int *fresh);
/* Adds the row of an alignment that a job of this tenant made, or replaces it. */
store_result catalogue_put_alignment(catalogue *cat, const resource *row, const char *tenant);
/* The row with the description that this owner sees; STORE_NOT_FOUND if the tenant does not own it. */
store_result catalogue_get_of(catalogue *cat, resource_kind kind, const char *id, const char *tenant, resource *out);
/* owns[i]: whether the tenant owns ids[i]; each id is named once. */
store_result catalogue_owns(catalogue *cat, resource_kind kind, char (*ids)[API_ID_SIZE], int count, const char *tenant,
                            int *owns);
/* Like catalogue_list(), but lists only rows that the tenant owns. */
int catalogue_list_of(catalogue *cat, resource_kind kind, const char *tenant, int64_t before, int limit, resource *out);
/* Removes an owner. *gone: it was the last one and the row is deleted. STORE_NOT_FOUND: the tenant did not own it. */
store_result catalogue_disown(catalogue *cat, resource_kind kind, const char *id, const char *tenant, int *gone);
/* The kept alignments that were made for a tenant, oldest first. Returns their number, or −1. */
int catalogue_alignments_of(catalogue *cat, const char *tenant, int limit, char (*ids)[API_ID_SIZE]);
/* Bytes of the meshes and landmarks that a tenant owns; −1: they cannot be read. */
int64_t catalogue_tenant_bytes(catalogue *cat, const char *tenant);
/* Bytes of the largest file that a tenant may send; 0: no limit. A known file costs nothing: it has at most as many
 * bytes as the tenant stores (used), which may be more than a quota that another of its tokens has, or that was
 * lowered. */
static inline int64_t owner_largest_file(int64_t quota, int64_t used) {
  return quota == 0 || quota > used ? quota : used;
}
/* For --check-data: the number of resources without an owner (alignments have none), owners without a resource, stored
 * sums that differ from the sums of the rows, and shapes of supermeshes that the filter of lists lacks or invents; −1:
 * they cannot be read.
 */
int64_t catalogue_mismatches(catalogue *cat);

#endif
