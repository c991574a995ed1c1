/* Reading binary glTF for the view: entries by number and accessors, every offset checked. */
#ifndef ORB_CLI_VIEW_GLB_H
#define ORB_CLI_VIEW_GLB_H

#include <cjson/cJSON.h>
#include <stddef.h>
#include <stdint.h>

#include "view.h"

typedef struct glb {
  unsigned char *bytes;
  size_t size;
  const unsigned char *binary; /* the second chunk, within bytes */
  size_t binary_size;
  cJSON *json;
  char *error;
  size_t error_size;
} glb;

int glb_load(glb *r, const char *path);
void glb_free(glb *r);
/* Writes the reason; always −1. */
int glb_refuse(glb *r, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* A member that is a number from 0 on, or `otherwise`; the entry of a list at such a number, or NULL. */
double glb_number(const cJSON *object, const char *name, double otherwise);
int glb_code(const cJSON *object, const char *name, int otherwise); /* of those that fit an int */
const cJSON *glb_entry(const glb *r, const char *list, double index);
/* The bytes of a buffer view; NULL where they do not lie in the file. */
const unsigned char *glb_view(const glb *r, double index, size_t *size);

enum { GLB_UBYTE = 5121, GLB_USHORT = 5123, GLB_UINT = 5125, GLB_FLOAT = 5126 };
typedef struct glb_span {
  const unsigned char *bytes;
  uint32_t count;
  int kind, components;
  size_t stride;
} glb_span;
int glb_open(const glb *r, double accessor, glb_span *out);
uint32_t glb_index(const glb_span *s, uint32_t element);
/* Copies `components` numbers of each of `count` elements; leaves `out` as it is where there is no such attribute. */
int glb_copy(glb *r, const cJSON *attributes, const char *name, uint32_t count, int components, float *out);

/* view_paint.c: materials and the textures that they use, into the mesh; the last material is for what has none. */
int view_materials_read(glb *r, view_mesh *out);

#endif
