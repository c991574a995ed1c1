#include "support_shared.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "orbmorph/format.h"

unsigned char *shared_bytes(const char *folder, const char *name, size_t *size) {
  char path[4096];
  snprintf(path, sizeof path, "%s/%s/%s", ORB_SHARED_MESHES, folder, name);
  FILE *file = fopen(path, "rb");
  if (!file) {
    return NULL;
  }
  assert_int_equal(fseek(file, 0, SEEK_END), 0);
  long length = ftell(file);
  assert_true(length >= 0);
  rewind(file);
  *size = (size_t)length;
  unsigned char *bytes = malloc(*size + 1);
  assert_non_null(bytes);
  assert_int_equal(fread(bytes, 1, *size, file), *size);
  bytes[*size] = 0;
  fclose(file);
  return bytes;
}

int shared_mesh(orb_context *ctx, const char *name, orb_mesh *mesh) {
  size_t size;
  unsigned char *bytes = shared_bytes("good", name, &size);
  if (!bytes) {
    return 0;
  }
  assert_int_equal(orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, mesh, NULL), ORB_OK);
  free(bytes);
  assert_int_equal(orb_mesh_repair(ctx, mesh, ORB_REPAIR_SAFE), ORB_OK);
  return 1;
}
