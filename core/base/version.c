#include "orbmorph/version.h"

#define TEXT_OF(number) #number
#define TEXT(number) TEXT_OF(number)

const char *orb_version(void) {
  return TEXT(ORB_VERSION_MAJOR) "." TEXT(ORB_VERSION_MINOR) "." TEXT(ORB_VERSION_PATCH);
}
