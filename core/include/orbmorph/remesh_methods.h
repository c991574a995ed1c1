/* The list of remesh methods: the identifier in C, and the name in requests, options and reports. The enumeration
 * orb_remesh_method, orb_remesh_method_name() and the words that requests take are made from it, in this order.
 *
 * Use: #define WORD(id, name) name, … ORB_REMESH_METHODS(WORD) */
#ifndef ORBMORPH_REMESH_METHODS_H
#define ORBMORPH_REMESH_METHODS_H

#define ORB_REMESH_METHODS(METHOD)   \
  METHOD(ADAPTIVE, "adaptive")       \
  METHOD(OVERLAY, "overlay")         \
  METHOD(SUBDIVISION, "subdivision") \
  METHOD(CONVEX_HULL, "convex-hull")

#endif
