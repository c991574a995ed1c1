/* The version of the library: of the headers as numbers, and of the library that runs as a string. */
#ifndef ORBMORPH_VERSION_H
#define ORBMORPH_VERSION_H

#include "orbmorph/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ORB_VERSION_MAJOR 1
#define ORB_VERSION_MINOR 0
#define ORB_VERSION_PATCH 0

/* One number to compare: #if ORB_VERSION >= 10200 for 1.2.0. */
#define ORB_VERSION (ORB_VERSION_MAJOR * 10000 + ORB_VERSION_MINOR * 100 + ORB_VERSION_PATCH)

/* The version of the library that the program is linked to, for example "1.0.0". A shared library may be newer than the
 * headers that the program was compiled with. */
ORB_API const char *orb_version(void);

#ifdef __cplusplus
}
#endif
#endif
