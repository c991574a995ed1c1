/* Sample points (Eq. 2) of a one-ring, clipped by its kernel (section 5.1) and measured by Eq. 3. */
#ifndef ORB_EMBED_KERNEL_SAMPLING_SAMPLE_H
#define ORB_EMBED_KERNEL_SAMPLING_SAMPLE_H

#include "embed/common/kernel.h"
#include "embed/kernel_sampling/mesh.h"

/* The ring of one vertex: neighbour i and its successor span ring triangle i. Arrays have `capacity` entries. */
typedef struct orb_ks_ring {
  int32_t count, capacity;
  double (*point)[3];                  /* the neighbours on the sphere */
  double (*plane)[3];                  /* cross(point i, point i+1), from differences */
  double *side, *side2;                /* chord length of ring edge i, and its square */
  double *angle_p, *angle_q, *angle_r; /* squared mesh edge opposite to the vertex, to i, to i+1, over 2·area */
  double *inverse_area;                /* 1 / the area that the triangle stands for */
  int32_t *vertex;
  double aspect_exponent; /* of this ring */
  double fill;            /* area of its fan on the sphere over the area that it stands for */
} orb_ks_ring;

enum { KS_LANES = 16 }; /* floats of the widest vector; arrays of candidates are padded to it */

/* One ring triangle in single precision, for search.c. */
typedef struct orb_ks_edge {
  float q[3], w[3];       /* its ends */
  float normal[3], at;    /* of the plane through the edge and the centre */
  float a;                /* its length */
  float k0, kb, kc;       /* angle term: (k0 + kb·b² + kc·c²) / doubled area */
  float kappa, inv_kappa; /* ratio of areas = kappa · doubled area */
} orb_ks_edge;

typedef struct orb_ks_sampler {
  double area_exponent, aspect_exponent;
  int32_t pair_count; /* of (s, t) in Eq. 2 */
  double (*pair)[2];  /* s, t */
  double *candidate;  /* room for the points of one ring: x, y, z, error in planes of `room` */
  int32_t room;
  int32_t padded_count;   /* pair_count in whole vectors */
  float *pair_s, *pair_t; /* the same pairs; behind them (1, 1), which lies outside of any kernel */
  float *near_candidate;  /* as candidate */
  orb_ks_edge *edge;      /* as many as the ring's capacity */
  orb_cpu cpu;
  orb_ks_ring ring;
  int32_t kernel_points; /* how many samples the last call found inside the kernel */
} orb_ks_sampler;

ORB_MUST_CHECK orb_status orb_ks_sampler_create(orb_context *ctx, const orb_embed_options *options,
                                                orb_ks_sampler *out);
void orb_ks_sampler_free(orb_context *ctx, orb_ks_sampler *s);

enum {
  KS_WORK = 1 << 26,   /* samples times planes that one search may test */
  KS_WHOLE_RING = 1024 /* triangles that one search may sample; with a step of 0.11 it samples all of them */
};

/* In a larger ring (a pole's, or one of some hundreds of triangles with a very small step) only every n-th triangle is
 * sampled, eight at least, so that a search takes a few milliseconds at most: returns n. */
int32_t orb_ks_stride(const orb_ks_sampler *s, int32_t ring_count);

/* Loads the ring of v. P: points on the sphere, 3 per vertex. */
ORB_MUST_CHECK orb_status orb_ks_ring_load(orb_context *ctx, orb_ks_sampler *s, const orb_ks_mesh *m, const double *P,
                                           int32_t v);

/* Finds the best sample of the triangles (apex, i, i+1), first ≤ i < last, that lies in the kernel and has an error
 * below `bound`; returns whether there is one. draw (≤ 1) pulls the samples towards the apex by this factor. *error:
 * the error of `out`. */
int orb_ks_best_sample(orb_ks_sampler *s, const double apex[3], int32_t first, int32_t last, double draw, double bound,
                       double out[3], double *error);

/* Eq. 3 at one point of the kernel. */
double orb_ks_error_at(const orb_ks_sampler *s, const double p[3]);

#endif
