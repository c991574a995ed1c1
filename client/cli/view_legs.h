/* Bodies on two legs that lie along y, as a person in a file whose z axis points up, and heads with two horns. */
#ifndef ORB_CLI_VIEW_LEGS_H
#define ORB_CLI_VIEW_LEGS_H

#include "view_mesh.h"

/* Ways up other than y. */
enum { VIEW_WAYS = 4 };
typedef struct view_way {
  char up;            /* as in view_options */
  int axis, high_end; /* high_end: its high end is down */
} view_way;
extern const view_way view_ways[VIEW_WAYS];

/* The way up of such a body, by slices across the long axes: legs are two pieces, and end in one. 'y' where y may be
 * its height; 0: none. sideways: the shape is its mirror image along y, which then does not point up. */
char view_find_biped(const view_mesh *mesh, int sideways);

/* Whether the shape would stand on two prongs that are too thin to be legs if this way is up, such as horns. */
int view_is_thin(const view_mesh *mesh, char up);

/* The way up of a shape with two such prongs, such as the head of a goat; 0: none, or down along y, which no file that
 * glTF writers make has. */
char view_find_horns(const view_mesh *mesh);

#endif
