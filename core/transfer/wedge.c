/* Attributes at the corners of a supermesh, for attributes that a triangle may blend: normals and colours.
 *
 * A place strictly inside an input triangle has one value. A place on an input edge or at an input vertex has one value
 * for each side of the seams through it. A corner of a supermesh triangle takes the value of the input triangle that
 * its own triangle points into, by exact orientations on the sphere: on an edge, the side on which the triangle's
 * centroid lies; at a vertex, the sector of the fan that holds the centroid's direction. */
#include "transfer/wedge.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "mesh/normals.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { MAX_WIDTH = 4 };       /* red, green, blue, alpha */
enum { GRAIN = 4096 };        /* vertices a thread takes at a time */
enum { CHECK_EVERY = 65536 }; /* corners between two checks for cancellation */
/* Values of one vertex that differ by less are one: below what 8 bits per channel, or a normal on a screen, can show.
 */
static const float SAME = 1e-6f;
static const double NORMAL_SEAM = 0.01; /* half a degree: rounded normals of one smooth vertex differ by that */
static const double COLOR_SEAM = 1e-3;  /* a quarter of a step of 8 bits */
static const double NO_NORMAL = 1e-6;   /* length of a mean of unit normals: a shorter one has no direction */
static const double ON_EDGE = 1e-9;     /* a barycentric coordinate below this counts as zero */

typedef struct wedge_job {
  const orb_supermesh *supermesh;
  const orb_aligned_shape *shape;
  const orb_place *places;
  const int32_t *twin;         /* NULL: the attribute has no seam anywhere */
  const float *corner_values;  /* `width` numbers per corner of the input, or NULL */
  const double *vertex_values; /* `width` numbers per vertex of the input, used where corner_values is NULL or zero */
  int32_t width;
  int unit;         /* the values are normals, to be scaled to unit length */
  double tolerance; /* values of the input that differ by at most this make no seam */
  orb_wedges *out;
  unsigned char *seamed; /* per supermesh vertex: its corners may differ */
} wedge_job;

/* The attribute at corner h of the input. */
static void input_value(const wedge_job *job, int64_t h, double out[MAX_WIDTH]) {
  double sum = 0;
  if (job->corner_values) {
    for (int c = 0; c < job->width; c++) {
      out[c] = (double)job->corner_values[job->width * h + c];
      sum += out[c] * out[c];
    }
  }
  if (!job->corner_values || (job->unit && !(sum > 0.25 && isfinite(sum)))) {
    const double *value = job->vertex_values + job->width * (int64_t)job->shape->mesh.triangles[h];
    memcpy(out, value, (size_t)job->width * sizeof *out);
  }
}

static int same_value(const wedge_job *job, int64_t g, int64_t h) {
  double a[MAX_WIDTH], b[MAX_WIDTH];
  input_value(job, g, a);
  input_value(job, h, b);
  for (int c = 0; c < job->width; c++) {
    if (!(fabs(a[c] - b[c]) <= job->tolerance)) {
      return 0;
    }
  }
  return 1;
}

static void store(const wedge_job *job, const double value[MAX_WIDTH], int32_t triangle, float *out) {
  double v[MAX_WIDTH];
  memcpy(v, value, sizeof v);
  if (job->unit && !(orb_normalize(v) > NO_NORMAL)) {
    orb_face_normal(&job->shape->mesh, triangle, v);
    if (!(orb_normalize(v) > 0)) {
      v[0] = v[1] = 0;
      v[2] = 1;
    }
  }
  for (int c = 0; c < job->width; c++) {
    out[c] = (float)v[c] + 0.0f; /* no negative zeros */
  }
}

static void interpolate(const wedge_job *job, const orb_place *place, float *out) {
  double sum[MAX_WIDTH] = {0}, value[MAX_WIDTH] = {0};
  for (int k = 0; k < 3; k++) {
    if (place->at[k] > 0) {
      input_value(job, 3 * (int64_t)place->triangle + k, value);
      for (int c = 0; c < job->width; c++) {
        sum[c] += place->at[k] * value[c];
      }
    }
  }
  store(job, sum, place->triangle, out);
}

/* The corner of its triangle at which a place lies, or −1; *edge: the half-edge that it lies on, or −1. */
static int place_kind(const orb_place *place, int32_t *edge) {
  int zero[3], zeros = 0;
  for (int k = 0; k < 3; k++) {
    zero[k] = place->at[k] < ON_EDGE;
    zeros += zero[k];
  }
  *edge = -1;
  if (zeros == 2) {
    return !zero[0] ? 0 : !zero[1] ? 1 : 2;
  }
  if (zeros == 1) {
    int k = zero[0] ? 0 : zero[1] ? 1 : 2;
    *edge = orb_next(3 * place->triangle + k);
  }
  return -1;
}

/* Whether the corners at the vertex of corner h have different values. */
static int fan_differs(const wedge_job *job, int32_t h) {
  int32_t g = job->twin[orb_prev(h)];
  while (g != h) {
    if (!same_value(job, h, g)) {
      return 1;
    }
    g = job->twin[orb_prev(g)];
  }
  return 0;
}

