/* The vertices and triangles of an uploaded file, in their order, as a draft: what the asset of the remesh method
 * "template" has in place of the supermesh's own. */
#ifndef ORB_TRANSFER_TEMPLATE_H
#define ORB_TRANSFER_TEMPLATE_H

#include "transfer/draft.h"

typedef struct orb_template {
  orb_supermesh mesh;    /* the triangles of the file; vertices: those of the file, then copies. Not a closed surface */
  int32_t *on_supermesh; /* per vertex: its vertex on the supermesh; −1: it is not on the closed surface, and stays */
} orb_template;

/* Makes the draft of `file`, the first shape as orb_mesh_read() gave it, from that of the supermesh, which has its
 * frames (positions in doubles). A vertex whose corners have several texture coordinates, normals or colours gets a
 * copy for each further one, after all vertices of the file. Triangles keep their order within their material,
 * and the parts share all vertices. Normals
 * of the first frame are the file's, else smooth; those of the others are rotated as the smooth normal is. Free both
 * also after an error: `out` refers to `draft` and `made`. O(V·F). */
ORB_MUST_CHECK orb_status orb_template_draft(orb_context *ctx, const orb_draft *draft, const orb_mesh *file,
                                             orb_template *made, orb_draft *out);
/* The vertex of the repaired first shape that stands for vertex v of `file`; −1: none. */
int32_t orb_repaired_vertex(const orb_mesh *repaired, const orb_mesh *file, int32_t v);
/* The supermesh vertex of vertex v of `file`; −1: it is not on the closed surface. */
int32_t orb_template_vertex(const orb_draft *draft, const orb_mesh *file, int32_t v);
void orb_template_free(orb_context *ctx, orb_template *made);

#endif
