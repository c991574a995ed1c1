#include "carry/bake.h"

#include <math.h>
#include <string.h>

#include "base/buffer.h"
#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "carry/pad.h"
#include "numeric/vec3.h"
#include "orbmorph/carry.h"
#include "orbmorph/locate.h"

enum { CHECK_EVERY = 1 << 20 }; /* texels between two checks for cancellation */
enum { GRAIN = 4096 };          /* texels a thread takes at a time */
enum { CHOSEN_MOST = 4096 };    /* texels a side that are chosen without being asked for: what clients can show */
enum { PAD_SHARE = 64 }; /* rings of padding: a 64th of the side, so that the first six smaller levels are clean */
enum { PAD_LEAST = 4 };
static const double INSIDE = -1e-9; /* a barycentric coordinate from here on counts as inside: rounding */
static const double WITHIN = 1e-6;  /* and from here on as more than touching */

typedef struct baker {
  orb_context *ctx;
  const orb_bake_job *job;
  const orb_locator *locator;
  const orb_texels *texels;
  int32_t side;
  int32_t *owner;       /* per texel: the triangle of the charts; −1: none */
  unsigned char *rgba;  /* 4 per texel */
  unsigned char *known; /* per texel */
  int64_t shared;
  double work; /* texels looked at since the last check for cancellation */
} baker;

/* Where the corners of a triangle of the charts lie in a triangle of the shape, if that holds all of them. */
static int32_t common_triangle(const baker *b, const int32_t v[3], double weight[3][3]) {
  const orb_supermesh *supermesh = b->job->supermesh;
  const orb_aligned_shape *shape = b->job->shape;
  const orb_place *places = supermesh->places + (int64_t)b->job->number * supermesh->vertex_count;
  double centre[3] = {0};
  orb_place home;
  for (int k = 0; k < 3; k++) {
    for (int c = 0; c < 3; c++) {
      centre[c] += supermesh->points[3 * (int64_t)v[k] + c];
    }
  }
  orb_normalize(centre);
  orb_locate(b->locator, centre, places[v[0]].triangle, &home);
  const int32_t *corner = shape->mesh.triangles + 3 * (int64_t)home.triangle;
  for (int k = 0; k < 3; k++) {
    const double *p = supermesh->points + 3 * (int64_t)v[k];
    double sum = 0, least = 0;
    for (int i = 0; i < 3; i++) {
      weight[k][i] = orb_det(p, shape->points + 3 * (int64_t)corner[(i + 1) % 3],
                             shape->points + 3 * (int64_t)corner[(i + 2) % 3]);
      sum += weight[k][i];
      least = fmin(least, weight[k][i]);
    }
    if (!(sum > 0 && least >= INSIDE * sum)) {
      return -1 - home.triangle;
    }
    for (int i = 0; i < 3; i++) {
      weight[k][i] = fmax(weight[k][i], 0) / sum;
    }
  }
  return home.triangle;
}

/* The place on the shape of a point of a triangle of the charts: within one triangle of the shape by linear
 * interpolation, as the morph shows it; else by the sphere. */
static void place_at(const baker *b, const int32_t v[3], int32_t triangle, double weight[3][3], const double at[3],
                     orb_place *out) {
  if (triangle >= 0) {
    *out = (orb_place){.triangle = triangle};
    for (int k = 0; k < 3; k++) {
      for (int i = 0; i < 3; i++) {
        out->at[i] += at[k] * weight[k][i];
      }
    }
    return;
  }
  double p[3] = {0};
  for (int k = 0; k < 3; k++) {
    for (int c = 0; c < 3; c++) {
      p[c] += at[k] * b->job->supermesh->points[3 * (int64_t)v[k] + c];
    }
  }
  orb_normalize(p);
  orb_locate(b->locator, p, -1 - triangle, out);
}

/* Texture coordinates of a triangle in texels. 0: it has none, or none that can be drawn. */
static int corners_of(const baker *b, int64_t t, double out[3][2]) {
  const orb_given_charts *charts = b->job->charts;
  for (int k = 0; k < 3; k++) {
    int32_t g = charts->triangles[3 * t + k];
    if (g >= b->job->vertex_count || b->job->vertices[g] < 0 || !charts->has[g]) {
      return 0;
    }
    for (int c = 0; c < 2; c++) {
      out[k][c] = (double)charts->uv[2 * (int64_t)g + c] * b->side;
      if (!(fabs(out[k][c]) < 1e8)) {
        return 0;
      }
    }
  }
  return 1;
}

