/* Mends the ends of limbs that a settled pose has crumpled (ends.h).
 *
 * What has crumpled does not open again by closest points, however it is turned. So each end begins anew as it was
 * given, rigid, where its wrist has come to lie and as that has turned, and also with some twists about the limb. From
 * each start it is registered by itself, with its own part of the other mesh, while what lies beyond the wrist stays.
 * The start that bends it least and leaves its normals most alike is kept, if it is clearly better than going on from
 * the pose as it is. */
#ifndef ORB_ELASTIC_MEND_H
#define ORB_ELASTIC_MEND_H

#include "elastic/registration.h"

/* Changes the pose of a registration that has settled. reach: that of its last round. An end with 600 vertices takes
 * about 0.05 s of one thread. On all threads, with the same result for any number of them. */
ORB_MUST_CHECK orb_status orb_registration_mend(orb_registration *r, double reach);

#endif
