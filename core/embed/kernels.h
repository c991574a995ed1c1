/* The loops that decide the speed, compiled for several vector widths from one source (lanes.inc.h and the *_kernel
 * templates) and chosen at run time. Results do not depend on the number of threads; between instruction sets they may
 * differ in the last bits. */
#ifndef ORB_EMBED_KERNELS_H
#define ORB_EMBED_KERNELS_H

#include "embed/corner_table.h"

enum { ORB_COST_RING_MAX = 40 }; /* larger stars cost ORB_COST_LARGE and are collapsed last */
#define ORB_COST_LARGE 1e30F

/* Evaluates what it costs to collapse vertices. */
typedef struct orb_cost_job {
  const orb_corner_table *surface;
  const int32_t *vertex; /* the list [begin, end) is taken from */
  unsigned char *dirty;  /* only these are evaluated; cleared */
  float threshold;       /* … and of these only such whose old cost is not above it */
  float *cost;
  int32_t *target;
} orb_cost_job;

/* One coloured Gauss–Seidel pass over batches of one colour: see level.h for the layout. */
typedef struct orb_sweep_job {
  double *point;             /* 4 a vertex */
  const int32_t *vertex;     /* lanes a batch; the last ones repeated where a batch is not full */
  const unsigned char *fill; /* lanes of a batch that count */
  const int32_t *valence;    /* of each batch */
  const int64_t *offset;     /* of each batch's first ring entry, in lanes */
  const int32_t *ring;       /* lanes a ring entry: vertex numbers */
  const float *shape;        /* 4·lanes a ring entry: half cotangents at ring[i+1], at ring[i], at v; doubled area */
  double weight, relax;      /* w; the over-relaxation */
  double *energy, *fall;     /* of each batch: the stars' energy before, and how far it fell */
  unsigned char *stiff;      /* of each batch: 1 where a lane was too thin to be moved in plain doubles */
} orb_sweep_job;

/* Fills batches that have their vertices: rings and shapes. */
typedef struct orb_fill_job {
  const orb_corner_table *surface;
  double blend;    /* of shapes towards equilateral */
  int32_t *vertex; /* as in orb_sweep_job; lanes that do not count are given the last one that does */
  const unsigned char *fill;
  const int32_t *valence;
  const int64_t *offset;
  int32_t *ring;
  float *shape;
} orb_fill_job;

typedef struct orb_kernels {
  const char *name;
  int lanes; /* doubles a batch */
  void (*costs)(const orb_cost_job *job, int64_t begin, int64_t end);
  void (*fill)(const orb_fill_job *job, int64_t begin, int64_t end);
  void (*sweep)(const orb_sweep_job *job, int64_t begin, int64_t end);
} orb_kernels;

/* Those that orb_context_cpu() names. */
const orb_kernels *orb_kernels_of(orb_cpu cpu);

extern const orb_kernels orb_kernels_plain;
#if defined(__x86_64__)
extern const orb_kernels orb_kernels_avx2, orb_kernels_avx512;
#endif

#endif
