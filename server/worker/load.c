/* Inputs of a job: uploaded meshes, stored spheres, landmarks as places. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "store/verify.h"
#include "worker/run.h"
#include "worker/sphere.h"

store_result run_get(const run_env *env, resource_kind kind, const char *id, resource *out) {
  return env->get ? env->get(env->user, kind, id, out) : catalogue_get(env->cat, kind, id, out);
}

/* Loads an object whose bytes have this hash. */
static int load_verified(const run_env *env, object_kind kind, const char *id, const char *sha, unsigned char **bytes,
                         size_t *size) {
  char found[API_ID_SIZE];
  if (objects_load(env->store, kind, id, bytes, size) != STORE_OK) {
    return 0;
  }
  api_id_of_text((const char *)*bytes, *size, found);
  if (strcmp(found, sha) == 0) {
    return 1;
  }
  free(*bytes);
  *bytes = NULL;
  verify_again(env->store, kind, id, sha); /* within a process of its own, the daemon does this: worker/isolated.c */
  return 0;
}

/* An uploaded file. It may have any size, however few its triangles, so a large one is not copied into memory, which
 * the job's budget would not know of: its pages can be dropped. */
typedef struct mesh_file {
  unsigned char *bytes;
  size_t size;
  int is_mapped;
} mesh_file;

enum { MAPPED_BYTES = 1 << 20 }; /* a smaller file is read in less time than it is mapped */

static void close_mesh_file(mesh_file *file) {
  if (file->is_mapped) {
    munmap(file->bytes, file->size);
  } else {
    free(file->bytes);
  }
}

/* Opens a mesh whose bytes have this hash. A large file is read for its hash before it is mapped, so a disk that fails
 * shows as a damaged mesh. */
static int open_mesh_file(const run_env *env, const char *id, const char *sha, mesh_file *file) {
  char found[API_ID_SIZE];
  int fd;
  uint64_t size;
  *file = (mesh_file){0};
  if (objects_read(env->store, OBJECT_MESH, id, &fd, &size) != STORE_OK) {
    return 0;
  }
  if (size <= MAPPED_BYTES) {
    close(fd);
    return load_verified(env, OBJECT_MESH, id, sha, &file->bytes, &file->size);
  }
  const int matches = verify_hash(fd, found) && strcmp(found, sha) == 0;
  void *at = matches ? mmap(NULL, size, PROT_READ, MAP_PRIVATE, fd, 0) : MAP_FAILED;
  close(fd);
  if (!matches) {
    verify_again(env->store, OBJECT_MESH, id, sha);
  } else if (at != MAP_FAILED) {
    *file = (mesh_file){at, size, 1};
  }
  return file->is_mapped;
}

static void note_triangles(const orb_mesh *raw, file_triangle *noted, int32_t count) {
  for (int32_t i = 0; i < count; i++) {
    int32_t t = noted[i].index;
    noted[i].corners[0] = -1;
    if (t < 0) {
      continue;
    }
    if (t >= raw->triangle_count || raw->source_triangle[t] != t) {
      for (t = 0; t < raw->triangle_count && raw->source_triangle[t] != noted[i].index; t++) {
      }
    }
    for (int k = 0; k < 3 && t < raw->triangle_count; k++) {
      noted[i].corners[k] = raw->source[raw->triangles[3 * (size_t)t + (size_t)k]];
    }
  }
}

/* Before repairs, a mesh has the file's triangles in the file's order, and `source` has the file's vertex numbers. */
static int32_t *copy_corners(orb_context *ctx, const orb_mesh *raw) {
  int32_t *corners = orb_alloc(ctx, 3 * (size_t)raw->triangle_count, sizeof *corners);
  for (size_t h = 0; corners && h < 3 * (size_t)raw->triangle_count; h++) {
    corners[h] = raw->source[raw->triangles[h]];
  }
  return corners;
}

/* Copies what is left of the file once it is repaired. */
static orb_status copy_file(orb_context *ctx, const orb_mesh *mesh, orb_format format, const unsigned char *bytes,
                            size_t size, run_file *out) {
  if (format == ORB_FORMAT_GLTF || format == ORB_FORMAT_GLB) {
    out->bytes = orb_alloc(ctx, size, 1);
    if (!out->bytes) {
      return ORB_E_NO_MEMORY;
    }
    memcpy(out->bytes, bytes, size);
    out->size = size;
  }
  return out->wants_mesh ? orb_mesh_copy(ctx, mesh, &out->mesh) : ORB_OK;
}

