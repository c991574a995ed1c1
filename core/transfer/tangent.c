/* Tangents at the corners of a supermesh, on every frame of the asset, as glTF wants them: by MikkTSpace (Mikkelsen,
 * Simulation of Wrinkled Surfaces Revisited, 2008). Each triangle has the direction in which u grows; a vertex takes
 * the mean over its triangles, in the plane of its normal, weighted by their angles. Corners share a tangent if they
 * share normal and texture coordinates and their texture is mirrored alike.
 *
 * Texture coordinates are those that the texture sees, after KHR_texture_transform. v runs downward in glTF and the
 * bitangent upward. */
#include "transfer/tangent.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "transfer/materials.h"
#include "transfer/split.h"

enum { CHECK_EVERY = 16384 }; /* triangles between two checks for cancellation */

/* Corners that share a tangent. The first vertex_count groups belong to the vertices. */
typedef struct group {
  int32_t corner; /* one of them; −1: none yet */
  int32_t next;   /* of the same vertex, −1: none */
  int32_t sign;   /* of the bitangent; 0: not yet known, all triangles are degenerate in the texture */
} group;

typedef struct tangent_job {
  orb_context *ctx;
  orb_draft *draft;
  double (*axes)[4]; /* per material: u′ and v′ (up) by u and v; all 0: needs no tangents */
  group *groups;
  int32_t group_count;
  int32_t *of_corner;
} tangent_job;

/* The linear part of KHR_texture_transform, with v pointing up. */
static void axes_of(const orb_texture *texture, double out[4]) {
  double c = 1, s = 0, x = 1, y = 1;
  if (texture->is_transformed) {
    c = cos(texture->rotation);
    s = sin(texture->rotation);
    x = texture->scale[0];
    y = texture->scale[1];
  }
  out[0] = c * x;
  out[1] = s * y;
  out[2] = s * x;
  out[3] = -c * y;
}

/* Finds the materials that need tangents; returns how many there are. */
static int find_materials(const orb_draft *draft, double (*axes)[4]) {
  const orb_mesh *mesh = &draft->shapes[0].mesh;
  int count = 0;
  for (int32_t m = 0; m < mesh->material_count; m++) {
    const orb_texture *texture = orb_material_tangents(mesh, m, draft->options);
    if (texture) {
      axes_of(texture, axes[m]);
      count++;
    }
  }
  return count;
}

static const double *axes_at(const tangent_job *job, int64_t triangle) {
  const double *axes = job->axes[orb_draft_material(job->draft, triangle)];
  return axes[0] != 0 || axes[1] != 0 || axes[2] != 0 || axes[3] != 0 ? axes : NULL;
}

/* The edges from corner 0 of a triangle to corners 1 and 2, in the texture. Returns the sign of its area there. */
static int texture_edges(const tangent_job *job, int64_t t, const double axes[4], double edge[2][2]) {
  const orb_wedges *wedges = &job->draft->texcoords;
  const int32_t *triangles = job->draft->supermesh->triangles;
  const float *origin = wedges->values + 2 * (int64_t)orb_wedge_of(wedges, triangles, 3 * t);
  for (int k = 0; k < 2; k++) {
    const float *uv = wedges->values + 2 * (int64_t)orb_wedge_of(wedges, triangles, 3 * t + k + 1);
    double u = (double)uv[0] - (double)origin[0], v = (double)uv[1] - (double)origin[1];
    edge[k][0] = axes[0] * u + axes[1] * v;
    edge[k][1] = axes[2] * u + axes[3] * v;
  }
  double area = edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0];
  return area > 0 ? 1 : area < 0 ? -1 : 0;
}

/* Whether two corners of a vertex have the same normal on every frame, and the same texture coordinates. */
static int same_values(const orb_draft *draft, int64_t a, int64_t b) {
  const int32_t *triangles = draft->supermesh->triangles;
  for (int32_t f = 0; f < draft->frame_count; f++) {
    if (orb_wedge_of(&draft->normals[f], triangles, a) != orb_wedge_of(&draft->normals[f], triangles, b)) {
      return 0;
    }
  }
  return orb_wedge_of(&draft->texcoords, triangles, a) == orb_wedge_of(&draft->texcoords, triangles, b);
}

