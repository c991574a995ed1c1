/* Triangles drawn onto a canvas with a depth buffer. */
#ifndef ORB_CLI_VIEW_CANVAS_H
#define ORB_CLI_VIEW_CANVAS_H

#include "view_material.h"
#include "view_texture.h"

/* Linear RGB and depth. The canvas has VIEW_SUPERSAMPLE times the width and height of the written picture. */
enum { VIEW_SUPERSAMPLE = 2 };
typedef struct view_canvas {
  int width, height;
  float *color, *depth;
} view_canvas;

int view_canvas_make(view_canvas *canvas, int width, int height); /* −1: no memory */
void view_canvas_clear(view_canvas *canvas);
void view_canvas_free(view_canvas *canvas);

/* Row y of the written picture: averages of the canvas as sRGB, width / VIEW_SUPERSAMPLE pixels. */
void view_canvas_row(const view_canvas *canvas, int y, unsigned char *row);

/* x, y in pixels, z larger if nearer; the normal has unit length and its z points to the viewer. */
typedef struct view_vertex {
  float x, y, z, normal[3], color[3], uv[2];
} view_vertex;

typedef struct view_paint {
  view_material material;
  const view_texture *texture; /* NULL: none */
  int wire, inside;
} view_paint;

void view_triangle(view_canvas *canvas, const view_vertex *const v[3], const view_paint *paint);

#endif
