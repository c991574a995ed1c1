/* Edits of a mesh that keep its attributes and its numbers in the file consistent. */
#ifndef ORB_MESH_EDIT_H
#define ORB_MESH_EDIT_H

#include "orbmorph/mesh.h"

/* Removes the faces whose flag is set; returns how many. */
int32_t orb_mesh_drop_faces(orb_mesh *mesh, const unsigned char *drop);

/* Reverses one face: swaps its corners 1 and 2 and negates normals that now point inward. */
void orb_mesh_reverse_face(orb_mesh *mesh, int32_t triangle);

/* Makes room for more elements. Counts stay as they are; the room is not initialised. */
ORB_MUST_CHECK orb_status orb_mesh_reserve(orb_context *ctx, orb_mesh *mesh, int32_t more_vertices,
                                           int32_t more_triangles);

/* Replaces each vertex v by stands[v] ≤ v, the vertex it is welded to (itself if none): roots, not chains. */
void orb_mesh_apply_weld(orb_mesh *mesh, const int32_t *stands);

/* Drops vertices that no face uses and keeps the order; *dropped: how many, without those welded to another. */
ORB_MUST_CHECK orb_status orb_mesh_compact(orb_context *ctx, orb_mesh *mesh, int64_t *dropped);

/* Flags faces that name a vertex twice; returns how many. */
int32_t orb_mesh_flag_degenerate(const orb_mesh *mesh, unsigned char *drop);

/* Flags all but the first of the faces over the same three labels (label[v] < vertex_count, or v where label is NULL);
 * *count: how many. first (may be NULL): first[t] is the face that t repeats, or t. candidate (may be NULL): only faces
 * with this flag are compared. O(V + F). */
ORB_MUST_CHECK orb_status orb_mesh_flag_duplicates(orb_context *ctx, const orb_mesh *mesh, const int32_t *label,
                                                   const unsigned char *candidate, unsigned char *drop, int32_t *first,
                                                   int32_t *count);

/* Adds to the mesh's list of repairs; a count of 0 adds nothing. kind: a literal. */
void orb_mesh_note(orb_mesh *mesh, const char *kind, int64_t count);

#endif
