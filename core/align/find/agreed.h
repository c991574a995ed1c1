/* The part of two shapes on which a registration agrees with its way back, and the rough map that follows from it.
 *
 * Where proportions differ, a rough map can have most of a body right and one limb on another limb. A registration
 * along it cannot leave that limb. But there the way back does not return to where it came from, and distances along
 * the surfaces tell what such a limb should have met: every vertex goes where its distances from the part that agrees
 * are most alike. A registration along this map bends the shapes less, and agrees on more. */
#ifndef ORB_ALIGN_FIND_AGREED_H
#define ORB_ALIGN_FIND_AGREED_H

#include "align/find/survey.h"
#include "elastic/pose.h"

enum { ORB_AGREED_MARKS = 40 }; /* vertices of the part that agrees; with 16, maps bend the shapes by a tenth more */

/* Room for one extension at a time. */
typedef struct orb_agreed {
  const orb_mesh *mesh[2];     /* borrowed, scaled to area 4π */
  const orb_survey *survey[2]; /* borrowed, with distances */
  double *far;       /* of each vertex of the first mesh: from the marks so far; negative: it does not agree */
  float *sum;        /* of one vertex: how unlike the distances of each vertex of the other mesh are */
  int32_t *image[2]; /* the vertex of the other mesh on which each vertex lies */
  int32_t count;     /* marks */
  int32_t mark[2][ORB_AGREED_MARKS];
  double weight[ORB_AGREED_MARKS];
} orb_agreed;

/* Two meshes and their surveys, which must outlive `out`. Free it in any case. */
ORB_MUST_CHECK orb_status orb_agreed_create(orb_context *ctx, const orb_mesh *const mesh[2],
                                            const orb_survey *const survey[2], orb_agreed *out);
void orb_agreed_free(orb_context *ctx, orb_agreed *agreed);

/* Fills forth and back, a vertex of the other mesh for each vertex. position[s]: where a registration takes mesh s, in
 * the space of the other one (3 per vertex). inner: the share of the marks that count, those nearest to the others; 1:
 * all. *extended 0: too little agrees, or nearly all, and they are not filled. O(marks · n²): about 0.005 s of one
 * thread for 350 vertices. */
ORB_MUST_CHECK orb_status orb_agreed_extend(orb_context *ctx, orb_agreed *agreed, const double *const position[2],
                                            double inner, int32_t *forth, int32_t *back, int *extended);

#endif
