/* Edits of a mesh that keep its attributes and its way back to the file. */
#ifndef ORB_MESH_EDIT_H
#define ORB_MESH_EDIT_H

#include "orbmorph/mesh.h"

/* Takes out the faces whose flag is set; returns how many. */
int32_t orb_mesh_drop_faces(orb_mesh *mesh, const unsigned char *drop);

/* Turns one face over: its corners 1 and 2 change places, normals that now point inward are reversed. */
void orb_mesh_turn_face(orb_mesh *mesh, int32_t triangle);

/* Room for more elements; contents stay, new ones are unset. Counts are not changed. */
ORB_MUST_CHECK orb_status orb_mesh_reserve(orb_context *ctx, orb_mesh *mesh, int32_t more_vertices,
                                           int32_t more_triangles);

/* stands[v] ≤ v is the vertex that v is welded to (itself if none), roots only. */
void orb_mesh_apply_weld(orb_mesh *mesh, const int32_t *stands);

/* Drops vertices that no face uses, keeping the order; *dropped: those that were not welded to another. */
ORB_MUST_CHECK orb_status orb_mesh_compact(orb_context *ctx, orb_mesh *mesh, int64_t *dropped);

/* Flags index-degenerate faces; returns how many. */
int32_t orb_mesh_flag_degenerate(const orb_mesh *mesh, unsigned char *drop);

/* Flags all but the first of the faces over the same three labels (label[v], or v where label is NULL); labels are
 * below vertex_count. Where twins: (may be NULL) first[t] is the face that t repeats, or t. Only faces with
 * candidate[t] count if candidate is given. O(V + F). */
ORB_MUST_CHECK orb_status orb_mesh_flag_duplicates(orb_context *ctx, const orb_mesh *mesh, const int32_t *label,
                                                   const unsigned char *candidate, unsigned char *drop, int32_t *first,
                                                   int32_t *count);

void orb_mesh_note(orb_mesh *mesh, const char *kind, int64_t count);

#endif
