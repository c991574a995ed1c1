/* Who owns which mesh, embedding and supermesh. Equal bytes and equal requests are stored once, but every tenant who
 * sent them owns what came of it, and sees nothing else; what the last owner gives up is gone. A tenant is the name
 * that tokens share ("" where no token was needed). A row without an owner does not come about: what was there before
 * owners were noted, and what jobs do not tell of, belongs to "".
 *
 * The first owner's description is the resource's; others have one of their own where the first one's would tell about
 * the first: the name that it gave, and when.
 */
#ifndef ORB_STORE_OWNERS_H
#define ORB_STORE_OWNERS_H

#include "store/database.h"

/* Inside a transaction. Keeps an owner that is there. json NULL: the resource's description serves. bytes: what counts
 * for the quota. */
int owner_insert(database *db, const resource *r, const char *tenant, const char *json);
/* Inside a transaction: the owner of a job that succeeded owns its result. SQLITE_CONSTRAINT where that is gone. */
int owner_of_job(database *db, const char *job, int64_t now);
/* Inside a transaction: who asks for a job owns the meshes that it names from then on, so that no other owner's delete
 * takes them away. SQLITE_NOTFOUND where one is gone and `all` is wanted. */
int owner_of_meshes(database *db, const char *request, const char *tenant, int64_t now, int all);

/* Puts a row if it is absent, owned by "". */
store_result catalogue_put(catalogue *cat, const resource *r);
/* Puts a mesh if it is absent, and makes the tenant its owner. STORE_CONFLICT: with it the tenant would have more bytes
 * than quota (0: no limit); nothing is changed then. *fresh: the tenant did not own it before. */
store_result catalogue_put_for(catalogue *cat, const resource *r, const char *tenant, int64_t quota, int *fresh);
/* As this owner sees it; STORE_NOT_FOUND for all others. */
store_result catalogue_get_of(catalogue *cat, resource_kind kind, const char *id, const char *tenant, resource *out);
/* As catalogue_list(), of what the tenant owns. */
int catalogue_list_of(catalogue *cat, resource_kind kind, const char *tenant, int64_t before, int limit, resource *out);
/* The tenant owns it no more. *gone: nobody does, and the row is deleted. STORE_NOT_FOUND: it did not own it. */
store_result catalogue_disown(catalogue *cat, resource_kind kind, const char *id, const char *tenant, int *gone);
/* Bytes of the meshes that a tenant owns; −1: they cannot be read. */
int64_t catalogue_tenant_bytes(catalogue *cat, const char *tenant);
/* Resources without an owner, owners without a resource, and sums kept that are not what the rows add up to, for
 * --check-data; −1: they cannot be read. */
int64_t catalogue_mismatches(catalogue *cat);

#endif
