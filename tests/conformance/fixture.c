/* Writes the assets that the conformance tests read, each with the facts they must show: NAME.glb and NAME.json with
 * {"triangles": [[a,b,c]…], "shapes": [[x,y,z, …]…]} in doubles. The shapes are formulas on a globe. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "orbmorph/asset.h"

enum { AROUND = 24, ROWS = 12, MAX_SHAPES = 6 };
#define VERTICES (AROUND * (ROWS - 1) + 2)
#define TRIANGLES (2 * AROUND * (ROWS - 1))

/* The smallest PNG there is to be: one red pixel. */
static const unsigned char PIXEL[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0xf8, 0xcf, 0xc0, 0x00, 0x00, 0x03, 0x01, 0x01, 0x00, 0xc9,
    0xfe, 0x92, 0xef, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

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

/* The first shape with all that a file can bring: coordinates with a seam, two materials with an image, colours, and
 * hard edges round every tile. */
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
        (orb_material){.base_color = {1, 0.5f, 0.25f * (float)m, 1}, .roughness = 0.5f, .image = m - 1};
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
  write_file(folder, name, ".glb", glb.data, glb.size);
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

int main(int argc, char **argv) {
  if (argc != 2) {
    fputs("usage: asset_fixture FOLDER\n", stderr);
    return 2;
  }
  orb_asset_options options;
  orb_asset_defaults(&options);
  make(argv[1], "two", 2, 0, &options);
  make(argv[1], "six", 6, 0, &options);
  make(argv[1], "dressed", 3, 1, &options);
  options.colors = 1;
  make(argv[1], "colours", 2, 1, &options);
  options.path = ORB_PATH_RIGID;
  make(argv[1], "rigid", 3, 1, &options);
  orb_asset_defaults(&options);
  options.normals = 0;
  options.animation = ORB_ANIMATION_NONE;
  make(argv[1], "bare", 2, 0, &options);
  return 0;
}
