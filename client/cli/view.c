#include "view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "view_aim.h"
#include "view_canvas.h"
#include "view_mesh.h"
#include "view_movie.h"
#include "view_png.h"
#include "view_pose.h"

enum { MAX_SIDE = 16384, FRAME_MILLISECONDS = 50 };
#define MAX_MOVIE_BYTES ((size_t)1 << 30)

void view_defaults(view_options *options) {
  *options = (view_options){.poses = 5, .size = 320, .yaw = NAN, .pitch = 15};
}

static int no_memory(char *error, size_t error_size) {
  snprintf(error, error_size, "not enough memory");
  return -1;
}

static int draw_sheet(const view_mesh *mesh, const char *png, const view_options *options, view_vertex *vertices,
                      char *error, size_t error_size) {
  view_canvas canvas;
  int shapes = view_shape_count(mesh), rows = shapes > 1 ? shapes - 1 : 1, side = options->size * VIEW_SUPERSAMPLE;
  if (options->poses * side > MAX_SIDE || rows * side > MAX_SIDE) {
    snprintf(error, error_size, "the sheet would be too large; use fewer poses or a smaller size");
    return -1;
  }
  if (view_canvas_make(&canvas, options->poses * side, rows * side) != 0) {
    return no_memory(error, error_size);
  }
  view_canvas_clear(&canvas);
  for (int row = 0; row < rows; row++) {
    for (int column = 0; column < options->poses; column++) {
      view_frame frame;
      view_pose(mesh, row, shapes > 1 ? row + 1 : 0, (double)column / (options->poses - 1), options, vertices);
      view_frame_open(&frame);
      view_frame_add(&frame, vertices, mesh->vertex_count);
      view_draw(mesh, options, &frame, column * side, row * side, vertices, &canvas);
    }
  }
  int rc = view_png_write(png, &canvas, error, error_size);
  view_canvas_free(&canvas);
  return rc;
}

/* The pose at a time from 0 to 1. A leg is one transition; it starts and ends slowly. The animation goes to the last
 * shape and back, or around from the last to the first if three or more shapes have no in-betweens. */
static void pose_at(const view_mesh *mesh, double time, const view_options *options, view_vertex *out) {
  int shapes = view_shape_count(mesh), round = shapes > 2 && mesh->between == 0;
  int legs = shapes < 2 ? 1 : round ? shapes : 2 * (shapes - 1), leg = (int)floor(time * legs);
  double t = time * legs - leg;
  t = t * t * (3 - 2 * t);
  if (shapes < 2) {
    view_pose(mesh, 0, 0, 0, options, out);
  } else if (round) {
    view_pose(mesh, leg, (leg + 1) % shapes, t, options, out);
  } else if (leg < shapes - 1) {
    view_pose(mesh, leg, leg + 1, t, options, out);
  } else {
    view_pose(mesh, legs - leg - 1, legs - leg, 1 - t, options, out);
  }
}

static int draw_movie(const view_mesh *mesh, const char *png, const view_options *options, view_vertex *vertices,
                      char *error, size_t error_size) {
  view_canvas canvas;
  view_frame frame;
  view_movie movie = {.width = options->size, .height = options->size, .count = options->frames};
  size_t bytes = 3 * (size_t)options->size * (size_t)options->size;
  if (bytes * (size_t)options->frames > MAX_MOVIE_BYTES) {
    snprintf(error, error_size, "the animation would be too large; use fewer frames or a smaller size");
    return -1;
  }
  movie.milliseconds = FRAME_MILLISECONDS;
  movie.pixels = malloc(bytes * (size_t)options->frames);
  if (!movie.pixels || view_canvas_make(&canvas, options->size * VIEW_SUPERSAMPLE, options->size * VIEW_SUPERSAMPLE)) {
    free(movie.pixels);
    return no_memory(error, error_size);
  }
  view_frame_open(&frame);
  for (int shape = 0; shape < view_shape_count(mesh); shape++) {
    view_pose(mesh, shape, shape, 0, options, vertices);
    view_frame_add(&frame, vertices, mesh->vertex_count);
  }
  for (int i = 0; i < options->frames; i++) {
    pose_at(mesh, (double)i / options->frames, options, vertices);
    view_canvas_clear(&canvas);
    view_draw(mesh, options, &frame, 0, 0, vertices, &canvas);
    for (int y = 0; y < options->size; y++) {
      view_canvas_row(&canvas, y, movie.pixels + (size_t)i * bytes + 3 * (size_t)y * (size_t)options->size);
    }
  }
  int rc = view_movie_write(png, &movie, error, error_size);
  view_canvas_free(&canvas);
  free(movie.pixels);
  return rc;
}

int view_file(const char *glb, const char *png, view_options *options, char *error, size_t error_size) {
  view_mesh mesh;
  if (options->poses < 2 || options->poses > 100 || options->size < 16 || options->size > 4096 || options->frames < 0) {
    snprintf(error, error_size, "the number of poses must be 2 to 100 and the size 16 to 4096");
    return -1;
  }
  if (view_mesh_read(glb, &mesh, error, error_size) != 0) {
    return -1;
  }
  view_vertex *vertices = malloc(mesh.vertex_count * sizeof *vertices);
  view_aim(&mesh, options);
  int rc = !vertices         ? no_memory(error, error_size)
           : options->frames ? draw_movie(&mesh, png, options, vertices, error, error_size)
                             : draw_sheet(&mesh, png, options, vertices, error, error_size);
  free(vertices);
  view_mesh_free(&mesh);
  return rc;
}
