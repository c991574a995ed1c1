/* How the view draws. */
#ifndef ORB_CLI_VIEW_OPTIONS_H
#define ORB_CLI_VIEW_OPTIONS_H

/* What in the first shape says which way is up. */
typedef enum view_sign {
  VIEW_BY_USER,
  VIEW_BY_NOTHING,
  VIEW_BY_FEET,
  VIEW_BY_LEGS,
  VIEW_BY_BASE,
  VIEW_BY_HORNS
} view_sign;

typedef struct view_options {
  int poses;  /* columns of a sheet: evenly spaced weights from one shape to the next, both included */
  int frames; /* 0: a sheet; else the number of frames of an animated PNG that loops */
  int size;   /* width and height of a pose in pixels */
  char up;    /* the axis that points up: 'x', 'y' or 'z', or in capitals its opposite; 0: view_aim() decides */
  view_sign sign;
  double yaw;   /* degrees around the up axis; NAN: view_aim() decides */
  double pitch; /* degrees from above */
  int wire;     /* draw the edges of the triangles */
  int inside;   /* paint triangles seen from inside red */
} view_options;

#endif
