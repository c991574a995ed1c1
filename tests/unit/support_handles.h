/* Stitches small handles and tunnels into a closed mesh. */
#ifndef SUPPORT_HANDLES_H
#define SUPPORT_HANDLES_H

#include "orbmorph/mesh.h"

/* The mesh as text (OBJ), with `count` tubes of three sides and three rings: each joins the rims of two faces that are
 * some faces apart and are omitted. Odd ones run outside the body (handles), even ones inside (tunnels). *made: how
 * many there was room for. Free with free(). */
char *handles_stitch(const orb_mesh *mesh, int count, unsigned seed, size_t *size, int *made);

/* A plate of cubes of edge 1, 2·holes + 1 by 3 by 1, with `holes` holes through it: genus `holes`. */
char *handles_plate(int holes, size_t *size);

#endif