/* Barycentric coordinates of (x, y); 0: the triangle has no area. */
static int weights_at(double c[3][2], double x, double y, double out[3]) {
  double area = (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[1][1] - c[0][1]) * (c[2][0] - c[0][0]);
  out[1] = ((x - c[0][0]) * (c[2][1] - c[0][1]) - (y - c[0][1]) * (c[2][0] - c[0][0])) / area;
  out[2] = ((c[1][0] - c[0][0]) * (y - c[0][1]) - (c[1][1] - c[0][1]) * (x - c[0][0])) / area;
  out[0] = 1 - out[1] - out[2];
  return fabs(area) > 1e-12;
}

static int32_t modulo(int64_t at, int32_t side) {
  int64_t rest = at % side;
  return (int32_t)(rest < 0 ? rest + side : rest);
}

/* Claims the texels whose centres lie in a triangle. Textures repeat, so coordinates beyond 0 to 1 come back in. */
static orb_status claim(baker *b, int64_t t) {
  double c[3][2], at[3];
  if (!corners_of(b, t, c) || !weights_at(c, 0, 0, at)) {
    return ORB_OK;
  }
  double low[2], high[2];
  for (int k = 0; k < 2; k++) {
    low[k] = floor(fmin(c[0][k], fmin(c[1][k], c[2][k])) - 0.5);
    high[k] = ceil(fmax(c[0][k], fmax(c[1][k], c[2][k])) + 0.5);
    if (high[k] - low[k] > 2.0 * b->side + 4) {
      return ORB_OK; /* the texture repeats within the triangle */
    }
  }
  b->work += (high[0] - low[0]) * (high[1] - low[1]);
  if (b->work > CHECK_EVERY) {
    b->work = 0;
    ORB_TRY(orb_context_check(b->ctx));
  }
  for (int64_t y = (int64_t)low[1]; y < (int64_t)high[1]; y++) {
    for (int64_t x = (int64_t)low[0]; x < (int64_t)high[0]; x++) {
      (void)weights_at(c, (double)x + 0.5, (double)y + 0.5, at);
      double least = fmin(at[0], fmin(at[1], at[2]));
      int32_t *owner = &b->owner[(int64_t)modulo(y, b->side) * b->side + modulo(x, b->side)];
      if (least >= INSIDE && *owner < 0) {
        *owner = (int32_t)t;
      } else if (least > WITHIN && *owner != (int32_t)t) {
        b->shared++;
      }
    }
  }
  return ORB_OK;
}

/* The texel that a triangle claimed, perhaps some whole sides away. */
static int find_texel(const baker *b, double c[3][2], int64_t texel, double at[3]) {
  double side = b->side, x = (double)(texel % b->side) + 0.5, y = (double)(texel / b->side) + 0.5;
  double first[2] = {fmin(c[0][0], fmin(c[1][0], c[2][0])), fmin(c[0][1], fmin(c[1][1], c[2][1]))};
  double u = x + side * (ceil((first[0] - 1 - x) / side)), v = y + side * ceil((first[1] - 1 - y) / side);
  for (int i = 0; i < 9; i++) {
    if (weights_at(c, u + side * (i % 3), v + side * (i / 3), at) && fmin(at[0], fmin(at[1], at[2])) >= 2 * INSIDE) {
      return 1;
    }
  }
  return 0;
}

static void color_body(void *arg, int64_t begin, int64_t end, int thread) {
  const baker *b = arg;
  int32_t known = -1, triangle = 0, v[3] = {0};
  double weight[3][3] = {{0}}, c[3][2] = {{0}};
  (void)thread;
  if (orb_context_check(b->ctx) != ORB_OK) {
    return;
  }
  for (int64_t i = begin; i < end; i++) {
    int32_t t = b->owner[i];
    if (t < 0) {
      continue;
    }
    if (t != known) {
      for (int k = 0; k < 3; k++) {
        v[k] = b->job->vertices[b->job->charts->triangles[3 * (int64_t)t + k]];
      }
      triangle = common_triangle(b, v, weight);
      (void)corners_of(b, t, c);
      known = t;
    }
    double at[3];
    orb_place place;
    if (find_texel(b, c, i, at)) {
      place_at(b, v, triangle, weight, at, &place);
      orb_texels_at(b->texels, &place, b->rgba + 4 * i);
      b->known[i] = 1;
    }
  }
}