static int has_seam(const wedge_job *job, const orb_place *place) {
  int32_t edge;
  int corner = place_kind(place, &edge);
  if (corner >= 0) {
    return fan_differs(job, 3 * place->triangle + corner);
  }
  if (edge < 0) {
    return 0;
  }
  int32_t twin = job->twin[edge];
  return !same_value(job, edge, orb_next(twin)) || !same_value(job, orb_next(edge), twin);
}

static void vertex_body(void *arg, int64_t begin, int64_t end, int thread) {
  wedge_job *job = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    interpolate(job, &job->places[v], job->out->values + job->width * v);
    if (job->seamed) {
      job->seamed[v] = (unsigned char)has_seam(job, &job->places[v]);
    }
  }
}

/* The corner of the fan of corner h whose sector holds the direction m. */
static int32_t sector_of(const wedge_job *job, int32_t h, const double m[3]) {
  const int32_t *triangles = job->shape->mesh.triangles;
  const double *points = job->shape->points;
  const double *p = points + 3 * (int64_t)triangles[h];
  int32_t g = h;
  do {
    const double *a = points + 3 * (int64_t)triangles[orb_next(g)];
    const double *b = points + 3 * (int64_t)triangles[orb_prev(g)];
    if (orb_orient(p, a, m) >= 0 && orb_orient(p, b, m) < 0) {
      return g;
    }
    g = job->twin[orb_prev(g)];
  } while (g != h);
  return h;
}

/* The value of the corner of a supermesh triangle whose centroid has direction m, at a place with a seam. */
static void corner_value(const wedge_job *job, const orb_place *place, const double m[3], float *out) {
  int32_t edge;
  int corner = place_kind(place, &edge);
  if (corner >= 0) {
    double value[MAX_WIDTH] = {0};
    int32_t g = sector_of(job, 3 * place->triangle + corner, m);
    input_value(job, g, value);
    store(job, value, g / 3, out);
    return;
  }
  const int32_t *triangles = job->shape->mesh.triangles;
  const double *a = job->shape->points + 3 * (int64_t)triangles[edge];
  const double *b = job->shape->points + 3 * (int64_t)triangles[orb_next(edge)];
  orb_place side = *place;
  if (orb_orient(a, b, m) < 0) {
    int32_t twin = job->twin[edge];
    side.triangle = twin / 3;
    side.at[twin % 3] = place->at[orb_next(edge) % 3];
    side.at[orb_next(twin) % 3] = place->at[edge % 3];
    side.at[orb_prev(twin) % 3] = 0;
  }
  interpolate(job, &side, out);
}

static void centroid(const orb_supermesh *supermesh, int64_t triangle, double out[3]) {
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; k < 3; k++) {
    const double *p = supermesh->points + 3 * (int64_t)supermesh->triangles[3 * triangle + k];
    for (int c = 0; c < 3; c++) {
      out[c] += p[c];
    }
  }
  orb_normalize(out);
}

orb_status orb_wedge_chain_begin(orb_context *ctx, int32_t vertex_count, orb_wedge_chain *chain) {
  chain->capacity = vertex_count;
  chain->next = ORB_NEW(ctx, int32_t, vertex_count);
  if (!chain->next) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < vertex_count; v++) {
    chain->next[v] = -2;
  }
  return ORB_OK;
}

static int close_values(const float *a, const float *b, int32_t width, float tolerance) {
  for (int32_t c = 0; c < width; c++) {
    if (!(fabsf(a[c] - b[c]) <= tolerance)) {
      return 0;
    }
  }
  return 1;
}

static orb_status grow_values(orb_context *ctx, orb_wedges *out, orb_wedge_chain *chain) {
  int64_t wanted = (int64_t)chain->capacity + chain->capacity / 2 + 64;
  if (wanted > INT32_MAX) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The supermesh has too many corners; ask for fewer triangles.");
  }
  float *values = orb_realloc(ctx, out->values, (size_t)wanted, (size_t)out->width * sizeof *values);
  if (!values) {
    return ORB_E_NO_MEMORY;
  }
  out->values = values;
  int32_t *next = orb_realloc(ctx, chain->next, (size_t)wanted, sizeof *next);
  if (!next) {
    return ORB_E_NO_MEMORY;
  }
  chain->next = next;
  chain->capacity = (int32_t)wanted;
  return ORB_OK;
}

orb_status orb_wedges_set(orb_context *ctx, orb_wedges *out, int32_t vertex, int64_t corner, const float *value,
                          float tolerance, orb_wedge_chain *chain) {
  size_t size = (size_t)out->width * sizeof *value;
  int32_t last = vertex;
  if (chain->next[vertex] == -2) {
    chain->next[vertex] = -1;
    memcpy(out->values + (int64_t)out->width * vertex, value, size);
    out->of_corner[corner] = vertex;
    return ORB_OK;
  }
  for (int32_t i = vertex; i >= 0; i = chain->next[i]) {
    if (close_values(out->values + (int64_t)out->width * i, value, out->width, tolerance)) {
      out->of_corner[corner] = i;
      return ORB_OK;
    }
    last = i;
  }
  if (out->value_count == chain->capacity) {
    ORB_TRY(grow_values(ctx, out, chain));
  }
  int32_t made = out->value_count++;
  memcpy(out->values + (int64_t)out->width * made, value, size);
  chain->next[made] = -1;
  chain->next[last] = made;
  out->of_corner[corner] = made;
  return ORB_OK;
}

