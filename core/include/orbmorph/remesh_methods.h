/* The remesh methods, one row each: the identifier in C, the end of the name of its function in core, the name in
 * requests, options and reports, and the options that it uses (bits of orb_remesh_heeds()). The enumeration
 * orb_remesh_method, the registry in core and the words that requests take follow from this list, in this order.
 *
 * Use: #define WORD(id, function, name, heeds) name, … ORB_REMESH_METHODS(WORD) */
#ifndef ORBMORPH_REMESH_METHODS_H
#define ORBMORPH_REMESH_METHODS_H

#define ORB_REMESH_METHODS(METHOD)                                                                    \
  METHOD(ADAPTIVE, adaptive, "adaptive", ORB_REMESH_HEEDS_TOLERANCE | ORB_REMESH_HEEDS_MAX_TRIANGLES) \
  METHOD(OVERLAY, overlay, "overlay", ORB_REMESH_HEEDS_MAX_TRIANGLES)                                 \
  METHOD(SUBDIVISION, subdivision, "subdivision", ORB_REMESH_HEEDS_MAX_TRIANGLES)                     \
  METHOD(CONVEX_HULL, convex_hull, "convex-hull", ORB_REMESH_HEEDS_MAX_TRIANGLES)                     \
  METHOD(TEMPLATE, template, "template", ORB_REMESH_HEEDS_MAX_TRIANGLES)

#endif
