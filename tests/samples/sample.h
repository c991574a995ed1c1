/* The samples: small animals as implicit surfaces, polygonised in several ways.
 *
 * Only + − × ÷ and square roots of doubles are used, each of which IEEE 754 rounds in one way, so the files come out
 * with the same bytes wherever they are made (the build turns contraction to fused operations off).
 */
#ifndef ORB_SAMPLES_SAMPLE_H
#define ORB_SAMPLES_SAMPLE_H

#include <stddef.h>

/* A primitive: a round cone (the hull of two balls), or an ellipsoid given by its three half-axes. It is blended into
 * the part it belongs to over the distance `blend`; a primitive that begins a part carries the blend of the whole part
 * into the body. */
typedef struct orb_primitive {
  enum { SAMPLE_CONE, SAMPLE_ELLIPSOID } kind;
  int begins_part;
  double blend;
  double a[3], b[3], ra, rb; /* cone: the balls */
  double axis[3][3];         /* ellipsoid about a: half-axes, orthogonal */
} orb_primitive;

/* A named feature: where the ray from `from`, a place inside, leaves the surface along `direction`. */
typedef struct orb_feature {
  const char *name;
  double from[3], direction[3];
} orb_feature;

typedef struct orb_animal {
  const char *name;
  const orb_primitive *primitives;
  size_t primitive_count;
  const orb_feature *features;
  size_t feature_count;
  double low[3], high[3]; /* a box that holds it */
} orb_animal;

extern const orb_animal sample_dog, sample_giraffe, sample_elephant;

/* Signed distance, roughly: negative inside. */
double sample_field(const orb_animal *animal, const double p[3]);
/* The signed distance to one primitive, roughly. */
double sample_distance(const orb_primitive *primitive, const double p[3]);
/* The field's gradient by central differences. */
void sample_gradient(const orb_animal *animal, const double p[3], double out[3]);
/* Moves p onto the surface along the gradient. */
void sample_project(const orb_animal *animal, double p[3]);

typedef struct orb_sample {
  int vertex_count, triangle_count;
  double *positions;
  int *triangles;
} orb_sample;

/* Polygonise with cells of the given size. Both give closed meshes where the cells are small enough. */
void sample_surface_nets(const orb_animal *animal, double cell, orb_sample *out);
void sample_marching_tetrahedra(const orb_animal *animal, double cell, orb_sample *out);

/* Evens the triangles out: each vertex towards the mean of its neighbours, and back onto the surface. */
void sample_smooth(const orb_animal *animal, orb_sample *mesh, int rounds);
/* Collapses edges until at most `triangles` are left; the larger `detail`, the more of them stay where it is curved. */
void sample_decimate(const orb_animal *animal, orb_sample *mesh, double detail, int triangles);

/* NULL if closed, manifold, connected, consistently oriented and of genus zero; else what is wrong. */
const char *sample_fault(const orb_sample *mesh);
/* The vertex nearest to a feature. */
int sample_feature_vertex(const orb_animal *animal, const orb_sample *mesh, const orb_feature *feature);

void *sample_alloc(size_t count, size_t size); /* ends the program when there is no memory */

/* The triangles about each vertex: list[first[v]] … list[first[v + 1] − 1]. Free both. */
void sample_incidence(const orb_sample *mesh, int **first, int **list);

#endif
