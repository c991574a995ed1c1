#include "view_pose.h"

#include <math.h>
#include <string.h>

void view_upright(char up, view_rotation out) {
  static const struct {
    char up;
    view_rotation rotation;
  } rotations[] = {
      {'y', {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},  {'Y', {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
      {'z', {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}}, {'Z', {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}},
      {'x', {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}}, {'X', {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}}},
  };
  for (size_t i = 0; i < sizeof rotations / sizeof rotations[0]; i++) {
    if (i == 0 || rotations[i].up == up) {
      memcpy(out, rotations[i].rotation, sizeof(view_rotation));
    }
  }
}

/* The rows of out: right, up, towards the viewer. */
static void view_axes(const view_options *options, double out[3][3]) {
  double yaw = options->yaw * 3.14159265358979 / 180, pitch = options->pitch * 3.14159265358979 / 180;
  double right[3] = {cos(yaw), 0, -sin(yaw)};
  double to[3] = {sin(yaw) * cos(pitch), sin(pitch), cos(yaw) * cos(pitch)};
  double up[3] = {-sin(yaw) * sin(pitch), cos(pitch), -cos(yaw) * sin(pitch)};
  const double *rows[3] = {right, up, to};
  view_rotation rotation;
  view_upright(options->up, rotation);
  for (int r = 0; r < 3; r++) {
    for (int c = 0; c < 3; c++) {
      out[r][c] = rows[r][0] * rotation[0][c] + rows[r][1] * rotation[1][c] + rows[r][2] * rotation[2][c];
    }
  }
}

/* The two targets around t (−1: the base); returns the weight of the second. The targets of in-betweens follow those of
 * the shapes, in the order of the transitions; only consecutive shapes have in-betweens. */
static double blend_of(const view_mesh *mesh, int from, int to, double t, int *first, int *second) {
  int steps = to == from + 1 ? (int)mesh->between : 0, leg = (int)floor(t * (steps + 1));
  int between = view_shape_count(mesh) - 1 + from * steps;
  leg = leg > steps ? steps : leg;
  *first = leg == 0 ? from - 1 : between + leg - 1;
  *second = leg == steps ? to - 1 : between + leg;
  return t * (steps + 1) - leg;
}

static float posed(const float *base, const float *deltas, const view_mesh *mesh, size_t i, int first, int second,
                   float w) {
  size_t floats = 3 * (size_t)mesh->vertex_count;
  float a = first >= 0 ? deltas[(size_t)first * floats + i] : 0,
        b = second >= 0 ? deltas[(size_t)second * floats + i] : 0;
  return base[i] + (1 - w) * a + w * b;
}

void view_pose(const view_mesh *mesh, int from, int to, double t, const view_options *options, view_vertex *out) {
  int first, second;
  double axes[3][3];
  float w = (float)blend_of(mesh, from, to, t, &first, &second);
  view_axes(options, axes);
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
    out[v].uv[0] = mesh->texcoords[2 * (size_t)v];
    out[v].uv[1] = mesh->texcoords[2 * (size_t)v + 1];
    out[v].x = place[0];
    out[v].y = place[1];
    out[v].z = place[2];
  }
}

void view_frame_open(view_frame *frame) {
  *frame = (view_frame){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
}

void view_frame_add(view_frame *frame, const view_vertex *vertices, uint32_t count) {
  for (uint32_t v = 0; v < count; v++) {
    frame->low[0] = fminf(frame->low[0], vertices[v].x);
    frame->high[0] = fmaxf(frame->high[0], vertices[v].x);
    frame->low[1] = fminf(frame->low[1], vertices[v].y);
    frame->high[1] = fmaxf(frame->high[1], vertices[v].y);
  }
}

/* Gives the corners of a triangle the normal of its plane. On the canvas y points down. */
static void flatten(view_vertex corners[3]) {
  const view_vertex *a = &corners[0], *b = &corners[1], *c = &corners[2];
  const float u[3] = {b->x - a->x, a->y - b->y, b->z - a->z}, v[3] = {c->x - a->x, a->y - c->y, c->z - a->z};
  float normal[3], length = 0;
  for (int k = 0; k < 3; k++) {
    int i = (k + 1) % 3, j = (k + 2) % 3;
    normal[k] = u[i] * v[j] - u[j] * v[i];
    length = hypotf(length, normal[k]);
  }
  for (int k = 0; k < 9; k++) {
    corners[k / 3].normal[k % 3] = length > 0 ? normal[k % 3] / length : 0;
  }
}

static void draw_triangle(const view_mesh *mesh, uint32_t triangle, const view_options *options,
                          const view_vertex *vertices, view_canvas *canvas) {
  const uint32_t *at = mesh->indices + 3 * (size_t)triangle;
  view_vertex corners[3] = {vertices[at[0]], vertices[at[1]], vertices[at[2]]};
  view_paint paint = {
      .material = mesh->materials.list[mesh->painted[triangle]], .wire = options->wire, .inside = options->inside};
  paint.texture = paint.material.texture >= 0 ? &mesh->materials.textures[paint.material.texture] : NULL;
  if (mesh->flat[triangle]) {
    flatten(corners);
  }
  view_triangle(canvas, (const view_vertex *const[]){corners, corners + 1, corners + 2}, &paint);
}

void view_draw(const view_mesh *mesh, const view_options *options, const view_frame *frame, int left, int top,
               view_vertex *vertices, view_canvas *canvas) {
  float side = (float)(options->size * VIEW_SUPERSAMPLE);
  float extent = fmaxf(frame->high[0] - frame->low[0], frame->high[1] - frame->low[1]);
  float scale = extent > 0 ? 0.92f * side / extent : 1;
  for (uint32_t v = 0; v < mesh->vertex_count; v++) {
    vertices[v].x = (float)left + side / 2 + scale * (vertices[v].x - (frame->low[0] + frame->high[0]) / 2);
    vertices[v].y = (float)top + side / 2 - scale * (vertices[v].y - (frame->low[1] + frame->high[1]) / 2);
    vertices[v].z *= scale;
  }
  for (uint32_t i = 0; i < mesh->index_count / 3; i++) {
    draw_triangle(mesh, i, options, vertices, canvas);
  }
}
