/* Which of many cycles leave the surface connected. */
#ifndef ORB_MESH_APART_H
#define ORB_MESH_APART_H

#include "mesh/cycles.h"

/* Keeps as many cycles as possible such that a cut along all of them leaves the surface connected; drops the longest
 * first. The cycles are simple, shortest first, and share no vertex; the surface is closed and in one piece. O(F +
 * total length). */
ORB_MUST_CHECK orb_status orb_cycles_apart(orb_surface *surface, orb_cycles *cycles);

#endif
