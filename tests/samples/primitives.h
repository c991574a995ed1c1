/* Short names for tables of primitives. PART(k, …) begins a part that joins the body over k; CONE(k, …) continues a
 * part. */
#ifndef ORB_SAMPLES_PRIMITIVES_H
#define ORB_SAMPLES_PRIMITIVES_H

#include "sample.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define PART(k, ax, ay, az, ra, bx, by, bz, rb)              \
  {                                                          \
    SAMPLE_CONE, 1, k, {ax, ay, az}, {bx, by, bz}, ra, rb, { \
      { 0 }                                                  \
    }                                                        \
  }
#define CONE(k, ax, ay, az, ra, bx, by, bz, rb)              \
  {                                                          \
    SAMPLE_CONE, 0, k, {ax, ay, az}, {bx, by, bz}, ra, rb, { \
      { 0 }                                                  \
    }                                                        \
  }
#define BALL(k, ax, ay, az, r)                         \
  {                                                    \
    SAMPLE_ELLIPSOID, 1, k, {ax, ay, az}, {0}, 0, 0, { \
      {r, 0, 0}, {0, r, 0}, {                          \
        0, 0, r                                        \
      }                                                \
    }                                                  \
  }
#define ELLIPSOID(begins, k, ax, ay, az, ...)               \
  {                                                         \
    SAMPLE_ELLIPSOID, begins, k, {ax, ay, az}, {0}, 0, 0, { \
      __VA_ARGS__                                           \
    }                                                       \
  }

/* An animal of the primitives kind_primitives, without features, whose box is still to be set. */
#define ANIMAL(kind)                                                           \
  {                                                                            \
#kind, kind##_primitives, COUNT(kind##_primitives), NULL, 0, {0, 0, 0 }, { \
      0, 0, 0                                                                  \
    }                                                                          \
  }

#endif