static orb_status bake_one(orb_context *ctx, baker *b, int32_t material, orb_baked *out) {
  const orb_given_charts *charts = b->job->charts;
  int64_t count = (int64_t)b->side * b->side;
  memset(b->owner, -1, (size_t)count * sizeof *b->owner);
  memset(b->rgba, 0, 4 * (size_t)count);
  memset(b->known, 0, (size_t)count);
  for (int32_t t = 0; t < charts->triangle_count; t++) {
    if (charts->material[t] == material) {
      ORB_TRY(claim(b, t));
    }
  }
  orb_parallel_for(ctx, count, GRAIN, color_body, b);
  ORB_TRY(orb_context_check(ctx));
  int32_t rings = b->side / PAD_SHARE > PAD_LEAST ? b->side / PAD_SHARE : PAD_LEAST;
  orb_pad(b->rgba, b->known, b->side, rings, b->owner);
  const orb_pixels pixels = {b->side, b->side, b->rgba};
  orb_baked_image *image = &out->images[out->image_count++];
  image->material = material;
  return orb_png_encode(ctx, &pixels, out->has_alpha, &image->png);
}

/* The materials of the triangles on the surface, each once; *area: how much of the unit square they cover together. */
static int32_t list_materials(const baker *b, int32_t *list, double *area) {
  int32_t count = 0;
  *area = 0;
  for (int32_t t = 0; t < b->job->charts->triangle_count; t++) {
    double c[3][2];
    int32_t found = 0;
    if (!corners_of(b, t, c)) {
      continue;
    }
    *area += 0.5 * fabs((c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[1][1] - c[0][1]) * (c[2][0] - c[0][0]));
    while (found < count && list[found] != b->job->charts->material[t]) {
      found++;
    }
    if (found == count) {
      list[count++] = b->job->charts->material[t];
    }
  }
  return count;
}

/* The power of two at which the charts get about as many texels as the textures of the shape have. */
static int32_t choose_side(const orb_texels *texels, double area) {
  double wanted = area > 0 ? sqrt(orb_texels_count(texels) / area) : 0;
  int32_t side = ORB_BAKE_LEAST;
  while (side < CHOSEN_MOST && side < 0.95 * wanted) { /* a slightly lower resolution does not justify twice the side */
    side *= 2;
  }
  return side;
}

static orb_status bake_all(orb_context *ctx, baker *b, const int32_t *materials, int32_t count, orb_baked *out) {
  size_t texels = (size_t)b->side * (size_t)b->side;
  orb_status status = ORB_OK;
  out->images = ORB_NEW0(ctx, orb_baked_image, count);
  b->owner = ORB_NEW(ctx, int32_t, texels);
  b->rgba = orb_alloc(ctx, texels, 4);
  b->known = orb_alloc(ctx, texels, 1);
  if (!out->images || !b->owner || !b->rgba || !b->known) {
    status = ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; status == ORB_OK && i < count; i++) {
    status = bake_one(ctx, b, materials[i], out);
  }
  orb_free(ctx, b->owner);
  orb_free(ctx, b->rgba);
  orb_free(ctx, b->known);
  return status;
}

orb_status orb_bake_refuse(orb_context *ctx) {
  orb_status status =
      orb_fail(ctx, ORB_E_BAD_OPTION,
               "\"transfer\" bakes a texture into the texture coordinates of the first shape, which has none. "
               "Unwrap it, or omit \"texture\".");
  orb_context_error_edit(ctx)->shape = 0;
  return status;
}

orb_status orb_bake(orb_context *ctx, const orb_bake_job *job, orb_baked *out) {
  const orb_mesh *mesh = &job->shape->mesh;
  baker b = {.ctx = ctx, .job = job, .side = 1};
  orb_locator *locator = NULL;
  orb_texels texels = {0};
  int32_t *materials = ORB_NEW(ctx, int32_t, job->charts->triangle_count);
  double area;
  memset(out, 0, sizeof *out);
  orb_status status = materials ? ORB_OK : ORB_E_NO_MEMORY;
  int32_t count = materials ? list_materials(&b, materials, &area) : 0;
  if (status == ORB_OK && count == 0) {
    status = orb_bake_refuse(ctx);
  }
  if (status == ORB_OK) {
    ORB_GO(status, orb_texels_open(ctx, mesh, &texels), done);
    ORB_GO(status,
           orb_locator_create(ctx, job->shape->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, NULL,
                              &locator),
           done);
    b.texels = &texels;
    b.locator = locator;
    b.side = out->resolution = job->resolution ? job->resolution : choose_side(&texels, area);
    out->has_alpha = texels.has_alpha;
    ORB_GO(status, bake_all(ctx, &b, materials, count, out), done);
    out->shared = b.shared;
  }
done:
  orb_free(ctx, materials);
  orb_locator_destroy(ctx, locator);
  orb_texels_close(ctx, &texels);
  return status;
}

void orb_baked_free(orb_context *ctx, orb_baked *baked) {
  for (int32_t i = 0; i < baked->image_count; i++) {
    orb_buffer_free(ctx, &baked->images[i].png);
  }
  orb_free(ctx, baked->images);
  memset(baked, 0, sizeof *baked);
}
