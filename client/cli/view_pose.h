/* Poses: shapes blended, rotated toward the viewer, framed and drawn. */
#ifndef ORB_CLI_VIEW_POSE_H
#define ORB_CLI_VIEW_POSE_H

#include "view_canvas.h"
#include "view_mesh.h"
#include "view_options.h"

/* The rotation that makes an axis of the file point up (view_options.up): its rows are the axes that become x, y and z.
 */
typedef double view_rotation[3][3];
void view_upright(char up, view_rotation out);

/* The pose at t, 0 to 1, of the transition from shape `from` to shape `to`, in the viewer's axes: x right, y up, z
 * towards the viewer. */
void view_pose(const view_mesh *mesh, int from, int to, double t, const view_options *options, view_vertex *out);

/* The bounding rectangle of one or more poses. */
typedef struct view_frame {
  float low[2], high[2];
} view_frame;
void view_frame_open(view_frame *frame);
void view_frame_add(view_frame *frame, const view_vertex *vertices, uint32_t count);

/* Draws a pose into the square of the canvas at (left, top), scaled so that the frame fills the square up to a margin.
 * Changes the vertices. */
void view_draw(const view_mesh *mesh, const view_options *options, const view_frame *frame, int left, int top,
               view_vertex *vertices, view_canvas *canvas);

#endif
