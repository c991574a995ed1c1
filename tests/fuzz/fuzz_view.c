/* A GLB file, read with its textures as `orbmorph view` reads it; small ones are also drawn. The indices of the mesh
 * must be in range. */
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "view.h"
#include "view_mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { DRAWN_MOST = 300 };

static void check(const view_mesh *mesh) {
  for (uint32_t i = 0; i < mesh->index_count; i++) {
    if (mesh->indices[i] >= mesh->vertex_count || mesh->painted[i / 3] < 0 ||
        mesh->painted[i / 3] >= mesh->materials.count) {
      abort();
    }
  }
  for (int32_t m = 0; m < mesh->materials.count; m++) {
    if (mesh->materials.list[m].texture < -1 || mesh->materials.list[m].texture >= mesh->materials.texture_count) {
      abort();
    }
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char path[64], error[200] = "";
  int fd = memfd_create("glb", MFD_CLOEXEC);
  if (fd < 0 || write(fd, data, size) != (ssize_t)size) {
    abort();
  }
  snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
  view_mesh mesh;
  if (view_mesh_read(path, &mesh, error, sizeof error) == 0) {
    check(&mesh);
    int drawn = mesh.index_count <= DRAWN_MOST && mesh.target_count <= 4;
    view_mesh_free(&mesh);
    view_options options;
    view_defaults(&options);
    options.poses = 2;
    options.size = 16;
    if (drawn && view_file(path, "/dev/null", &options, error, sizeof error) != 0 && !error[0]) {
      abort(); /* refused without a reason */
    }
  } else if (!error[0]) {
    abort();
  }
  close(fd);
  return 0;
}
