/* Binary glTF: chunks, entries and accessors. Every offset is checked. */
#ifndef ORB_CLI_VIEW_GLB_H
#define ORB_CLI_VIEW_GLB_H

#include <cjson/cJSON.h>
#include <stddef.h>
#include <stdint.h>

typedef struct glb_file {
  unsigned char *bytes;
  size_t size;
  const unsigned char *binary; /* the second chunk, within bytes */
  size_t binary_size;
  cJSON *json;
  char *error; /* receives the reason for a refusal */
  size_t error_size;
} glb_file;

/* Returns 0, or −1 with the reason in r->error. Free also after an error. */
int glb_load(glb_file *r, const char *path);
void glb_free(glb_file *r);

/* Writes the reason into r->error; returns −1. */
int glb_refuse(glb_file *r, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* A member that is a number from 0 to 2³² − 1, or `otherwise`. glb_code: one that fits an int. */
double glb_number(const cJSON *object, const char *name, double otherwise);
int glb_code(const cJSON *object, const char *name, int otherwise);

/* The entry at an index of a top-level list such as "meshes"; NULL if there is none. */
const cJSON *glb_entry(const glb_file *r, const char *list, double index);

/* The bytes of a buffer view; NULL if they do not lie within the file. */
const unsigned char *glb_view(const glb_file *r, double index, size_t *size);

enum { GLB_UBYTE = 5121, GLB_USHORT = 5123, GLB_UINT = 5125, GLB_FLOAT = 5126 };
typedef struct glb_span {
  const unsigned char *bytes;
  uint32_t count;
  int kind, components;
  size_t stride;
} glb_span;
int glb_open(const glb_file *r, double accessor, glb_span *out);
uint32_t glb_index(const glb_span *s, uint32_t element);

/* Copies `components` numbers of each of `count` elements. Leaves `out` unchanged if there is no such attribute. */
int glb_copy(glb_file *r, const cJSON *attributes, const char *name, uint32_t count, int components, float *out);

#endif
