/* Reads from the folder of real meshes, which may be missing. */
#ifndef SUPPORT_SHARED_H
#define SUPPORT_SHARED_H

#include "orbmorph/mesh.h"

/* The bytes of a file in a sub-folder, followed by a zero byte. The caller frees them. NULL if there is no file. */
unsigned char *shared_bytes(const char *folder, const char *name, size_t *size);

/* Reads and repairs a mesh of the folder "good"; returns 0 if there is none. */
int shared_mesh(orb_context *ctx, const char *name, orb_mesh *mesh);

#endif