static void join_group(tangent_job *job, int64_t corner, int sign) {
  int32_t vertex = job->draft->supermesh->triangles[corner], g = vertex, last = -1;
  while (g >= 0 && job->groups[g].corner >= 0) {
    group *at = &job->groups[g];
    if ((sign == 0 || at->sign == 0 || at->sign == sign) && same_values(job->draft, at->corner, corner)) {
      at->sign = at->sign ? at->sign : sign;
      job->of_corner[corner] = g;
      return;
    }
    last = g;
    g = at->next;
  }
  if (g < 0) {
    g = job->group_count++;
    job->groups[last].next = g;
  }
  job->groups[g] = (group){.corner = (int32_t)corner, .next = -1, .sign = sign};
  job->of_corner[corner] = g;
}

static orb_status make_groups(tangent_job *job) {
  const orb_supermesh *supermesh = job->draft->supermesh;
  job->group_count = supermesh->vertex_count;
  for (int32_t v = 0; v < supermesh->vertex_count; v++) {
    job->groups[v] = (group){-1, -1, 0};
  }
  for (int64_t t = 0; t < supermesh->triangle_count; t++) {
    const double *axes = axes_at(job, t);
    double edge[2][2];
    int sign = axes ? texture_edges(job, t, axes, edge) : 0;
    for (int64_t h = 3 * t; h < 3 * t + 3; h++) {
      if (axes) {
        join_group(job, h, sign);
      } else {
        job->of_corner[h] = supermesh->triangles[h];
      }
    }
    if (t % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(job->ctx));
    }
  }
  return ORB_OK;
}

/* a without its part along the unit vector n, scaled to unit length. Returns whether anything is left. */
static int into_plane(const double a[3], const double n[3], double out[3]) {
  double along = orb_dot(a, n);
  for (int c = 0; c < 3; c++) {
    out[c] = a[c] - along * n[c];
  }
  return orb_normalize(out) > 0 && isfinite(out[0] + out[1] + out[2]);
}

static void normal_at(const orb_draft *draft, int32_t frame, int64_t corner, double out[3]) {
  const orb_wedges *normals = &draft->normals[frame];
  const float *value = normals->values + 3 * (int64_t)orb_wedge_of(normals, draft->supermesh->triangles, corner);
  for (int c = 0; c < 3; c++) {
    out[c] = (double)value[c];
  }
  orb_normalize(out);
}

/* Adds what triangle t says on a frame to the sums of its corners' groups. */
static void add_triangle(const tangent_job *job, int32_t frame, int64_t t, const double axes[4], double *sums) {
  const int32_t *corner = job->draft->supermesh->triangles + 3 * t;
  const double *p[3];
  double edge[2][2], along[3];
  int sign = texture_edges(job, t, axes, edge);
  if (sign == 0) {
    return;
  }
  for (int k = 0; k < 3; k++) {
    p[k] = job->draft->positions[frame] + 3 * (int64_t)corner[k];
  }
  for (int c = 0; c < 3; c++) {
    along[c] = sign * (edge[1][1] * (p[1][c] - p[0][c]) - edge[0][1] * (p[2][c] - p[0][c]));
  }
  for (int k = 0; k < 3; k++) {
    double normal[3], tangent[3], a[3], b[3];
    normal_at(job->draft, frame, 3 * t + k, normal);
    orb_sub(p[(k + 1) % 3], p[k], a);
    orb_sub(p[(k + 2) % 3], p[k], b);
    if (into_plane(along, normal, tangent) && into_plane(a, normal, a) && into_plane(b, normal, b)) {
      double angle = acos(fmax(-1, fmin(1, orb_dot(a, b))));
      double *sum = sums + 3 * (int64_t)job->of_corner[3 * t + k];
      for (int c = 0; c < 3; c++) {
        sum[c] += angle * tangent[c];
      }
    }
  }
}

