/* The loop that decides how long an alignment takes, and what it is given: one damped Newton step for each vertex of a
 * list, several vertices at once.
 *
 * In: a level as steps read it, and a list of its vertices, no two of them neighbours. Out: each vertex of the list
 * where its step takes it. One source (the .inc.h files of this folder) is compiled for several vector widths; loops.c
 * chooses a version at run time. Results do not depend on the number of threads; between instruction sets their last
 * bits may differ. Read in this order:
 *
 *   batch.inc.h     the stars of several vertices: reading them, and their energy
 *   expand.inc.h    its gradient and Hessian, and the Newton direction
 *   trace.inc.h     straight paths over the fixed shape
 *   sweep.inc.h     tries of a step, and the loop
 */
#ifndef ORB_ALIGN_MAP_ENGINE_VECTOR_JOBS_H
#define ORB_ALIGN_MAP_ENGINE_VECTOR_JOBS_H

#include "align/map/engine/packed.h"

/* A level as steps read it. Of the level itself they read start, target and pull, and write moved. */
typedef struct orb_map_step_job {
  const orb_map_packed *fixed;
  const orb_map_rules *rules;
  orb_map_level *level;
  double *row;       /* ORB_MAP_ROW a vertex: position, point on the sphere, normal, density there */
  int32_t *triangle; /* of each vertex: its place, */
  double *at;        /* and its coordinates there, 3 per vertex */
  int32_t *ring;     /* of each spoke: the neighbour */
  float *spoke;      /* 4 per spoke: cotangents at the vertex, at the neighbour and at the next; area */
  int32_t *list;     /* the vertices to step, no two of them neighbours, with at most ORB_MAP_STEP_RING_MAX spokes */
  int pulled;        /* some vertex has a spatial target */
} orb_map_step_job;

/* One version of the loop. */
typedef struct orb_map_loops {
  const char *name;
  int lanes; /* vertices at once */
  void (*steps)(const orb_map_step_job *job, int64_t begin, int64_t end);
} orb_map_loops;

/* Each is defined in the file of its name. */
extern const orb_map_loops orb_map_loops_plain;
#if defined(__x86_64__)
extern const orb_map_loops orb_map_loops_avx2, orb_map_loops_avx512;
#endif

#endif
