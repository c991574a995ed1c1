/* The certificate of a supermesh, exact throughout.
 *
 * Closed and manifold: half-edges pair up and the corners of each vertex form one ring. Connected with T = 2V − 4:
 * genus zero. No triangle flipped: every orientation is exactly positive. Then the mesh maps to the sphere by a local
 * homeomorphism away from the vertices, and its degree is the number of triangles that hold any one direction on no
 * edge. They are counted with the same exact test, so no solid angle has to be summed. Degree 1: a bijection. */
#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/predicates.h"
#include "orbmorph/remesh.h"

typedef struct orientation_count {
  const orb_supermesh *mesh;
  int64_t *flipped; /* per chunk of GRAIN triangles */
} orientation_count;

enum { GRAIN = 4096 };    /* triangles a thread takes at a time */
enum { DIRECTIONS = 16 }; /* tried until one lies on no edge */
/* The first direction, and the difference between two. Their digits have no meaning: a mesh is unlikely to have edges
 * there. */
static const double FIRST[3] = {0.5377, -0.3119, 0.7833}, STEP[3] = {0.0131, 0.0373, -0.0577};

static const double *corner(const orb_supermesh *mesh, int64_t h) {
  return mesh->points + 3 * (int64_t)mesh->triangles[h];
}

static void count_flipped(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  orientation_count *count = arg;
  int64_t flipped = 0;
  for (int64_t t = begin; t < end; t++) {
    flipped +=
        orb_orient(corner(count->mesh, 3 * t), corner(count->mesh, 3 * t + 1), corner(count->mesh, 3 * t + 2)) <= 0;
  }
  count->flipped[begin / GRAIN] = flipped;
}

/* The number of triangles that hold q; −1 if q lies on the border of one. */
static int32_t cover(const orb_supermesh *mesh, const double q[3]) {
  int32_t count = 0;
  for (int64_t t = 0; t < mesh->triangle_count; t++) {
    int a = orb_orient(corner(mesh, 3 * t), corner(mesh, 3 * t + 1), q);
    if (a < 0) {
      continue;
    }
    int b = orb_orient(corner(mesh, 3 * t + 1), corner(mesh, 3 * t + 2), q);
    if (b < 0) {
      continue;
    }
    int c = orb_orient(corner(mesh, 3 * t + 2), corner(mesh, 3 * t), q);
    if (c < 0) {
      continue;
    }
    if (!a || !b || !c) {
      return -1;
    }
    count++;
  }
  return count;
}

static int32_t degree_of(const orb_supermesh *mesh) {
  for (int i = 0; i < DIRECTIONS; i++) {
    const double q[3] = {FIRST[0] + STEP[0] * i, FIRST[1] + STEP[1] * i, FIRST[2] + STEP[2] * i};
    int32_t count = cover(mesh, q);
    if (count >= 0) {
      return count;
    }
  }
  return 0;
}

/* One ring of corners at every vertex, and one component; with T = 2V − 4 the mesh is a sphere. */
static orb_status check_topology(orb_context *ctx, const orb_supermesh *mesh, const int32_t *twin) {
  int32_t half_edges = 3 * mesh->triangle_count, rings = 0, reached = 0, top = 0;
  unsigned char *seen = ORB_NEW0(ctx, unsigned char, half_edges);
  int32_t *stack = ORB_NEW(ctx, int32_t, mesh->triangle_count);
  unsigned char *marked = ORB_NEW0(ctx, unsigned char, mesh->triangle_count);
  orb_status status = seen && stack && marked ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    for (int32_t first = 0; first < half_edges; first++) {
      rings += !seen[first];
      for (int32_t h = first; !seen[h]; h = twin[orb_prev(h)]) {
        seen[h] = 1;
      }
    }
    stack[top++] = 0;
    marked[0] = 1;
    while (top > 0) {
      int32_t t = stack[--top];
      reached++;
      for (int k = 0; k < 3; k++) {
        int32_t next = twin[3 * t + k] / 3;
        if (!marked[next]) {
          marked[next] = 1;
          stack[top++] = next;
        }
      }
    }
    if (rings != mesh->vertex_count || reached != mesh->triangle_count) {
      status = orb_fail(ctx, ORB_E_NOT_CERTIFIED,
                        "The supermesh is not one closed surface: %d rings of triangles at %d vertices.", rings,
                        mesh->vertex_count);
    }
  }
  orb_free(ctx, seen);
  orb_free(ctx, stack);
  orb_free(ctx, marked);
  return status;
}

static orb_status check_orientation(orb_context *ctx, orb_supermesh *mesh) {
  int64_t chunks = ((int64_t)mesh->triangle_count + GRAIN - 1) / GRAIN;
  orientation_count count = {mesh, ORB_NEW0(ctx, int64_t, chunks)};
  if (!count.flipped) {
    return ORB_E_NO_MEMORY;
  }
  orb_parallel_for(ctx, mesh->triangle_count, GRAIN, count_flipped, &count);
  mesh->flipped = 0;
  for (int64_t i = 0; i < chunks; i++) {
    mesh->flipped += count.flipped[i];
  }
  orb_free(ctx, count.flipped);
  mesh->degree = mesh->flipped ? 0 : degree_of(mesh);
  if (mesh->flipped || mesh->degree != 1) {
    return orb_fail(ctx, ORB_E_NOT_CERTIFIED, "The supermesh has %lld flipped triangles on the sphere and degree %d.",
                    (long long)mesh->flipped, mesh->degree);
  }
  return ORB_OK;
}

orb_status orb_supermesh_check(orb_context *ctx, orb_supermesh *mesh) {
  mesh->flipped = -1;
  mesh->degree = 0;
  if (mesh->triangle_count < 4 || mesh->triangle_count != 2 * (int64_t)mesh->vertex_count - 4) {
    return orb_fail(ctx, ORB_E_NOT_CERTIFIED, "The supermesh has %d vertices and %d triangles, not T = 2V - 4.",
                    mesh->vertex_count, mesh->triangle_count);
  }
  int32_t *twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)mesh->triangle_count);
  if (!twin) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin);
  if (status == ORB_E_INTERNAL) {
    status = orb_fail(ctx, ORB_E_NOT_CERTIFIED, "The supermesh is not closed and manifold.");
  }
  if (status == ORB_OK) {
    status = check_topology(ctx, mesh, twin);
  }
  if (status == ORB_OK) {
    status = check_orientation(ctx, mesh);
  }
  orb_free(ctx, twin);
  return status;
}
