/* Tangents for textures that bend normals. */
#ifndef ORB_TRANSFER_TANGENT_H
#define ORB_TRANSFER_TANGENT_H

#include "transfer/draft.h"

/* Fills draft->tangents if a material needs them (orb_material_tangents()) and the draft has normals and texture
 * coordinates. Frame 0: unit vectors with the sign of the bitangent as fourth number; the other frames: differences to
 * it, three numbers. Needs draft->positions, normals, texcoords and home. O(T·F). */
ORB_MUST_CHECK orb_status orb_draft_tangents(orb_context *ctx, orb_draft *draft);

#endif
