#include "intake.h"

#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "faults.h"
#include "log.h"
#include "store/owners.h"

int intake_open(intake_file *file, object_temp *temp, const api_hash *hash, int64_t size, const api_upload *upload) {
  api_hash whole = *hash;
  *file = (intake_file){.temp = temp, .size = size, .upload = upload, .bytes = (const unsigned char *)""};
  if (size > 0) {
    void *at = mmap(NULL, (size_t)size, PROT_READ, MAP_PRIVATE, temp->fd, 0);
    if (at == MAP_FAILED) {
      file->bytes = NULL;
      return 0;
    }
    file->bytes = at;
  }
  orb_format found = orb_format_detect(file->bytes, (size_t)size);
  int forced = found == ORB_FORMAT_AUTO && upload->hint != ORB_FORMAT_AUTO;
  file->format = forced ? upload->hint : found;
  api_mesh_id(hash, upload->repair, forced ? orb_format_name(upload->hint) : NULL, file->id);
  api_hash_end(&whole, file->sha);
  return 1;
}

void intake_close(intake_file *file) {
  if (file->bytes && file->size > 0) {
    munmap((void *)(uintptr_t)file->bytes, (size_t)file->size);
  }
  file->bytes = NULL;
  objects_abandon(file->temp);
}

static int describe(const intake_file *file, orb_context *ctx, int64_t created, api_text *json, api_problem *problem) {
  orb_mesh mesh;
  api_mesh_facts facts = {.id = file->id,
                          .name = file->upload->name,
                          .repair = file->upload->repair,
                          .bytes = file->size,
                          .created = created,
                          .mesh = &mesh};
  memset(&mesh, 0, sizeof mesh);
  orb_format found = file->format;
  int fine = orb_mesh_read(ctx, file->bytes, (size_t)file->size, file->format, &mesh, &found) == ORB_OK &&
             orb_mesh_repair(ctx, &mesh, file->upload->flags) == ORB_OK &&
             orb_mesh_topology(ctx, &mesh, &facts.topology) == ORB_OK;
  if (fine) {
    orb_mesh_extent(&mesh, &facts.extent);
    facts.format = orb_format_name(found);
    api_mesh_write(&facts, json);
    fine = !json->failed || api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  } else {
    api_problem_of_error(orb_context_error(ctx), problem);
  }
  orb_mesh_free(ctx, &mesh);
  return fine;
}

/* Deletes an object that got no row. */
static void drop_unused(catalogue *cat, objects *store, const char *id) {
  resource row = {0};
  objects_exclude(store);
  if (catalogue_get(cat, RESOURCE_MESH, id, &row) == STORE_NOT_FOUND) {
    objects_delete(store, OBJECT_MESH, id);
  }
  objects_let_go(store);
  resource_free(&row);
}

store_result intake_store(const intake_file *file, catalogue *cat, objects *store, orb_context *ctx, const char *tenant,
                          int64_t quota, int *fresh, api_problem *problem) {
  api_text json = {0};
  resource row = {.kind = RESOURCE_MESH, .bytes = file->size, .created = (int64_t)time(NULL) * 1000};
  *fresh = 0;
  if (!describe(file, ctx, row.created, &json, problem)) {
    api_text_free(&json);
    return STORE_OK;
  }
  memcpy(row.id, file->id, sizeof row.id);
  memcpy(row.sha, file->sha, sizeof row.sha);
  row.json = json.data;
  objects_hold(store);
  store_result stored = objects_publish(store, file->temp, OBJECT_MESH, file->id);
  FAULT_POINT("mesh-published");
  if (stored == STORE_OK) {
    stored = catalogue_put_for(cat, &row, tenant, quota, fresh);
  }
  objects_let_go(store);
  resource_free(&row);
  if (stored == STORE_CONFLICT) {
    drop_unused(cat, store, file->id);
  }
  return stored;
}

void intake_restore(const intake_file *file, objects *store) {
  int fd;
  uint64_t size = 0;
  store_result found = objects_read(store, OBJECT_MESH, file->id, &fd, &size);
  if (found == STORE_OK) {
    close(fd);
  }
  if (found == STORE_NOT_FOUND || (found == STORE_OK && size != (uint64_t)file->size)) {
    objects_hold(store);
    found = objects_publish(store, file->temp, OBJECT_MESH, file->id);
    objects_let_go(store);
    log_warn("the file of mesh %s was lost or truncated and %s", file->id,
             found == STORE_OK ? "is restored" : "could not be restored");
  }
}
