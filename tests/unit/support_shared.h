/* The folder of real meshes, which may not be there. */
#ifndef SUPPORT_SHARED_H
#define SUPPORT_SHARED_H

#include "orbmorph/mesh.h"

/* The bytes of a file in a folder of it, with a zero after them: free() them. NULL where there is none. */
unsigned char *shared_bytes(const char *folder, const char *name, size_t *size);

/* Reads and repairs a mesh of the folder "good"; returns 0 if there is none. */
int shared_mesh(orb_context *ctx, const char *name, orb_mesh *mesh);

#endif