/* The unit tangent of a group; where its triangles say nothing, any in the plane of the normal. */
static void finish_group(const tangent_job *job, int32_t frame, int32_t g, double sum[3]) {
  double normal[3];
  int64_t corner = job->groups[g].corner;
  if (corner < 0) {
    sum[0] = 1; /* never read */
    return;
  }
  normal_at(job->draft, frame, corner, normal);
  if (orb_normalize(sum) > 0) {
    return;
  }
  double axis[3] = {0};
  axis[fabs(normal[0]) < 0.6 ? 0 : fabs(normal[1]) < 0.6 ? 1 : 2] = 1;
  if (!into_plane(axis, normal, sum)) {
    memcpy(sum, axis, sizeof axis);
  }
}

/* sums: room for 3 numbers per group. */
static orb_status make_frame(tangent_job *job, int32_t frame, double *sums) {
  const orb_supermesh *supermesh = job->draft->supermesh;
  orb_wedges *out = &job->draft->tangents[frame], *base = &job->draft->tangents[0];
  out->width = frame ? 3 : 4;
  out->value_count = job->group_count;
  out->values = ORB_NEW(job->ctx, float, (int64_t)out->width * job->group_count);
  if (!out->values) {
    return ORB_E_NO_MEMORY;
  }
  memset(sums, 0, 3 * (size_t)job->group_count * sizeof *sums);
  for (int64_t t = 0; t < supermesh->triangle_count; t++) {
    const double *axes = axes_at(job, t);
    if (axes) {
      add_triangle(job, frame, t, axes, sums);
    }
    if (t % CHECK_EVERY == 0) {
      ORB_TRY(orb_context_check(job->ctx));
    }
  }
  for (int64_t g = 0; g < job->group_count; g++) {
    float *value = out->values + out->width * g;
    finish_group(job, frame, (int32_t)g, sums + 3 * g);
    for (int c = 0; c < 3; c++) {
      value[c] = (float)sums[3 * g + c] + 0.0f; /* no negative zeros */
      value[c] -= frame ? base->values[4 * g + c] : 0;
    }
    if (!frame) {
      value[3] = job->groups[g].sign < 0 ? -1 : 1;
    }
  }
  out->of_corner = job->of_corner; /* shared by all frames */
  return ORB_OK;
}

static orb_status make_tangents(tangent_job *job) {
  orb_draft *draft = job->draft;
  int64_t corners = 3 * (int64_t)draft->supermesh->triangle_count, room = corners + draft->supermesh->vertex_count;
  job->groups = ORB_NEW(job->ctx, group, room);
  job->of_corner = ORB_NEW(job->ctx, int32_t, corners);
  draft->tangents = ORB_NEW0(job->ctx, orb_wedges, draft->frame_count);
  if (!job->groups || !job->of_corner || !draft->tangents) {
    orb_free(job->ctx, job->of_corner);
    return ORB_E_NO_MEMORY;
  }
  draft->tangents[0].of_corner = job->of_corner;
  ORB_TRY(make_groups(job));
  double *sums = ORB_NEW(job->ctx, double, 3 * (int64_t)job->group_count);
  orb_status status = sums ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t f = 0; f < draft->frame_count && status == ORB_OK; f++) {
    status = make_frame(job, f, sums);
  }
  orb_free(job->ctx, sums);
  return status;
}

orb_status orb_draft_tangents(orb_context *ctx, orb_draft *draft) {
  tangent_job job = {.ctx = ctx, .draft = draft};
  if (!draft->normals || !draft->texcoords.width) {
    return ORB_OK;
  }
  job.axes = orb_calloc(ctx, (size_t)draft->shapes[0].mesh.material_count + 1, sizeof *job.axes);
  orb_status status = job.axes ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK && find_materials(draft, job.axes) > 0) {
    status = make_tangents(&job);
  }
  orb_free(ctx, job.groups);
  orb_free(ctx, job.axes);
  return status;
}
