/* Which triangles of a supermesh are inverted on a shape. */
#include <string.h>

#include "base/check.h"
#include "base/loops.h"
#include "base/memory.h"
#include "mesh/normals.h"
#include "numeric/vec3.h"
#include "orbmorph/merge.h"

enum { GRAIN = 4096 }; /* vertices or triangles a thread takes at a time */
/* Twice the area, relative to the squared diagonal, up to which a triangle counts as degenerate. */
static const double DEGENERATE = 1e-12;

typedef struct inverted_job {
  const orb_supermesh *supermesh;
  const orb_mesh *mesh;
  const orb_place *places;
  const double *positions;
  const double *smooth; /* per vertex of the input: its smooth normal */
  double *ground;       /* per vertex of the supermesh: the input's smooth normal at its place */
  double floor;         /* twice the area up to which a triangle counts as degenerate */
  unsigned char *inverted;
} inverted_job;

static void ground_body(void *arg, int64_t begin, int64_t end, int thread) {
  const inverted_job *job = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    const orb_place *place = &job->places[v];
    double *normal = job->ground + 3 * v;
    memset(normal, 0, 3 * sizeof *normal);
    for (int k = 0; k < 3; k++) {
      const double *n = job->smooth + 3 * (int64_t)job->mesh->triangles[3 * (int64_t)place->triangle + k];
      for (int c = 0; c < 3; c++) {
        normal[c] += place->at[k] * n[c];
      }
    }
    orb_normalize(normal);
  }
}

static void corner_normal(const double *positions, const int32_t *corner, double out[3]) {
  double u[3], w[3];
  orb_sub(positions + 3 * (int64_t)corner[1], positions + 3 * (int64_t)corner[0], u);
  orb_sub(positions + 3 * (int64_t)corner[2], positions + 3 * (int64_t)corner[0], w);
  orb_cross(u, w, out);
}

/* Marks the triangles that face away from the smooth normals at their corners. */
static void against_body(void *arg, int64_t begin, int64_t end, int thread) {
  const inverted_job *job = arg;
  (void)thread;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *corner = job->supermesh->triangles + 3 * t;
    double normal[3], sum[3] = {0};
    corner_normal(job->positions, corner, normal);
    for (int k = 0; k < 3; k++) {
      for (int c = 0; c < 3; c++) {
        sum[c] += job->ground[3 * (int64_t)corner[k] + c];
      }
    }
    job->inverted[t] = (unsigned char)(orb_length(normal) > job->floor && orb_dot(normal, sum) < 0);
  }
}

/* Whether a triangle also faces away from the input's face at its centre. Where an edge of the input is sharper than a
 * right angle, a triangle within one face can face away from the smooth normals although it is the surface itself.
 * Creates the locator when it is first needed. */
static orb_status against_face(orb_context *ctx, const orb_aligned_shape *shape, const double *points,
                               const int32_t *corner, const double normal[3], orb_locator **locator, int *against) {
  const orb_mesh *mesh = &shape->mesh;
  if (!*locator) {
    ORB_TRY(orb_locator_create(ctx, shape->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, NULL,
                               locator));
  }
  double centre[3], face[3];
  for (int c = 0; c < 3; c++) {
    centre[c] =
        points[3 * (int64_t)corner[0] + c] + points[3 * (int64_t)corner[1] + c] + points[3 * (int64_t)corner[2] + c];
  }
  orb_normalize(centre);
  orb_place place;
  orb_locate(*locator, centre, -1, &place);
  orb_face_normal(mesh, place.triangle, face);
  *against = orb_dot(normal, face) < 0;
  return ORB_OK;
}

/* Unmarks those that face as the input's face does. */
static orb_status check_faces(orb_context *ctx, const orb_aligned_shape *shape, const inverted_job *job) {
  orb_locator *locator = NULL;
  orb_status status = ORB_OK;
  for (int64_t t = 0; status == ORB_OK && t < job->supermesh->triangle_count; t++) {
    if (job->inverted[t]) {
      const int32_t *corner = job->supermesh->triangles + 3 * t;
      double normal[3];
      int against = 0;
      corner_normal(job->positions, corner, normal);
      status = against_face(ctx, shape, job->supermesh->points, corner, normal, &locator, &against);
      job->inverted[t] = (unsigned char)against;
    }
  }
  orb_locator_destroy(ctx, locator);
  return status;
}

orb_status orb_mark_inverted(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape,
                             int32_t s, const double *positions, unsigned char *inverted) {
  const orb_mesh *mesh = &shape->mesh;
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  double *smooth = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  double *ground = ORB_NEW(ctx, double, 3 * (int64_t)supermesh->vertex_count);
  inverted_job job = {.supermesh = supermesh,
                      .mesh = mesh,
                      .places = supermesh->places + (int64_t)s * supermesh->vertex_count,
                      .positions = positions,
                      .smooth = smooth,
                      .ground = ground,
                      .floor = DEGENERATE * extent.diagonal * extent.diagonal,
                      .inverted = inverted};
  orb_status status = smooth && ground ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    ORB_GO(status,
           orb_smooth_normals(ctx, mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count, smooth),
           done);
    ORB_GO(status, orb_sliced_for(ctx, supermesh->vertex_count, GRAIN, ground_body, &job), done);
    ORB_GO(status, orb_sliced_for(ctx, supermesh->triangle_count, GRAIN, against_body, &job), done);
    ORB_GO(status, check_faces(ctx, shape, &job), done);
  }
done:
  orb_free(ctx, smooth);
  orb_free(ctx, ground);
  return status;
}
