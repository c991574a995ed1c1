/* The contact sheet: poses by weights, each framed by its own bounds, one direction of view for all. */
#include "view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SUPERSAMPLE = 2, MAX_SIDE = 16384 };

void orb_view_defaults(orb_view_options *options) {
  *options = (orb_view_options){.poses = 5, .size = 320, .up = 'y', .yaw = 30, .pitch = 15};
}

/* Rows: right, up, towards the viewer. */
static void view_axes(const orb_view_options *options, double out[3][3]) {
  double yaw = options->yaw * 3.14159265358979 / 180, pitch = options->pitch * 3.14159265358979 / 180;
  double right[3] = {cos(yaw), 0, -sin(yaw)};
  double to[3] = {sin(yaw) * cos(pitch), sin(pitch), cos(yaw) * cos(pitch)};
  double up[3] = {-sin(yaw) * sin(pitch), cos(pitch), -cos(yaw) * sin(pitch)};
  const double *rows[3] = {right, up, to};
  for (int r = 0; r < 3; r++) {
    for (int c = 0; c < 3; c++) { /* z up: x stays, y ↦ −z, z ↦ y */
      out[r][c] = options->up == 'z' ? (c == 0 ? rows[r][0] : c == 1 ? -rows[r][2] : rows[r][1]) : rows[r][c];
    }
  }
}

/* The two targets (−1: the base) around t of transition `gap`, and the weight of the second. */
static double blend_of(const view_mesh *mesh, int shapes, int gap, double t, int *first, int *second) {
  int steps = (int)mesh->between, leg = (int)floor(t * (steps + 1));
  leg = leg > steps ? steps : leg;
  *first = leg == 0 ? gap - 1 : shapes - 1 + gap * steps + leg - 1;
  *second = leg == steps ? gap : shapes - 1 + gap * steps + leg;
  return t * (steps + 1) - leg;
}

static float posed(const float *base, const float *deltas, const view_mesh *mesh, size_t i, int first, int second,
                   float w) {
  size_t floats = 3 * (size_t)mesh->vertex_count;
  float a = first >= 0 ? deltas[(size_t)first * floats + i] : 0,
        b = second >= 0 ? deltas[(size_t)second * floats + i] : 0;
  return base[i] + (1 - w) * a + w * b;
}

/* The pose in the viewer's axes, x right, y up, z towards the viewer. */
static void make_pose(const view_mesh *mesh, int shapes, int gap, double t, double axes[3][3], view_vertex *out) {
  int first, second;
  float w = (float)blend_of(mesh, shapes, gap, t, &first, &second);
  for (uint32_t v = 0; v < mesh->vertex_count; v++) {
    float p[3], n[3], place[3];
    for (int c = 0; c < 3; c++) {
      size_t i = 3 * (size_t)v + (size_t)c;
      p[c] = posed(mesh->positions, mesh->delta_positions, mesh, i, first, second, w);
      n[c] = posed(mesh->normals, mesh->delta_normals, mesh, i, first, second, w);
      out[v].color[c] = mesh->colors[i];
    }
    for (int r = 0; r < 3; r++) {
      place[r] = (float)(axes[r][0] * (double)p[0] + axes[r][1] * (double)p[1] + axes[r][2] * (double)p[2]);
      out[v].normal[r] = (float)(axes[r][0] * (double)n[0] + axes[r][1] * (double)n[1] + axes[r][2] * (double)n[2]);
    }
    out[v].x = place[0];
    out[v].y = place[1];
    out[v].z = place[2];
  }
}

/* Moves the pose into its cell, with a margin. */
static void frame_pose(view_vertex *vertices, uint32_t count, int left, int top, int side) {
  float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  for (uint32_t v = 0; v < count; v++) {
    low[0] = fminf(low[0], vertices[v].x);
    high[0] = fmaxf(high[0], vertices[v].x);
    low[1] = fminf(low[1], vertices[v].y);
    high[1] = fmaxf(high[1], vertices[v].y);
  }
  float extent = fmaxf(high[0] - low[0], high[1] - low[1]);
  float scale = extent > 0 ? 0.92f * (float)side / extent : 1;
  for (uint32_t v = 0; v < count; v++) {
    vertices[v].x = (float)left + (float)side / 2 + scale * (vertices[v].x - (low[0] + high[0]) / 2);
    vertices[v].y = (float)top + (float)side / 2 - scale * (vertices[v].y - (low[1] + high[1]) / 2);
    vertices[v].z *= scale;
  }
}

static int canvas_make(view_canvas *canvas, int width, int height) {
  size_t pixels = (size_t)width * (size_t)height;
  canvas->width = width;
  canvas->height = height;
  canvas->color = malloc(3 * pixels * sizeof(float));
  canvas->depth = malloc(pixels * sizeof(float));
  if (!canvas->color || !canvas->depth) {
    return -1;
  }
  for (size_t i = 0; i < pixels; i++) {
    float tone = 0.90f - 0.12f * (float)(i / (size_t)width) / (float)height;
    canvas->color[3 * i] = canvas->color[3 * i + 1] = canvas->color[3 * i + 2] = tone;
    canvas->depth[i] = -INFINITY;
  }
  return 0;
}

static void draw_sheet(const view_mesh *mesh, const orb_view_options *options, int shapes, int rows,
                       view_vertex *vertices, view_canvas *canvas) {
  double axes[3][3];
  int side = options->size * SUPERSAMPLE;
  view_axes(options, axes);
  for (int row = 0; row < rows; row++) {
    for (int column = 0; column < options->poses; column++) {
      double t = options->poses > 1 ? (double)column / (options->poses - 1) : 0;
      make_pose(mesh, shapes, row, t, axes, vertices);
      frame_pose(vertices, mesh->vertex_count, column * side, row * side, side);
      for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        view_triangle(canvas, &vertices[mesh->indices[i]], &vertices[mesh->indices[i + 1]],
                      &vertices[mesh->indices[i + 2]], options->wire);
      }
    }
  }
}

int orbmorph_view(const char *glb, const char *png, const orb_view_options *options, char *error, size_t error_size) {
  view_mesh mesh;
  view_canvas canvas = {0};
  if (options->poses < 1 || options->poses > 100 || options->size < 16 || options->size > 4096) {
    snprintf(error, error_size, "poses must be 1 to 100 and the size 16 to 4096");
    return -1;
  }
  if (view_mesh_read(glb, &mesh, error, error_size) != 0) {
    return -1;
  }
  int shapes = (int)(mesh.target_count / (mesh.between + 1)) + 1, rows = shapes > 1 ? shapes - 1 : 1, rc = -1;
  int width = options->poses * options->size * SUPERSAMPLE, height = rows * options->size * SUPERSAMPLE;
  view_vertex *vertices = malloc(mesh.vertex_count * sizeof *vertices);
  if (width > MAX_SIDE || height > MAX_SIDE) {
    snprintf(error, error_size, "the sheet would be too large; give a smaller size");
  } else if (!vertices || canvas_make(&canvas, width, height) != 0) {
    snprintf(error, error_size, "there is not enough memory");
  } else {
    draw_sheet(&mesh, options, shapes, rows, vertices, &canvas);
    rc = view_png_write(png, &canvas, error, error_size);
  }
  free(vertices);
  free(canvas.color);
  free(canvas.depth);
  view_mesh_free(&mesh);
  return rc;
}
