/* Feeds bytes to one reader and its result to the repairs: nothing may crash or hang, or take more memory and processor
 * time than the multiples of docs/limits.md allow for the bytes. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "../unit/support_zip.h"
#include "cost.h"
#include "orbmorph/format.h"

/* Bytes of memory per byte, by format (docs/limits.md). */
static const size_t multiples[] = {
    [ORB_FORMAT_OBJ] = 110,  [ORB_FORMAT_OFF] = 110, [ORB_FORMAT_PLY] = 200, [ORB_FORMAT_STL] = 12,
    [ORB_FORMAT_GLTF] = 200, [ORB_FORMAT_GLB] = 200, [ORB_FORMAT_3MF] = 120};
enum {
  HAS_TABLES = FUZZ_FORMAT == ORB_FORMAT_3MF || FUZZ_FORMAT == ORB_FORMAT_GLTF || FUZZ_FORMAT == ORB_FORMAT_GLB,
  MEMORY_AT_LEAST = HAS_TABLES ? 6 << 20 : 2 << 20,
  MEMORY_A_BYTE_REPAIRED = 400
};

/* 2 µs per byte, as docs/limits.md says, for a build with sanitizers and coverage; SECONDS_AT_LEAST covers the
 * constants of that page. */
static const double SECONDS_A_BYTE = 2e-6, SECONDS_AT_LEAST = 3;

/* What filling holes may add (docs/limits.md, server/budget.c): up to 6 triangles a byte; 16,384, or as many as the
 * mesh has, which are up to 4 a byte where glTF shows it several times; and 131,072. */
enum { FILL_BYTES = 7200, FILL_MOST = 160 << 20 };
static const double FILL_SECONDS_A_BYTE = 75e-6, FILL_SECONDS_OF_MESH = 50e-6, FILL_LEAST = 0.2, FILL_SECONDS = 1.6;

static void check_cost(const orb_context *ctx, size_t size, size_t multiple, int fills, double began,
                       const char *what) {
  const double by_mesh = fmin(fmax(FILL_SECONDS_OF_MESH * (double)size, FILL_LEAST), FILL_SECONDS);
  const double fill_seconds = fills ? fmin(FILL_SECONDS_A_BYTE * (double)size, by_mesh) : 0;
  const size_t fill_bytes = !fills ? 0 : size < FILL_MOST / FILL_BYTES ? FILL_BYTES * size : FILL_MOST;
  fuzz_check_cost(ctx, began, multiple * size + MEMORY_AT_LEAST + fill_bytes,
                  FUZZ_SLOWER * (SECONDS_A_BYTE * (double)size + fill_seconds) + SECONDS_AT_LEAST, size, what);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The XML of 3MF: an input that is not an archive becomes one with a correct checksum, so that mutations reach the
 * reader. Bytes after a 0 are a second file. */
static archive archive_of(const uint8_t *data, size_t size) {
  archive a = {0};
  const uint8_t *end = size ? memchr(data, 0, size) : NULL;
  size_t first = end ? (size_t)(end - data) : size;
  archive_add(&a, "3D/3dmodel.model", data, first, 1);
  if (end) {
    archive_add(&a, "3D/b.model", end + 1, size - first - 1, 1);
  }
  archive_end(&a);
  return a;
}

static int fuzz(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  if (FUZZ_FORMAT != ORB_FORMAT_3MF || (size > 1 && data[0] == 'P' && data[1] == 'K')) {
    return fuzz(data, size);
  }
  archive a = archive_of(data, size);
  int result = fuzz(a.bytes, a.size);
  archive_free(&a);
  return result;
}

static int fuzz(const uint8_t *data, size_t size) {
  orb_context_options options = {.threads = 1};
  orb_context *ctx;
  if (orb_context_create(&options, &ctx) != ORB_OK) {
    return 0;
  }
  (void)orb_format_detect(data, size);
  orb_mesh mesh;
  double began = fuzz_begin();
  orb_status read = orb_mesh_read(ctx, data, size, FUZZ_FORMAT, &mesh, NULL);
  check_cost(ctx, size, multiples[FUZZ_FORMAT], 0, began, "reading");
  if (read == ORB_OK) {
    orb_topology topology;
    orb_mesh copy;
    if (orb_mesh_topology(ctx, &mesh, &topology) != ORB_OK) {
      abort();
    }
    static const unsigned repairs[] = {ORB_REPAIR_NONE, ORB_REPAIR_SAFE,
                                       ORB_REPAIR_FILL_HOLES | ORB_REPAIR_LARGEST_COMPONENT,
                                       ORB_REPAIR_FILL_HOLES | ORB_REPAIR_PART | ORB_REPAIR_CLOSE_HANDLES,
                                       ORB_REPAIR_SPLIT | ORB_REPAIR_LARGEST_COMPONENT};
    for (int i = 0; i < 5; i++) {
      if (orb_mesh_copy(ctx, &mesh, &copy) != ORB_OK) {
        abort();
      }
      if (orb_mesh_repair_with(ctx, &copy, &(orb_repair_options){.repair = repairs[i], .handle_size = 10}) == ORB_OK &&
          (orb_mesh_topology(ctx, &copy, &topology) != ORB_OK || topology.components != 1 || topology.genus != 0 ||
           topology.boundary_edges || topology.nonmanifold_edges || topology.nonmanifold_vertices ||
           !topology.consistent || copy.triangle_count < 4)) {
        abort(); /* accepted although it is not a sphere */
      }
      orb_mesh_free(ctx, &copy);
    }
    orb_mesh_free(ctx, &mesh);
  }
  check_cost(ctx, size, MEMORY_A_BYTE_REPAIRED, 1, began, "reading and repairing");
  orb_context_destroy(ctx);
  return 0;
}
