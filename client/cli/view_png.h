/* A canvas as a PNG file. */
#ifndef ORB_CLI_VIEW_PNG_H
#define ORB_CLI_VIEW_PNG_H

#include <stddef.h>

#include "view_canvas.h"

/* Returns 0, or −1 with the reason in `error`. */
int view_png_write(const char *path, const view_canvas *canvas, char *error, size_t error_size);

#endif
