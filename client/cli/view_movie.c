/* Writes the chunks of an animated PNG directly, since libpng does not support animation. Each frame after the first
 * holds only the rectangle that differs from the previous frame. https://www.w3.org/TR/png-3/ */
#include "view_movie.h"

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "view_palette.h"

typedef struct writer {
  FILE *file;
  uint32_t sequence;
  int failed;
} writer;

static void put32(unsigned char *p, uint32_t value) {
  for (int i = 0; i < 4; i++) {
    p[i] = (unsigned char)(value >> (24 - 8 * i));
  }
}

static void put16(unsigned char *p, int value) {
  p[0] = (unsigned char)(value >> 8);
  p[1] = (unsigned char)value;
}

/* fdAT chunks begin with a sequence number. */
static void chunk(writer *w, const char *name, const unsigned char *bytes, size_t size) {
  unsigned char word[4], sequence[4];
  int numbered = strcmp(name, "fdAT") == 0;
  uLong sum = crc32(0, (const Bytef *)name, 4);
  put32(word, (uint32_t)(size + (numbered ? 4 : 0)));
  w->failed |= fwrite(word, 1, 4, w->file) != 4 || fwrite(name, 1, 4, w->file) != 4;
  if (numbered) {
    put32(sequence, w->sequence++);
    w->failed |= fwrite(sequence, 1, 4, w->file) != 4;
    sum = crc32(sum, sequence, 4);
  }
  w->failed |= size && fwrite(bytes, 1, size, w->file) != size;
  put32(word, (uint32_t)(size ? crc32(sum, bytes, (uInt)size) : sum));
  w->failed |= fwrite(word, 1, 4, w->file) != 4;
}

typedef struct rectangle {
  int left, top, width, height;
} rectangle;

/* The bounding rectangle of the pixels that differ; one pixel if the frames are equal. */
static rectangle difference(const unsigned char *a, const unsigned char *b, int width, int height) {
  int left = width, right = 0, top = height, bottom = 0;
  for (int y = 0; y < height; y++) {
    for (int x = 0; x < width; x++) {
      if (a[(size_t)y * (size_t)width + (size_t)x] != b[(size_t)y * (size_t)width + (size_t)x]) {
        left = x < left ? x : left;
        right = x >= right ? x + 1 : right;
        top = y < top ? y : top;
        bottom = y + 1;
      }
    }
  }
  return bottom ? (rectangle){left, top, right - left, bottom - top} : (rectangle){0, 0, 1, 1};
}

static void frame_control(writer *w, rectangle r, int milliseconds) {
  unsigned char bytes[26] = {0}; /* the last two: no disposal, no blending */
  put32(bytes, w->sequence++);
  put32(bytes + 4, (uint32_t)r.width);
  put32(bytes + 8, (uint32_t)r.height);
  put32(bytes + 12, (uint32_t)r.left);
  put32(bytes + 16, (uint32_t)r.top);
  put16(bytes + 20, milliseconds);
  put16(bytes + 22, 1000);
  chunk(w, "fcTL", bytes, sizeof bytes);
}

/* Deflates rows without a filter, which suits a palette. */
static int frame_data(writer *w, const char *name, const unsigned char *frame, int width, rectangle r) {
  size_t stride = (size_t)r.width + 1, raw = stride * (size_t)r.height;
  uLongf size = compressBound((uLong)raw);
  unsigned char *rows = malloc(raw), *packed = malloc(size);
  int rc = rows && packed ? 0 : -1;
  for (int y = 0; rc == 0 && y < r.height; y++) {
    rows[(size_t)y * stride] = 0;
    memcpy(rows + (size_t)y * stride + 1, frame + (size_t)(r.top + y) * (size_t)width + (size_t)r.left,
           (size_t)r.width);
  }
  if (rc == 0 && compress2(packed, &size, rows, (uLong)raw, 9) != Z_OK) {
    rc = -1;
  }
  if (rc == 0) {
    chunk(w, name, packed, size);
  }
  free(rows);
  free(packed);
  return rc;
}

static void header(writer *w, const view_movie *movie, const unsigned char palette[256][3], int colors) {
  static const unsigned char signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  unsigned char head[13] = {0}, control[8] = {0}; /* 0 plays: loop */
  w->failed |= fwrite(signature, 1, sizeof signature, w->file) != sizeof signature;
  put32(head, (uint32_t)movie->width);
  put32(head + 4, (uint32_t)movie->height);
  head[8] = 8;
  head[9] = 3; /* colour type: palette */
  chunk(w, "IHDR", head, sizeof head);
  put32(control, (uint32_t)movie->count);
  chunk(w, "acTL", control, sizeof control);
  chunk(w, "PLTE", palette[0], 3 * (size_t)colors);
}

static int write_frames(writer *w, const view_movie *movie, const unsigned char *indices) {
  size_t pixels = (size_t)movie->width * (size_t)movie->height;
  int rc = 0;
  for (int i = 0; rc == 0 && i < movie->count; i++) {
    const unsigned char *frame = indices + (size_t)i * pixels;
    rectangle r = i ? difference(frame - pixels, frame, movie->width, movie->height)
                    : (rectangle){0, 0, movie->width, movie->height};
    frame_control(w, r, movie->milliseconds);
    rc = frame_data(w, i ? "fdAT" : "IDAT", frame, movie->width, r);
  }
  chunk(w, "IEND", NULL, 0);
  return rc;
}

int view_movie_write(const char *path, const view_movie *movie, char *error, size_t error_size) {
  unsigned char palette[256][3];
  size_t pixels = (size_t)movie->width * (size_t)movie->height * (size_t)movie->count;
  unsigned char *indices = malloc(pixels);
  int colors = indices ? view_palette(movie->pixels, pixels, palette, indices) : 0;
  writer w = {.file = colors ? fopen(path, "wb") : NULL};
  if (!colors) {
    snprintf(error, error_size, "not enough memory");
  } else if (!w.file) {
    snprintf(error, error_size, "cannot write %s: %s", path, strerror(errno));
  }
  int rc = -1;
  if (w.file) {
    header(&w, movie, palette, colors);
    rc = write_frames(&w, movie, indices);
    if (fclose(w.file) != 0 || rc != 0 || w.failed) {
      snprintf(error, error_size, "cannot write all of %s", path);
      rc = -1;
    }
  }
  free(indices);
  return rc;
}
