#include "remesh/registry.h"

#include <string.h>

static const struct {
  orb_remesh_fn run;
  const char *name;
  unsigned heeds;
} methods[] = {
#define ROW(id, function, name, heeds) {orb_remesh_##function, name, heeds},
    ORB_REMESH_METHODS(ROW)
#undef ROW
};

static int is_method(orb_remesh_method method) {
  return (unsigned)method < ORB_REMESH_METHOD_COUNT;
}

orb_remesh_fn orb_remesh_function(orb_remesh_method method) {
  return is_method(method) ? methods[method].run : NULL;
}

const char *orb_remesh_method_name(orb_remesh_method method) {
  return is_method(method) ? methods[method].name : NULL;
}

int orb_remesh_method_of_name(const char *name, orb_remesh_method *out) {
  for (int i = 0; i < ORB_REMESH_METHOD_COUNT; i++) {
    if (strcmp(methods[i].name, name) == 0) {
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
