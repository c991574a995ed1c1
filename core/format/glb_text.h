/* Appending the JSON of a GLB as text. All memory comes from the context. */
#ifndef ORB_FORMAT_GLB_TEXT_H
#define ORB_FORMAT_GLB_TEXT_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The functions below append until one fails; the first failure stays. */
typedef struct orb_glb_writer {
  orb_context *ctx;
  orb_buffer *out;
  orb_status status;
} orb_glb_writer;

void orb_glb_put(orb_glb_writer *w, const void *bytes, size_t size);
void orb_glb_text(orb_glb_writer *w, const char *literal);

/* Values. before: the text in front of the value, with its comma or bracket and its key. */
void orb_glb_integer(orb_glb_writer *w, const char *before, size_t value);
/* Writes the fewest digits that read back as the same number, with a point in every locale. */
void orb_glb_number(orb_glb_writer *w, const char *before, double value);
void orb_glb_numbers(orb_glb_writer *w, const char *before, const double *values, int count);
/* U+FFFD replaces bytes that are not UTF-8. */
void orb_glb_quoted(orb_glb_writer *w, const char *before, const char *string);

#ifdef __cplusplus
}
#endif
#endif
