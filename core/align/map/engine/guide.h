/* What a caller knows of the map it wants. */
#ifndef ORB_ALIGN_MAP_ENGINE_GUIDE_H
#define ORB_ALIGN_MAP_ENGINE_GUIDE_H

#include <stdint.h>

#include "embed/newton/hierarchy.h"
#include "orbmorph/status.h"

/* What the first spatial targets of a composed map follow. */
typedef enum orb_map_from {
  ORB_MAP_FROM_SPACE,   /* what fits best in space */
  ORB_MAP_FROM_MAP,     /* the map as given, which is roughly right */
  ORB_MAP_FROM_WALK,    /* none: a landmark walk alone, which is quick. Needs `both` */
  ORB_MAP_FROM_PINS,    /* none: the map as given is only released where it was pinned. For springs */
  ORB_MAP_FROM_SPRINGS, /* none: springs draw the map as given, even if that costs energy */
  ORB_MAP_FROM_COPY /* none: a decimated copy of the moving shape has its map already. The map as given is not used */
} orb_map_from;

/* Vertices of the two shapes that springs draw together. */
typedef struct orb_map_springs {
  int32_t count;
  int32_t *moving, *fixed;
  double *weight; /* stiffness, against an energy of 1 for an isometry and in radii of a ball of the shape's area */
} orb_map_springs;

/* A level of the moving shape and its map. */
typedef struct orb_map_level_map {
  int32_t count;
  const int32_t *vertex;     /* of the moving shape */
  const double *points;      /* of these vertices on the sphere; 3 each */
  orb_hierarchy **hierarchy; /* of the moving shape; one level of it has these vertices. It is taken over */
  int lets_go; /* soft landmarks were pinned on the copy, and the map must be free to leave where they have drawn it */
} orb_map_level_map;

/* What a run towards a target has led to. A bulk is the energy of a map with a low cap on each triangle
 * (params.energy.bulk). */
typedef struct orb_map_course {
  double first_bulk, bulk; /* after the first start, and at last */
  double loose;            /* the energy before the map is fitted in space, which costs energy and brings it nearer to
                              the truth; INFINITY: there is no map */
  int is_walked;           /* the first start is a landmark walk */
  int fits_part;           /* the map is drawn to where parts of the shapes fit (space/part.h): energies do not tell
                              how good it is */
  int is_beaten;           /* the first start does not beat what it must beat, or the rival, and is the last */
} orb_map_course;

/* What a first start must beat; otherwise it is the last, and so is one that leads to no map. A crumpled start does not
 * begin anew then. */
typedef struct orb_map_beat {
  double energy; /* of a walk; 0: nothing must be beaten */
  double bulk;   /* of a start from targets */
} orb_map_beat;

/* Asks the caller whether a start from targets that has led to a map of this energy is worth more work. The caller may
 * compose another map meanwhile. */
typedef struct orb_map_rival {
  orb_status (*ask)(void *user, double energy, int *goes_on); /* NULL: it goes on */
  void *user;
} orb_map_rival;

/* Fills the target of a guide while the run opens: both take about as long. It runs once, on a context of its own, and
 * writes nothing but the target. */
typedef struct orb_map_aim {
  orb_status (*fill)(orb_context *ctx, void *user); /* NULL: it is filled already */
  void *user;
} orb_map_aim;

/* What guides a composed map. */
typedef struct orb_map_guide {
  orb_map_from from;
  const double *target; /* NULL, or where each vertex of `moving` lies on the fixed shape, 3 per vertex in its space;
                           replaces registration in space with ORB_MAP_FROM_SPACE, and the shapes keep their places */
  orb_map_aim aim;      /* of the target */
  int keeps_angles;     /* the spheres do (sheet/even.h); then embeddings made on the way do as well, and the places of
                           the targets are smoothed */
  orb_map_beat beat;    /* with a target */
  int slides;           /* the map slides at the end (space/slide.h), also without a target */
  int fits_parts;       /* the landmarks may show that only parts of the shapes correspond (space/part.h) */
  orb_map_course *course; /* NULL, or set; the bulks with a target only */
  orb_map_rival rival;    /* with a target: asked if the first start leaves open which way is better */
  int walks_first; /* with a target and `both`: a walk is tried before the start from the targets, and in its place
                    where it leads to a map */
  int walks_early; /* with a target and `both`: if the first start leads to a poor map, a walk comes next, not last */
  orb_map_springs springs; /* with ORB_MAP_FROM_PINS, ORB_MAP_FROM_SPRINGS and ORB_MAP_FROM_COPY */
  orb_map_level_map copy;  /* with ORB_MAP_FROM_COPY */
} orb_map_guide;

#endif
