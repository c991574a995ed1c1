/* Bodies at rest: proportions, and different triangles for every body. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "posed.h"

/* Factors of length and thickness. */
typedef struct factors {
  double length, radius;
} factors;

static factors factors_of(posed_limb limb, const char *variant) {
  const int slim = !strcmp(variant, "slim"), stout = !strcmp(variant, "stout");
  if (!slim && !stout)
    return (factors){1, 1};
  switch (limb) {
    case TORSO:
      return slim ? (factors){1.05, 0.85} : (factors){0.95, 1.12};
    case NECK:
      return slim ? (factors){1.25, 0.90} : (factors){0.85, 1.10};
    case HEAD:
    case SNOUT:
    case FACE:
      return slim ? (factors){1.15, 0.92} : (factors){0.95, 1.00};
    case TAIL:
    case EAR_R:
    case EAR_L:
      return slim ? (factors){1.30, 1.00} : (factors){0.80, 1.05};
    case LIMB_NONE:
      return (factors){1, 1};
    default: /* legs */
      return slim ? (factors){1.25, 0.95} : (factors){0.78, 1.15};
  }
}

/* Where a place beside a bone moves when the bone gets other proportions: along it by its length, across by its radius.
 */
static void carry(const orb_primitive *from, const orb_primitive *to, factors f, const double p[3], double out[3]) {
  double axis[3], length2 = 0, along = 0;
  for (int k = 0; k < 3; k++) {
    axis[k] = from->kind == SAMPLE_CONE ? from->b[k] - from->a[k] : 0;
    length2 += axis[k] * axis[k];
    along += axis[k] * (p[k] - from->a[k]);
  }
  along = length2 > 0 ? along / length2 : 0;
  for (int k = 0; k < 3; k++)
    out[k] = to->a[k] + f.length * along * axis[k] + f.radius * (p[k] - from->a[k] - along * axis[k]);
}

static void box(posed_rest *rest) {
  orb_animal *animal = &rest->animal;
  for (int k = 0; k < 3; k++) {
    animal->low[k] = 1e9;
    animal->high[k] = -1e9;
    for (size_t i = 0; i < animal->primitive_count; i++) {
      const orb_primitive *o = &animal->primitives[i];
      const int is_cone = o->kind == SAMPLE_CONE;
      double a =
          is_cone ? o->ra
                  : sqrt(o->axis[0][k] * o->axis[0][k] + o->axis[1][k] * o->axis[1][k] + o->axis[2][k] * o->axis[2][k]);
      double b = is_cone ? o->rb : a, end = is_cone ? o->b[k] : o->a[k];
      animal->low[k] = fmin(animal->low[k], fmin(o->a[k] - a, end - b));
      animal->high[k] = fmax(animal->high[k], fmax(o->a[k] + a, end + b));
    }
    animal->low[k] -= 0.15;
    animal->high[k] += 0.15;
  }
}

void posed_proportion(const posed_kind *kind, const char *variant, posed_rest *out) {
  memset(out, 0, sizeof *out);
  out->kind = kind;
  out->animal = *kind->animal;
  for (size_t i = 0; i < kind->animal->primitive_count; i++) {
    const orb_primitive *from = &kind->animal->primitives[i];
    const int parent = kind->bones[i].parent;
    const factors f = factors_of(kind->bones[i].limb, variant);
    orb_primitive *to = &out->primitives[i];
    *to = *from;
    if (parent >= 0)
      carry(&kind->animal->primitives[parent], &out->primitives[parent], factors_of(kind->bones[parent].limb, variant),
            from->a, to->a);
    for (int k = 0; k < 3; k++) {
      to->b[k] = to->a[k] + f.length * (from->b[k] - from->a[k]);
      for (int axis = 0; axis < 3; axis++)
        to->axis[axis][k] *= axis == 2 ? f.radius : f.length;
    }
    to->ra *= f.radius;
    to->rb *= f.radius;
  }
  out->animal.primitives = out->primitives;
  box(out);
}

unsigned posed_random(unsigned *state, unsigned limit) {
  *state = *state * 1664525u + 1013904223u;
  return (unsigned)((unsigned long long)(*state >> 8) * limit >> 24);
}

void posed_polygonise(const posed_rest *rest, unsigned seed, orb_sample *out) {
  static const double details[] = {1, 3, 6, 10};
  for (int attempt = 0; attempt < 14; attempt++) {
    orb_animal animal = rest->animal;
    double largest = 0, cell;
    for (int k = 0; k < 3; k++)
      largest = fmax(largest, animal.high[k] - animal.low[k]);
    cell = (0.95 + 0.002 * posed_random(&seed, 100) - 0.05 * (attempt / 2)) *
           /* finer if parts touch */ (largest > 2.6 ? 0.042 : 0.038);
    for (int k = 0; k < 3; k++)
      animal.low[k] -= 0.01 * cell * posed_random(&seed, 100);
    const int triangles = 5200 + 200 * (int)posed_random(&seed, 20);
    if (posed_random(&seed, 2))
      sample_surface_nets(&animal, cell, out);
    else
      sample_marching_tetrahedra(&animal, cell, out);
    if (!sample_fault(out)) {
      sample_smooth(&animal, out, 2 + (int)posed_random(&seed, 2));
      sample_decimate(&animal, out, details[posed_random(&seed, 4)], triangles);
      sample_smooth(&animal, out, 1 + (int)posed_random(&seed, 2));
      if (!sample_fault(out))
        return;
    }
    free(out->positions);
    free(out->triangles);
  }
  fprintf(stderr, "%s: no grid gives a closed surface of genus zero\n", rest->kind->animal->name);
  exit(1);
}
