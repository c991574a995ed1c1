#include "store/alignments.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "log.h"
#include "store/owners.h"
#include "store/verify.h"

/* An alignment is kept only if so many times its bytes are free: the result that follows needs the space more. */
enum { ROOM = 16 };

int alignments_get(catalogue *cat, const objects *store, orb_context *ctx, const resource *row,
                   const orb_align_shape *shapes, int32_t shape_count, orb_alignment *out) {
  const char *id = row->id;
  unsigned char *bytes = NULL;
  char sha[API_ID_SIZE];
  size_t size = 0;
  int fine = objects_load(store, OBJECT_ALIGNMENT, id, &bytes, &size) == STORE_OK;
  if (fine) {
    api_id_of_text((const char *)bytes, size, sha);
    fine = strcmp(sha, row->sha) == 0 && orb_alignment_read(ctx, bytes, size, shapes, shape_count, out) == ORB_OK;
  }
  if (fine && cat) {
    catalogue_touch(cat, RESOURCE_ALIGNMENT, id);
  } else if (!fine) {
    log_warn("the kept alignment %s cannot be used", id);
  }
  free(bytes);
  return fine;
}

store_result alignments_publish(catalogue *cat, objects *store, const char *id, const char *tenant, object_temp *temp) {
  char json[API_ID_SIZE + 16];
  const off_t size = lseek(temp->fd, 0, SEEK_END);
  resource row = {
      .kind = RESOURCE_ALIGNMENT, .json = json, .bytes = (int64_t)size, .created = (int64_t)time(NULL) * 1000};
  snprintf(json, sizeof json, "{\"id\":\"%s\"}", id);
  memcpy(row.id, id, sizeof row.id);
  if (size <= 0 || (cat && !verify_hash(temp->fd, row.sha))) {
    return STORE_ERROR;
  }
  if (objects_free_bytes(store) / ROOM < (uint64_t)size) {
    return STORE_FULL;
  }
  objects_hold(store);
  store_result result = objects_publish(store, temp, OBJECT_ALIGNMENT, id);
  if (result == STORE_OK && cat) {
    result = catalogue_put_alignment(cat, &row, tenant);
  }
  objects_let_go(store);
  return result;
}

static store_result put(catalogue *cat, objects *store, const char *id, const char *tenant, const orb_buffer *bytes) {
  object_temp temp;
  store_result result = objects_begin(store, &temp);
  if (result == STORE_OK) {
    result = objects_append(&temp, bytes->data, bytes->size);
    result = result == STORE_OK ? alignments_publish(cat, store, id, tenant, &temp) : result;
    objects_abandon(&temp);
  }
  return result;
}

void alignments_put(catalogue *cat, objects *store, orb_context *ctx, const char *id, const char *tenant,
                    const orb_align_shape *shapes, const orb_alignment *alignment) {
  orb_buffer bytes = {0};
  if (orb_alignment_write(ctx, shapes, alignment, &bytes) != ORB_OK ||
      put(cat, store, id, tenant, &bytes) != STORE_OK) {
    log_warn("the alignment %s could not be kept", id);
  }
  orb_buffer_free(ctx, &bytes);
}