int run_load_mesh(const run_env *env, orb_context *ctx, const char *id, orb_mesh *mesh, file_triangle *noted,
                  int32_t noted_count, int32_t **corners, run_file *raw, api_problem *problem) {
  resource row = {0};
  api_mesh_summary summary;
  orb_repair_options repair;
  char canonical[API_REPAIR_TEXT];
  mesh_file file;
  memset(mesh, 0, sizeof *mesh);
  store_result found = run_get(env, RESOURCE_MESH, id, &row);
  if (found == STORE_NOT_FOUND) {
    return api_refuse(problem, "not-found", "Mesh %s was deleted before the job could use it.", id);
  }
  int fine = found == STORE_OK && api_mesh_summarise(row.json, &summary) &&
             api_repair_parse(summary.repair, NULL, NULL, &repair, canonical, problem);
  fine = fine && open_mesh_file(env, id, row.sha, &file);
  resource_free(&row);
  if (!fine) {
    return api_refuse(problem, "corrupt", "The stored mesh %s cannot be read or was altered; upload it again.", id);
  }
  orb_format format = orb_format_of_name(summary.format);
  orb_status status = orb_mesh_read(ctx, file.bytes, file.size, format, mesh, NULL);
  if (status == ORB_OK && raw) {
    status = copy_file(ctx, mesh, format, file.bytes, file.size, raw);
  }
  close_mesh_file(&file);
  if (status == ORB_OK) {
    note_triangles(mesh, noted, noted_count);
    if (corners && !(*corners = copy_corners(ctx, mesh))) {
      return 0;
    }
    status = orb_mesh_repair_with(ctx, mesh, &repair);
  }
  return status == ORB_OK;
}

int run_load_points(const run_env *env, orb_context *ctx, const char *embedding, const orb_mesh *mesh, double **points,
                    api_problem *problem) {
  unsigned char *bytes = NULL;
  size_t size = 0;
  *points = NULL;
  resource row = {0};
  int fine = run_get(env, RESOURCE_EMBEDDING, embedding, &row) == STORE_OK &&
             load_verified(env, OBJECT_SPHERE, embedding, row.sha, &bytes, &size);
  resource_free(&row);
  size_t count = (size_t)mesh->vertex_count;
  const unsigned char *first = fine ? sphere_points(bytes, size, mesh->vertex_count, mesh->triangle_count) : NULL;
  if (!first) {
    free(bytes);
    return api_refuse(
        problem, "corrupt",
        "The stored embedding %s cannot be read or does not match its mesh: DELETE it and request it again.",
        embedding);
  }
  *points = orb_alloc(ctx, 3 * count, sizeof **points);
  for (size_t v = 0; *points && v < count; v++) {
    memcpy(*points + 3 * v, first + v * SPHERE_STRIDE, 3 * sizeof(double));
  }
  free(bytes);
  if (env->cat) {
    catalogue_touch(env->cat, RESOURCE_EMBEDDING, embedding);
  }
  return *points != NULL;
}

static int place_triangle(const orb_mesh *mesh, const api_place *spot, const file_triangle *noted, orb_place *out,
                          const char **why) {
  int32_t t = 0;
  while (t < mesh->triangle_count && mesh->source_triangle[t] != spot->index) {
    t++;
  }
  if (t == mesh->triangle_count || noted->corners[0] < 0) {
    *why = "this triangle of the file was dropped because it was degenerate or a duplicate";
    return 0;
  }
  /* A repair may have reordered the triangle's corners, so they are matched by vertex. */
  out->triangle = t;
  int used[3] = {0, 0, 0};
  for (int k = 0; k < 3; k++) {
    int32_t vertex = mesh->vertex_of_source[noted->corners[k]];
    int corner = 0;
    while (corner < 3 && (used[corner] || vertex < 0 ||
                          mesh->source[mesh->triangles[3 * (size_t)t + (size_t)corner]] != mesh->source[vertex])) {
      corner++;
    }
    if (corner == 3) {
      *why = "the repair changed this triangle of the file";
      return 0;
    }
    used[corner] = 1;
    out->at[corner] = spot->at[k];
  }
  return 1;
}

int run_place(orb_context *ctx, const orb_mesh *mesh, const api_place *spot, const file_triangle *noted,
              orb_nearest **tree, orb_place *out, const char **why) {
  *why = NULL;
  if (spot->kind == API_PLACE_TRIANGLE) {
    return place_triangle(mesh, spot, noted, out, why);
  }
  if (spot->kind == API_PLACE_POINT) {
    if (!*tree && orb_nearest_create(ctx, mesh->positions, mesh->triangles, mesh->triangle_count, tree) != ORB_OK) {
      return 0;
    }
    orb_nearest_query(*tree, spot->at, INFINITY, out);
    return 1;
  }
  int32_t vertex = spot->index < mesh->file_vertex_count ? mesh->vertex_of_source[spot->index] : -1;
  if (vertex < 0) {
    *why = spot->index < mesh->file_vertex_count
               ? "this vertex of the file was dropped because no triangle uses it or the repair removed it"
               : "the file has fewer vertices";
    return 0;
  }
  return orb_place_of_vertex(ctx, mesh, vertex, out) == ORB_OK;
}
