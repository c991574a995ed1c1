/* What leads the first mesh of a registration, and where it is. */
#ifndef ORB_ELASTIC_POSE_H
#define ORB_ELASTIC_POSE_H

#include "orbmorph/mesh.h"

/* A rough map between two meshes, both ways: for each vertex of one, a vertex of the other. */
typedef struct orb_rough_map {
  const int32_t *forth; /* of the second mesh, for each vertex of the first */
  const int32_t *back;  /* of the first mesh, for each vertex of the second */
} orb_rough_map;

/* A point of the first mesh that belongs at a place of the second one. */
typedef struct orb_elastic_anchor {
  int32_t vertex;   /* of the first mesh, near the point */
  double offset[3]; /* from the vertex to the point, in the mesh as given */
  double place[3];  /* where the point belongs */
} orb_elastic_anchor;

/* A NULL pointer to them means none. */
typedef struct orb_elastic_anchors {
  int32_t count;
  const orb_elastic_anchor *one;
} orb_elastic_anchors;

/* Where the first mesh is. The caller owns both. */
typedef struct orb_elastic_pose {
  double *position; /* 3 per vertex */
  double *rotation; /* 9 per vertex, row-major: of its surroundings, from the mesh as given */
} orb_elastic_pose;

#endif
