/* Contact sheets: the poses of a morphing GLB side by side in a PNG, drawn without a graphics processor. */
#ifndef ORB_CLI_VIEW_H
#define ORB_CLI_VIEW_H

#include <stddef.h>
#include <stdint.h>

typedef struct orb_view_options {
  int poses;    /* columns: weights evenly from one shape to the next, both included; 5 */
  int size;     /* pixels of a cell's side, 320 */
  char up;      /* 'y' (glTF's own) or 'z' */
  double yaw;   /* degrees about the up axis, 30 */
  double pitch; /* degrees from above, 15 */
  int wire;     /* draw the triangles' edges */
} orb_view_options;
void orb_view_defaults(orb_view_options *options);

/* Draws the GLB file into the PNG file: a row for each transition from one shape to the next, a column a pose; each
 * pose fills its cell, all are seen from the same direction. Surfaces seen from within are red. Returns 0, or −1 with
 * the reason in `error`. Files of orbmorph, and others with float positions and one mesh. */
int orbmorph_view(const char *glb, const char *png, const orb_view_options *options, char *error, size_t error_size);

/* Below: what the files of the view share. */

/* A mesh with its targets, all primitives in one. Arrays are malloc'ed: view_mesh_free(). */
typedef struct view_mesh {
  uint32_t vertex_count, index_count, target_count;
  uint32_t between;                       /* in-betweens of each transition, among the targets after the shapes */
  float *positions, *normals, *colors;    /* 3, 3, 3 a vertex */
  float *delta_positions, *delta_normals; /* target-major */
  uint32_t *indices;
} view_mesh;
int view_mesh_read(const char *path, view_mesh *out, char *error, size_t error_size);
void view_mesh_free(view_mesh *mesh);

/* A picture of linear RGB floats with depths, twice as large either way as what is written. */
typedef struct view_canvas {
  int width, height;
  float *color, *depth;
} view_canvas;

/* A vertex on the canvas: pixels, depth (nearer is greater), unit normal towards the viewer's z, colour. */
typedef struct view_vertex {
  float x, y, z, normal[3], color[3];
} view_vertex;
void view_triangle(view_canvas *canvas, const view_vertex *a, const view_vertex *b, const view_vertex *c, int wire);
int view_png_write(const char *path, const view_canvas *canvas, char *error, size_t error_size);

#endif
