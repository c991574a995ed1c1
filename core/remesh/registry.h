/* The remesh methods of this build. */
#ifndef ORB_REMESH_REGISTRY_H
#define ORB_REMESH_REGISTRY_H

#include "remesh/common/job.h"

/* The function of a method; NULL if the number is not a method. */
orb_remesh_fn orb_remesh_function(orb_remesh_method method);

#endif
