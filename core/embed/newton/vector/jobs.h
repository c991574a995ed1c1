/* The loops that decide the speed of an embedding, and what they are given. One source (the .inc.h files of this
 * folder) is compiled for several vector widths; loops.c chooses a version at run time. Results do not depend on the
 * number of threads; between instruction sets their last bits may differ. */
#ifndef ORB_EMBED_NEWTON_VECTOR_JOBS_H
#define ORB_EMBED_NEWTON_VECTOR_JOBS_H

#include "embed/common/corner_table.h"

enum {
  ORB_COST_RING_MAX = 40, /* neighbours; larger stars cost ORB_COST_LARGE and are collapsed last */
  ORB_SWEEP_RING_MAX = 62 /* neighbours of a vertex that a vector sweep moves; the scalar step takes larger stars */
};
#define ORB_COST_LARGE 1e30F /* above every cost of a smaller star */

/* Evaluates what it costs to collapse vertices. */
typedef struct orb_cost_job {
  const orb_corner_table *surface;
  const int32_t *vertex; /* the list that [begin, end) indexes */
  unsigned char *dirty;  /* only vertices with this flag are evaluated; the flag is then cleared */
  float threshold;       /* of the dirty ones, only those whose old cost is not above it */
  float *cost;
  int32_t *target;
} orb_cost_job;

/* E = Σ D (w + angle · a/d + area · a²/d²). D a/d depends on angles alone; D a²/d² grows as a triangle loses area. */
typedef struct orb_newton_energy {
  double w, angle, area;
} orb_newton_energy;

/* One coloured Gauss–Seidel pass over batches of one colour: level.h has the layout. */
typedef struct orb_sweep_job {
  double *point;              /* 4 per vertex */
  const int32_t *vertex;      /* lanes per batch; the last one repeats where a batch is not full */
  const unsigned char *fill;  /* lanes of a batch that count */
  const unsigned char *count; /* of each lane: its neighbours, ascending within a batch */
  const int32_t *valence;     /* of each batch: the most neighbours of a lane */
  const int64_t *offset;      /* of each batch's first ring entry, in lanes */
  const int32_t *ring;        /* lanes per ring entry: vertex numbers */
  const float *shape;       /* 4·lanes per ring entry: half cotangents at ring[i+1], at ring[i], at v; doubled area */
  orb_newton_energy weight; /* of the parts of the energy */
  double relax;             /* the over-relaxation factor */
  double scale;             /* about the reciprocal of an edge on the sphere */
  double *energy, *fall;    /* of each batch: the energy of its stars before the pass, and how far it fell */
  uint16_t *stiff;          /* of each batch: bit l is set where lane l was too thin to be moved in plain doubles */
} orb_sweep_job;

/* Fills the rings and shapes of batches whose vertices are set. */
typedef struct orb_fill_job {
  const orb_corner_table *surface;
  double blend;    /* of shapes towards equilateral, 0 to 1 */
  int32_t *vertex; /* as in orb_sweep_job; lanes that do not count are set to the last one that does */
  unsigned char *count;
  const unsigned char *fill;
  const int32_t *valence;
  const int64_t *offset;
  int32_t *ring;
  float *shape;
} orb_fill_job;

/* One version of the loops. */
typedef struct orb_vector_loops {
  const char *name;
  int lanes; /* vertices per batch, 16 at most */
  void (*costs)(const orb_cost_job *job, int64_t begin, int64_t end);
  void (*fill)(const orb_fill_job *job, int64_t begin, int64_t end);
  void (*sweep)(const orb_sweep_job *job, int64_t begin, int64_t end);
} orb_vector_loops;

/* Each is defined in the file of its name. */
extern const orb_vector_loops orb_vector_plain;
#if defined(__x86_64__)
extern const orb_vector_loops orb_vector_avx2, orb_vector_avx512;
#endif

#endif
