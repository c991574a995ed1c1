#include "evict.h"

#include <stdio.h>
#include <string.h>

#include "faults.h"
#include "log.h"
#include "store/object_removal.h"
#include "store/owners.h"

enum { PAGE = 64 };

static const char *const names[RESOURCE_KINDS] = {"mesh", "embedding", "supermesh", "landmarks", "alignment"};

/* Deletes the row first: a crash in between then leaves an object without a row, which --gc deletes. */
static store_result evict(const evict_env *env, resource_kind kind, const char *id, const char *tenant) {
  static const object_kind kinds[RESOURCE_KINDS] = {OBJECT_MESH, OBJECT_SPHERE, OBJECT_ASSET, OBJECT_KINDS,
                                                    OBJECT_ALIGNMENT};
  FAULT_POINT("evict");
  int gone = 1, alone = objects_exclude(env->store);
  store_result result = !alone   ? STORE_ERROR
                        : tenant ? catalogue_disown(env->cat, kind, id, tenant, &gone)
                                 : catalogue_delete(env->cat, kind, id);
  if (env->descriptions) {
    cache_drop(env->descriptions, kind, id);
  }
  FAULT_POINT("evict-row-gone");
  if (result == STORE_OK && gone && kinds[kind] != OBJECT_KINDS) {
    result = objects_delete(env->store, kinds[kind], id);
  }
  if (result == STORE_OK && gone && kind == RESOURCE_SUPERMESH) {
    result = objects_delete(env->store, OBJECT_PLACES, id);
  }
  if (result == STORE_OK && gone && kind == RESOURCE_SUPERMESH) {
    result = objects_delete(env->store, OBJECT_SPHERES, id);
  }
  for (int p = 0; result == STORE_OK && gone && kind == RESOURCE_SUPERMESH && p < PROFILES_STORED; p++) {
    result = objects_delete(env->store, object_of_profile(p), id);
  }
  objects_let_go(env->store);
  return result;
}

store_result evict_one(const evict_env *env, resource_kind kind, const char *id) {
  return evict(env, kind, id, NULL);
}

store_result evict_owned(const evict_env *env, resource_kind kind, const char *id, const char *tenant) {
  return evict(env, kind, id, tenant);
}

void evict_damaged(const evict_env *env, object_kind kind, const char *id) {
  const resource_kind owner = resource_of_object(kind);
  /* A profile is made again from its asset. */
  if (resource_is_derived(owner) && kind != OBJECT_QUANTIZED && kind != OBJECT_MESHOPT &&
      evict_one(env, owner, id) == STORE_OK) {
    char fields[160];
    snprintf(fields, sizeof fields, "\"id\":\"%s\"", id);
    log_write(LOG_WARN, fields, "a damaged %s was deleted; the next request computes it again", names[owner]);
  }
}

static int is_needed(const evict_env *env, const resource *row) {
  static const char member[] = "\"mesh\":\"";
  const char *at = row->kind == RESOURCE_EMBEDDING && env->q ? strstr(row->json, member) : NULL;
  char mesh[API_ID_SIZE];
  if (!at) {
    return 0;
  }
  snprintf(mesh, sizeof mesh, "%s", at + sizeof member - 1);
  return queue_needs_mesh(env->q, mesh, NULL);
}

int64_t evict_derived(const evict_env *env, int64_t budget, int64_t before) {
  resource rows[PAGE];
  int64_t total = catalogue_bytes(env->cat, 1);
  int kept = 0; /* of the oldest, because jobs need them */
  for (int n = PAGE; total > budget && n == PAGE;) {
    n = catalogue_oldest(env->cat, before, kept, PAGE, rows);
    for (int i = 0; i < n; i++) {
      if (total > budget && !is_needed(env, &rows[i]) && evict_one(env, rows[i].kind, rows[i].id) == STORE_OK) {
        char fields[160];
        snprintf(fields, sizeof fields, "\"id\":\"%s\",\"bytes\":%lld", rows[i].id, (long long)rows[i].bytes);
        log_write(LOG_INFO, fields, "evicted a derived %s", names[rows[i].kind]);
        total -= rows[i].bytes;
      } else {
        kept++;
      }
      resource_free(&rows[i]);
    }
  }
  return total;
}

int evict_is_named(catalogue *cat, object_kind kind, const char *id) {
  resource row = {0};
  store_result found = catalogue_get(cat, resource_of_object(kind), id, &row);
  int named = found != STORE_NOT_FOUND;
  for (int p = 0; found == STORE_OK && p < PROFILES_STORED; p++) { /* a row names a profile by its hash */
    named &= kind != object_of_profile(p) || row.profiles[p][0];
  }
  resource_free(&row);
  return named;
}

void evict_unnamed(catalogue *cat, objects *store, object_kind kind, const char *id) {
  if (objects_exclude(store) && !evict_is_named(cat, kind, id)) {
    objects_delete(store, kind, id);
  }
  objects_let_go(store);
}

static int is_named(void *cat, object_kind kind, const char *id) {
  return evict_is_named(cat, kind, id);
}

void evict_held(const evict_env *env) {
  objects_delete_held(env->store, is_named, env->cat);
}