/* The corners, after the vertices. Serial and in the order of corners; only few vertices lie on seams. */
static orb_status split_corners(orb_context *ctx, wedge_job *job) {
  const orb_supermesh *supermesh = job->supermesh;
  orb_wedge_chain chain = {0};
  orb_status status;
  job->out->of_corner = ORB_NEW(ctx, int32_t, 3 * (int64_t)supermesh->triangle_count);
  if (!job->out->of_corner) {
    return ORB_E_NO_MEMORY;
  }
  ORB_GO(status, orb_wedge_chain_begin(ctx, supermesh->vertex_count, &chain), done);
  for (int64_t h = 0; h < 3 * (int64_t)supermesh->triangle_count; h++) {
    int32_t v = supermesh->triangles[h];
    if (!job->seamed[v]) {
      job->out->of_corner[h] = v;
      continue;
    }
    double m[3];
    float value[MAX_WIDTH];
    centroid(supermesh, h / 3, m);
    corner_value(job, &job->places[v], m, value);
    ORB_GO(status, orb_wedges_set(ctx, job->out, v, h, value, SAME, &chain), done);
    if (h % CHECK_EVERY == 0) {
      ORB_GO(status, orb_context_check(ctx), done);
    }
  }
done:
  orb_free(ctx, chain.next);
  return status;
}

static int any_byte(const unsigned char *bytes, int32_t count) {
  return memchr(bytes, 1, (size_t)count) != NULL;
}

static orb_status make_wedges(orb_context *ctx, wedge_job *job) {
  const orb_supermesh *supermesh = job->supermesh;
  const orb_mesh *mesh = &job->shape->mesh;
  orb_status status = ORB_OK;
  int32_t *twin = NULL;
  job->out->width = job->width;
  job->out->value_count = supermesh->vertex_count;
  job->out->values = ORB_NEW(ctx, float, (int64_t)job->width * supermesh->vertex_count);
  job->seamed = NULL;
  if (!job->out->values) {
    status = ORB_E_NO_MEMORY;
    goto done;
  }
  if (job->corner_values) {
    twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)mesh->triangle_count);
    job->seamed = ORB_NEW0(ctx, unsigned char, supermesh->vertex_count);
    if (!twin || !job->seamed) {
      status = ORB_E_NO_MEMORY;
      goto done;
    }
    ORB_GO(status, orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin), done);
    job->twin = twin;
  }
  orb_parallel_for(ctx, supermesh->vertex_count, GRAIN, vertex_body, job);
  ORB_GO(status, orb_context_check(ctx), done);
  if (job->seamed && any_byte(job->seamed, supermesh->vertex_count)) {
    ORB_GO(status, split_corners(ctx, job), done);
  }
done:
  orb_free(ctx, twin);
  orb_free(ctx, job->seamed);
  if (status != ORB_OK) {
    orb_wedges_free(ctx, job->out);
  }
  return status;
}

static wedge_job job_of(const orb_supermesh *supermesh, const orb_aligned_shape *shape, int32_t s, orb_wedges *out) {
  memset(out, 0, sizeof *out);
  return (wedge_job){.supermesh = supermesh,
                     .shape = shape,
                     .places = supermesh->places + (int64_t)s * supermesh->vertex_count,
                     .out = out};
}

orb_status orb_wedge_normals(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape,
                             int32_t s, orb_wedges *out) {
  const orb_mesh *mesh = &shape->mesh;
  wedge_job job = job_of(supermesh, shape, s, out);
  double *smooth = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  if (!smooth) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status =
      orb_smooth_normals(ctx, mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count, smooth);
  if (status == ORB_OK) {
    job.corner_values = mesh->normals;
    job.vertex_values = smooth;
    job.width = 3;
    job.unit = 1;
    job.tolerance = NORMAL_SEAM;
    status = make_wedges(ctx, &job);
  }
  orb_free(ctx, smooth);
  return status;
}

orb_status orb_wedge_colors(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape, int32_t s,
                            orb_wedges *out) {
  memset(out, 0, sizeof *out);
  return shape->mesh.colors ? orb_wedge_colored(ctx, supermesh, shape, s, shape->mesh.colors, out) : ORB_OK;
}

orb_status orb_wedge_colored(orb_context *ctx, const orb_supermesh *supermesh, const orb_aligned_shape *shape,
                             int32_t s, const float *colors, orb_wedges *out) {
  wedge_job job = job_of(supermesh, shape, s, out);
  job.corner_values = colors;
  job.width = 4;
  job.tolerance = COLOR_SEAM;
  return make_wedges(ctx, &job);
}

void orb_wedges_free(orb_context *ctx, orb_wedges *wedges) {
  orb_free(ctx, wedges->values);
  orb_free(ctx, wedges->of_corner);
  memset(wedges, 0, sizeof *wedges);
}
