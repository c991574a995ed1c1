#include "remesh/registry.h"

#include <string.h>

#include "remesh/adaptive/adaptive.h"
#include "remesh/convex_hull.h"
#include "remesh/overlay/overlay.h"
#include "remesh/subdivision.h"

/* A method without a line here, or with NULL, is not in this build. */
static const struct {
  orb_remesh_fn run;
  unsigned heeds;
} methods[ORB_REMESH_METHOD_COUNT] = {
    [ORB_REMESH_ADAPTIVE] = {orb_remesh_adaptive, ORB_REMESH_HEEDS_TOLERANCE | ORB_REMESH_HEEDS_MAX_TRIANGLES},
    [ORB_REMESH_OVERLAY] = {orb_remesh_overlay, 0},
    [ORB_REMESH_SUBDIVISION] = {orb_remesh_subdivision, 0},
    [ORB_REMESH_CONVEX_HULL] = {orb_remesh_convex_hull, ORB_REMESH_HEEDS_MAX_TRIANGLES},
};

#define NAME(id, name) name,
static const char *const names[] = {ORB_REMESH_METHODS(NAME)};
#undef NAME

static int is_method(orb_remesh_method method) {
  return (unsigned)method < ORB_REMESH_METHOD_COUNT;
}

orb_remesh_fn orb_remesh_function(orb_remesh_method method) {
  return is_method(method) ? methods[method].run : NULL;
}

const char *orb_remesh_method_name(orb_remesh_method method) {
  return is_method(method) ? names[method] : NULL;
}

int orb_remesh_method_of_name(const char *name, orb_remesh_method *out) {
  for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
    if (strcmp(names[i], name) == 0) {
      *out = (orb_remesh_method)i;
      return 1;
    }
  }
  return 0;
}

int orb_remesh_available(orb_remesh_method method) {
  return orb_remesh_function(method) != NULL;
}

unsigned orb_remesh_heeds(orb_remesh_method method) {
  return is_method(method) ? methods[method].heeds : 0;
}
