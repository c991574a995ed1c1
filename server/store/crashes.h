/* Counts the crashes of processes that did only one piece of work. Each count belongs to the key of that work: the key
 * of a job, or the id of a checked mesh. The counts outlive the jobs, so the daemon finally refuses a file that crashes
 * its process each time. Each tenant has its own count, for its usage; the sum of all tenants is what is refused. */
#ifndef ORB_STORE_CRASHES_H
#define ORB_STORE_CRASHES_H

#include "api/text.h"
#include "store/catalogue.h"
#include "store/database.h"

/* Deaths after which a job fails, and after which the work of its key is refused until the operator clears it. */
enum { CRASHES_MOST = 3 };

/* Counts one, within a write. request: of the job; NULL: the key is a mesh's. */
int crash_note(database *db, const char *key, const char *request, const char *tenant, int64_t now);
/* SQL_OK, or SQL_CONSTRAINT if the work of this key is refused. */
int crash_check(database *db, const char *key);

/* Counts the death of a process that checked a mesh, or did other work `key` on a result. Returns without waiting for
 * the commit. */
void catalogue_crash_of_mesh(catalogue *cat, const char *mesh, const char *tenant, int64_t now);
void catalogue_crash_of(catalogue *cat, const char *key, const char *result, const char *tenant, int64_t now);
/* Whether the work of this key is refused. */
int catalogue_crashed(catalogue *cat, const char *key);
/* Forgets the crashes of all keys that begin with `name`, or those of the tenant `name`, or of work on the mesh or
 * result `name`. STORE_NOT_FOUND: there are none. */
store_result catalogue_crash_clear(catalogue *cat, const char *name);
/* Appends a line for each key and tenant, the latest first; −1: it cannot be read. */
int catalogue_crash_list(catalogue *cat, api_text *out);

#endif
