/* Pictures of a morphing GLB, drawn without a graphics processor: a sheet of poses side by side, or an animation. */
#ifndef ORB_CLI_VIEW_H
#define ORB_CLI_VIEW_H

#include <stddef.h>
#include <stdint.h>

typedef struct orb_view_options {
  int poses;    /* columns of a sheet: weights evenly from one shape to the next, both included; 5 */
  int frames;   /* 0: a sheet; else an animated PNG of so many frames, which runs for ever */
  int size;     /* pixels of a cell's side, 320 */
  char up;      /* 'y' (glTF's own) or 'z' */
  double yaw;   /* degrees about the up axis, 30 */
  double pitch; /* degrees from above, 15 */
  int wire;     /* draw the triangles' edges */
  int inside;   /* paint red what is seen from within */
} orb_view_options;
void orb_view_defaults(orb_view_options *options);

/* Draws the GLB file into the PNG file. A sheet has a row for each transition from one shape to the next and a column
 * a pose; each pose fills its cell, all are seen from the same direction. In an animation all shapes are drawn to one
 * scale; it goes there and back, or round where there are three shapes or more. Base colours, their textures and the
 * colours of vertices are drawn. Returns 0, or −1 with the reason in `error`. Files of orbmorph, and others with one
 * mesh and positions as floats. */
int orbmorph_view(const char *glb, const char *png, const orb_view_options *options, char *error, size_t error_size);

/* Below: what the files of the view share. */

/* A texture with its halvings, level 0 the largest: sRGB bytes, 3 a pixel, rows from the top. */
enum { VIEW_LEVELS = 16, VIEW_REPEAT = 10497, VIEW_CLAMP = 33071, VIEW_MIRROR = 33648 }; /* wraps as in glTF */
typedef struct view_texture {
  int levels, width[VIEW_LEVELS], height[VIEW_LEVELS];
  unsigned char *pixels[VIEW_LEVELS];
  int wrap[2]; /* across, down */
} view_texture;

/* What a triangle is painted with. */
typedef struct view_material {
  float factor[3];
  int32_t texture; /* −1: none */
} view_material;

/* A mesh with its targets, all primitives in one. Arrays are malloc'ed: view_mesh_free(). */
typedef struct view_mesh {
  uint32_t vertex_count, index_count, target_count;
  uint32_t between;                       /* in-betweens of each transition, among the targets after the shapes */
  float *positions, *normals, *colors;    /* 3, 3, 3 a vertex */
  float *texcoords;                       /* 2 a vertex */
  float *delta_positions, *delta_normals; /* target-major */
  uint32_t *indices;
  int32_t *painted; /* a triangle's material */
  view_material *materials;
  view_texture *textures;
  int32_t material_count, texture_count;
} view_mesh;
int view_mesh_read(const char *path, view_mesh *out, char *error, size_t error_size);
void view_mesh_free(view_mesh *mesh);
int view_shape_count(const view_mesh *mesh);

/* A PNG or JPEG in memory, and its halvings. Returns 0, or −1 where it is neither, or broken. */
int view_texture_decode(const unsigned char *bytes, size_t size, view_texture *out);
void view_texture_free(view_texture *texture);
/* Linear RGB at (u, v), blended between pixels; `span`: pixels of level 0 that a pixel of the canvas covers. */
void view_texture_sample(const view_texture *texture, float u, float v, float span, float out[3]);
float view_linear(unsigned char srgb);

/* A picture of linear RGB floats with depths, VIEW_SUPERSAMPLE times as large either way as what is written. */
enum { VIEW_SUPERSAMPLE = 2 };
typedef struct view_canvas {
  int width, height;
  float *color, *depth;
} view_canvas;
int view_canvas_make(view_canvas *canvas, int width, int height); /* −1: no memory */
void view_canvas_clear(view_canvas *canvas);
void view_canvas_free(view_canvas *canvas);
void view_canvas_row(const view_canvas *canvas, int y, unsigned char *row); /* averaged; sRGB, width/2 pixels */

/* A vertex on the canvas: pixels, depth (nearer is greater), unit normal towards the viewer's z, colour. */
typedef struct view_vertex {
  float x, y, z, normal[3], color[3], uv[2];
} view_vertex;
typedef struct view_paint {
  view_material material;
  const view_texture *texture; /* NULL: none */
  int wire, inside;
} view_paint;
void view_triangle(view_canvas *canvas, const view_vertex *const v[3], const view_paint *paint);

/* The pose at t, 0 to 1, of the transition from shape `from` to shape `to`, in the viewer's axes: x right, y up, z
 * towards the viewer. */
void view_pose(const view_mesh *mesh, int from, int to, double t, const orb_view_options *options, view_vertex *out);
typedef struct view_frame {
  float low[2], high[2];
} view_frame;
void view_frame_open(view_frame *frame);
void view_frame_add(view_frame *frame, const view_vertex *vertices, uint32_t count);
/* Moves a pose so that the frame fills a square of the canvas, with a margin, and draws it. */
void view_draw(const view_mesh *mesh, const orb_view_options *options, const view_frame *frame, int left, int top,
               view_vertex *vertices, view_canvas *canvas);

int view_png_write(const char *path, const view_canvas *canvas, char *error, size_t error_size);

/* Frames of RGB bytes, all in one block, into an animated PNG with a palette of at most 256 colours. */
typedef struct view_movie {
  int width, height, count, milliseconds; /* of a frame */
  unsigned char *pixels;
} view_movie;
int view_movie_write(const char *path, const view_movie *movie, char *error, size_t error_size);
/* A palette for these pixels by median cut, and each pixel's place in it. Returns its length, or 0 without memory. */
int view_palette(const unsigned char *rgb, size_t pixels, unsigned char palette[256][3], unsigned char *out);

#endif
