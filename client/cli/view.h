/* Pictures of a morphing GLB, drawn in software: a sheet of poses, or an animation. */
#ifndef ORB_CLI_VIEW_H
#define ORB_CLI_VIEW_H

#include <stddef.h>

#include "view_options.h"

void view_defaults(view_options *options);

/* Draws a GLB file into a PNG file: base colours, their textures and vertex colours. A sheet has a row for each
 * transition from one shape to the next and a column for each pose; each pose fills its cell, and all are seen from the
 * same direction. An animation draws all shapes at one scale; it goes to the last shape and back, or around if there
 * are three or more shapes without in-betweens. Reads the files of orbmorph, and others with one mesh whose positions
 * are floats. Fills in what the options leave open. Returns 0, or −1 with the reason in `error`. */
int view_file(const char *glb, const char *png, view_options *options, char *error, size_t error_size);

#endif
