/* Writes the assets that the conformance tests read: NAME.glb, and NAME.json with the expected facts, {"triangles":
 * [[a,b,c]…], "shapes": [[x,y,z, …]…]} in doubles. Also NAME.quantized.glb and NAME.meshopt.glb, each with a .json of
 * the bounds on their differences. The shapes are formulas on a globe. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/buffer.h"
#include "base/memory.h"
#include "orbmorph/asset.h"
#include "orbmorph/profile.h"

enum { AROUND = 24, ROWS = 12, MAX_SHAPES = 6 };
#define VERTICES (AROUND * (ROWS - 1) + 2)
#define TRIANGLES (2 * AROUND * (ROWS - 1))

/* A minimal PNG: one red pixel. */
static const unsigned char PIXEL[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0xf8, 0xcf, 0xc0, 0x00, 0x00, 0x03, 0x01, 0x01, 0x00, 0xc9,
    0xfe, 0x92, 0xef, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

enum { IMAGE = 64, ROW = 3 * IMAGE + 1, STORED = ROW * IMAGE };

static void *made(void *block) {
  if (!block) {
    fputs("fixture: no memory\n", stderr);
    exit(1);
  }
  return block;
}

static int32_t ring(int row, int column) {
  return row == 0 ? 0 : row == ROWS ? VERTICES - 1 : 1 + (row - 1) * AROUND + (column + AROUND) % AROUND;
}

static void globe(double *points, int32_t *triangles) {
  for (int row = 0; row <= ROWS; row++) {
    for (int column = 0; column < AROUND; column++) {
      double polar = M_PI * row / ROWS, turn = 2 * M_PI * column / AROUND, *p = points + 3 * ring(row, column);
      p[0] = row == 0 || row == ROWS ? 0 : sin(polar) * cos(turn);
      p[1] = row == 0 || row == ROWS ? 0 : sin(polar) * sin(turn);
      p[2] = cos(polar);
    }
  }
  int count = 0;
  for (int row = 0; row < ROWS; row++) {
    for (int column = 0; column < AROUND; column++) {
      int32_t a = ring(row, column), b = ring(row + 1, column), c = ring(row + 1, column + 1),
              d = ring(row, column + 1);
      if (row < ROWS - 1) {
        memcpy(triangles + 3 * count++, (int32_t[3]){a, b, c}, 3 * sizeof(int32_t));
      }
      if (row > 0) {
        memcpy(triangles + 3 * count++, (int32_t[3]){a, c, d}, 3 * sizeof(int32_t));
      }
    }
  }
}

static void shape_formula(int shape, const double p[3], double out[3]) {
  double wave = 0.2 * sin(3 * p[0] + shape) + 0.1 * cos(5 * p[1] * (shape + 1));
  out[0] = (1 + wave) * p[0] * (1 + 0.5 * shape) + 0.125 * shape;
  out[1] = (1 + wave) * p[1] - 0.3 * p[2] * shape;
  out[2] = (1 - wave) * p[2] * (2 - 0.3 * shape);
}

/* Gives the first shape everything a file can contain: texture coordinates with a seam, two materials with an image,
 * colours, and hard edges around every tile. */
static void dress(orb_context *ctx, orb_mesh *mesh, const double *points) {
  mesh->texcoords = made(ORB_NEW(ctx, float, 6 * TRIANGLES));
  mesh->colors = made(ORB_NEW(ctx, float, 12 * TRIANGLES));
  mesh->normals = made(ORB_NEW(ctx, float, 9 * TRIANGLES));
  mesh->material = made(ORB_NEW(ctx, int32_t, TRIANGLES));
  mesh->materials = made(ORB_NEW0(ctx, orb_material, 2));
  mesh->images = made(ORB_NEW0(ctx, orb_image, 1));
  mesh->material_count = 2;
  mesh->image_count = 1;
  mesh->images[0].bytes = made(ORB_NEW(ctx, unsigned char, sizeof PIXEL));
  memcpy(mesh->images[0].bytes, PIXEL, sizeof PIXEL);
  mesh->images[0].size = sizeof PIXEL;
  snprintf(mesh->images[0].mime, sizeof mesh->images[0].mime, "image/png");
  for (int m = 0; m < 2; m++) {
    mesh->materials[m] =
        (orb_material){.base_color = {1, 0.5f, 0.25f * (float)m, 1}, .roughness = 0.5f, .base_texture.image = m - 1};
    snprintf(mesh->materials[m].name, sizeof mesh->materials[m].name, "paint %d", m);
  }
  for (int t = 0; t < TRIANGLES; t++) {
    double middle[3] = {0};
    for (int k = 0; k < 9; k++) {
      middle[k % 3] += points[3 * mesh->triangles[3 * t + k / 3] + k % 3] / 3;
    }
    mesh->material[t] = middle[2] > 0.2;
    double length = sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
    double turn = atan2(middle[1], middle[0]);
    for (int k = 0; k < 3; k++) {
      const double *p = points + 3 * mesh->triangles[3 * t + k];
      double own = p[0] == 0 && p[1] == 0 ? turn : atan2(p[1], p[0]);
      own += own - turn > M_PI ? -2 * M_PI : own - turn < -M_PI ? 2 * M_PI : 0;
      mesh->texcoords[6 * t + 2 * k] = (float)(own / (2 * M_PI) + 0.5);
      mesh->texcoords[6 * t + 2 * k + 1] = (float)(acos(p[2]) / M_PI);
      for (int c = 0; c < 4; c++) {
        mesh->colors[12 * t + 4 * k + c] = c == 3 ? 1 : (float)(0.5 + 0.5 * p[c]);
      }
      for (int c = 0; c < 3; c++) {
        mesh->normals[9 * t + 3 * k + c] = (float)(middle[2] > 0.2 ? middle[c] / length : p[c]);
      }
    }
  }
}

static unsigned char *put32(unsigned char *at, uint32_t value) { /* big-endian */
  for (int shift = 24; shift >= 0; shift -= 8) {
    *at++ = (unsigned char)(value >> shift);
  }
  return at;
}

static unsigned char *put_chunk(unsigned char *at, const char *type, const unsigned char *bytes, uint32_t size) {
  unsigned char *from = put32(at, size);
  memcpy(from, type, 4);
  memcpy(from + 4, bytes, size);
  uint32_t crc = UINT32_MAX;
  for (uint32_t i = 0; i < size + 4; i++) {
    crc ^= from[i];
    for (int bit = 0; bit < 8; bit++) {
      crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
  }
  return put32(from + 4 + size, ~crc);
}

/* A PNG of coloured tiles, each different from its neighbours, without compression. */
static size_t paint(unsigned char *png) {
  static const unsigned char mark[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  unsigned char head[13] = {0}, data[STORED + 11], *at = data + 7;
  head[3] = head[7] = IMAGE;
  head[8] = 8;
  head[9] = 2;
  data[0] = 0x78;
  data[1] = 1;
  data[2] = 1; /* one stored block, the last */
  data[3] = STORED & 255;
  data[4] = STORED >> 8;
  data[5] = (unsigned char)~data[3];
  data[6] = (unsigned char)~data[4];
  uint32_t a = 1, b = 0;
  for (int y = 0; y < IMAGE; y++) {
    *at++ = 0;
    for (int x = 0; x < IMAGE; x++) {
      *at++ = (unsigned char)(x / 8 * 36);
      *at++ = (unsigned char)(y / 8 * 36);
      *at++ = (x / 8 + y / 8) % 2 ? 255 : 0;
    }
  }
  for (unsigned char *c = data + 7; c < at; c++) {
    a = (a + *c) % 65521;
    b = (b + a) % 65521;
  }
  put32(at, b << 16 | a);
  memcpy(png, mark, sizeof mark);
  unsigned char *end = put_chunk(png + sizeof mark, "IHDR", head, sizeof head);
  end = put_chunk(end, "IDAT", data, sizeof data);
  return (size_t)(put_chunk(end, "IEND", head, 0) - png);
}

/* Longitude and depth on the sphere as texture coordinates, with a seam where the longitude wraps around. */
static void unwrap(const double *points, const int32_t *corner, float out[6]) {
  double middle[3] = {0};
  for (int k = 0; k < 9; k++) {
    middle[k % 3] += points[3 * corner[k / 3] + k % 3] / 3;
  }
  double turn = atan2(middle[1], middle[0]);
  for (int k = 0; k < 3; k++) {
    const double *p = points + 3 * corner[k];
    double own = p[0] * p[0] + p[1] * p[1] < 1e-12 ? turn : atan2(p[1], p[0]);
    own += own - turn > M_PI ? -2 * M_PI : own - turn < -M_PI ? 2 * M_PI : 0;
    out[2 * k] = (float)(own / (2 * M_PI) + 0.5);
    out[2 * k + 1] = (float)(acos(fmax(-1, fmin(1, p[2]))) / M_PI);
  }
}

static void write_file(const char *folder, const char *name, const char *ending, const void *bytes, size_t size) {
  char path[4096];
  snprintf(path, sizeof path, "%s/%s%s", folder, name, ending);
  FILE *file = fopen(path, "wb");
  if (!file || fwrite(bytes, 1, size, file) != size || fclose(file) != 0) {
    fprintf(stderr, "fixture: %s cannot be written\n", path);
    exit(1);
  }
}

static void write_facts(orb_context *ctx, const char *folder, const char *name, const orb_supermesh *supermesh,
                        const orb_aligned_shape *shapes) {
  orb_buffer text = {0};
  orb_status status = orb_buffer_printf(ctx, &text, "{\"triangles\":[");
  for (int t = 0; status == ORB_OK && t < TRIANGLES; t++) {
    const int32_t *corner = supermesh->triangles + 3 * t;
    status = orb_buffer_printf(ctx, &text, "%s[%d,%d,%d]", t ? "," : "", corner[0], corner[1], corner[2]);
  }
  for (int s = 0; status == ORB_OK && s < supermesh->shape_count; s++) {
    status = orb_buffer_printf(ctx, &text, s ? "],[" : "],\"shapes\":[[");
    for (int i = 0; status == ORB_OK && i < 3 * VERTICES; i++) {
      status = orb_buffer_printf(ctx, &text, "%s%.17g", i ? "," : "", shapes[s].mesh.positions[i]);
    }
  }
  if (status == ORB_OK) {
    status = orb_buffer_printf(ctx, &text, "]]}");
  }
  if (status != ORB_OK) {
    exit(1);
  }
  write_file(folder, name, ".json", text.data, text.size);
  orb_buffer_free(ctx, &text);
}

static void write_asset(orb_context *ctx, const char *folder, const char *name, const orb_buffer *glb) {
  char ending[32], text[160];
  orb_profile_facts facts;
  write_file(folder, name, ".glb", glb->data, glb->size);
  for (int p = ORB_PROFILE_QUANTIZED; p < ORB_PROFILES; p++) {
    const char *profile = orb_profile_name((orb_profile)p);
    orb_buffer out = {0};
    if (orb_profile_write(ctx, glb->data, glb->size, (orb_profile)p, &facts, &out) != ORB_OK) {
      fprintf(stderr, "fixture: %s: %s\n", name, orb_context_error(ctx)->detail);
      exit(1);
    }
    snprintf(ending, sizeof ending, ".%s.glb", profile);
    write_file(folder, name, ending, out.data, out.size);
    orb_buffer_free(ctx, &out);
    int size = snprintf(text, sizeof text, "{\"position_error\":%.17g,\"normal_degrees\":%.17g}", facts.position_error,
                        facts.normal_degrees);
    snprintf(ending, sizeof ending, ".%s.json", profile);
    write_file(folder, name, ending, text, (size_t)size);
  }
}

static void make(const char *folder, const char *name, int shape_count, int dressed, const orb_asset_options *options) {
  static const char *const names[MAX_SHAPES] = {"Ähre", "zwei", "trois", "four \"quoted\"", "five\\", "six"};
  orb_context *ctx;
  if (orb_context_create(NULL, &ctx) != ORB_OK) {
    exit(1);
  }
  orb_supermesh supermesh = {.vertex_count = VERTICES, .triangle_count = TRIANGLES, .shape_count = shape_count};
  orb_aligned_shape shapes[MAX_SHAPES] = {0};
  supermesh.triangles = made(ORB_NEW(ctx, int32_t, 3 * TRIANGLES));
  supermesh.points = made(ORB_NEW(ctx, double, 3 * VERTICES));
  supermesh.places = made(ORB_NEW0(ctx, orb_place, shape_count * VERTICES));
  globe(supermesh.points, supermesh.triangles);
  for (int s = 0; s < shape_count; s++) {
    orb_mesh *mesh = &shapes[s].mesh;
    mesh->vertex_count = VERTICES;
    mesh->triangle_count = TRIANGLES;
    mesh->positions = made(ORB_NEW(ctx, double, 3 * VERTICES));
    mesh->triangles = made(ORB_NEW(ctx, int32_t, 3 * TRIANGLES));
    shapes[s].points = supermesh.points;
    memcpy(mesh->triangles, supermesh.triangles, 3 * TRIANGLES * sizeof(int32_t));
    for (int v = 0; v < VERTICES; v++) {
      shape_formula(s, supermesh.points + 3 * v, mesh->positions + 3 * v);
    }
    for (int h = 0; h < 3 * TRIANGLES; h++) {
      orb_place place = {.triangle = h / 3};
      place.at[h % 3] = 1;
      supermesh.places[s * VERTICES + mesh->triangles[h]] = place;
    }
  }
  if (dressed) {
    dress(ctx, &shapes[0].mesh, supermesh.points);
    dress(ctx, &shapes[1].mesh, supermesh.points);
  }
  orb_buffer glb = {0};
  if (orb_asset_write(ctx, &supermesh, shapes, names, options, NULL, &glb) != ORB_OK) {
    fprintf(stderr, "fixture: %s: %s\n", name, orb_context_error(ctx)->detail);
    exit(1);
  }
  write_asset(ctx, folder, name, &glb);
  write_facts(ctx, folder, name, &supermesh, shapes);
  orb_buffer_free(ctx, &glb);
  for (int s = 0; s < shape_count; s++) {
    orb_mesh_free(ctx, &shapes[s].mesh);
  }
  orb_free(ctx, supermesh.triangles);
  orb_free(ctx, supermesh.points);
  orb_free(ctx, supermesh.places);
  orb_context_destroy(ctx);
}

/* Three shapes with different vertices, remeshed; the first has a texture. */
static void make_painted(const char *folder, const char *name, orb_remesh_method method) {
  enum { SHAPES = 3 };
  static const char *const names[SHAPES] = {"first", "second", "third"};
  static unsigned char png[STORED + 200];
  orb_context *ctx;
  if (orb_context_create(NULL, &ctx) != ORB_OK) {
    exit(1);
  }
  orb_aligned_shape shapes[SHAPES] = {0};
  orb_buffer text = {0}, glb = {0};
  orb_status status = orb_buffer_printf(ctx, &text, "{\"shapes\":[");
  for (int s = 0; s < SHAPES; s++) {
    orb_mesh *mesh = &shapes[s].mesh;
    mesh->vertex_count = VERTICES;
    mesh->triangle_count = TRIANGLES;
    mesh->positions = made(ORB_NEW(ctx, double, 3 * VERTICES));
    mesh->triangles = made(ORB_NEW(ctx, int32_t, 3 * TRIANGLES));
    mesh->texcoords = made(ORB_NEW(ctx, float, 6 * TRIANGLES));
    shapes[s].points = made(ORB_NEW(ctx, double, 3 * VERTICES));
    globe(shapes[s].points, mesh->triangles);
    for (int v = 0; v < VERTICES; v++) {
      double *p = shapes[s].points + 3 * v, c = cos(0.7 * s), d = sin(0.7 * s);
      double q[3] = {c * p[0] - d * p[2], p[1], d * p[0] + c * p[2]};
      p[0] = c * q[0] - d * q[1];
      p[1] = d * q[0] + c * q[1];
      p[2] = q[2];
      shape_formula(s, p, mesh->positions + 3 * v);
    }
    status = status == ORB_OK ? orb_buffer_printf(ctx, &text, s ? ",{\"corners\":[" : "{\"corners\":[") : status;
    for (int t = 0; t < TRIANGLES && status == ORB_OK; t++) {
      unwrap(shapes[s].points, mesh->triangles + 3 * t, mesh->texcoords + 6 * t);
      for (int k = 0; k < 3 && status == ORB_OK; k++) {
        const double *p = mesh->positions + 3 * mesh->triangles[3 * t + k];
        status = orb_buffer_printf(ctx, &text, "%s%.9g,%.9g,%.9g,%.9g,%.9g", t + k ? "," : "", p[0], p[1], p[2],
                                   (double)mesh->texcoords[6 * t + 2 * k], (double)mesh->texcoords[6 * t + 2 * k + 1]);
      }
    }
    status = status == ORB_OK ? orb_buffer_printf(ctx, &text, "]}") : status;
  }
  size_t size = paint(png);
  orb_mesh *first = &shapes[0].mesh;
  first->materials = made(ORB_NEW0(ctx, orb_material, 1));
  first->images = made(ORB_NEW0(ctx, orb_image, 1));
  first->material_count = first->image_count = 1;
  first->materials[0] = (orb_material){.name = "tiles",
                                       .base_color = {1, 1, 1, 1},
                                       .roughness = 1,
                                       .base_texture = {.mag_filter = 9728, .min_filter = 9728}};
  first->images[0].bytes = made(ORB_NEW(ctx, unsigned char, size));
  memcpy(first->images[0].bytes, png, size);
  first->images[0].size = size;
  snprintf(first->images[0].mime, sizeof first->images[0].mime, "image/png");
  orb_supermesh supermesh = {0};
  orb_remesh_options remesh;
  orb_asset_options options;
  orb_remesh_defaults(&remesh);
  orb_asset_defaults(&options);
  options.fit = ORB_FIT_NONE;
  remesh.method = method;
  if (status != ORB_OK || orb_buffer_printf(ctx, &text, "]}") != ORB_OK ||
      orb_remesh(ctx, shapes, SHAPES, 0, &remesh, &supermesh) != ORB_OK ||
      orb_asset_write(ctx, &supermesh, shapes, names, &options, NULL, &glb) != ORB_OK) {
    fprintf(stderr, "fixture: %s: %s\n", name, orb_context_error(ctx)->detail);
    exit(1);
  }
  write_asset(ctx, folder, name, &glb);
  write_file(folder, name, ".json", text.data, text.size);
  write_file(folder, name, ".png", png, size);
  orb_buffer_free(ctx, &glb);
  orb_buffer_free(ctx, &text);
  orb_supermesh_free(ctx, &supermesh);
  for (int s = 0; s < SHAPES; s++) {
    orb_mesh_free(ctx, &shapes[s].mesh);
    orb_free(ctx, shapes[s].points);
  }
  orb_context_destroy(ctx);
}

int main(int argc, char **argv) {
  if (argc != 2) {
    fputs("usage: asset_fixture FOLDER\n", stderr);
    return 2;
  }
  orb_asset_options options;
  orb_asset_defaults(&options);
  options.fit = ORB_FIT_NONE; /* the facts are in the coordinates of each shape */
  make(argv[1], "two", 2, 0, &options);
  make(argv[1], "six", 6, 0, &options);
  make(argv[1], "dressed", 3, 1, &options);
  make_painted(argv[1], "painted", ORB_REMESH_OVERLAY);
  make_painted(argv[1], "painted-adaptive", ORB_REMESH_ADAPTIVE);
  options.colors = 1;
  make(argv[1], "colours", 2, 1, &options);
  options.path = ORB_PATH_RIGID;
  make(argv[1], "rigid", 3, 1, &options);
  orb_asset_defaults(&options);
  options.fit = ORB_FIT_NONE;
  options.normals = 0;
  options.animation = ORB_ANIMATION_NONE;
  make(argv[1], "bare", 2, 0, &options);
  return 0;
}
