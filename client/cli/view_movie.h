/* Frames as an animated PNG file with a palette of at most 256 colours. */
#ifndef ORB_CLI_VIEW_MOVIE_H
#define ORB_CLI_VIEW_MOVIE_H

#include <stddef.h>

typedef struct view_movie {
  int width, height, count;
  int milliseconds;      /* duration of a frame */
  unsigned char *pixels; /* RGB, frame by frame */
} view_movie;

/* Returns 0, or −1 with the reason in `error`. */
int view_movie_write(const char *path, const view_movie *movie, char *error, size_t error_size);

#endif
