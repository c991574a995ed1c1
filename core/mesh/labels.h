/* Labels of edges, by which walks that divide a surface are told from others. */
#ifndef ORB_MESH_LABELS_H
#define ORB_MESH_LABELS_H

#include "mesh/dijkstra.h"

/* Gives each half-edge of a closed surface in one piece a label, and its twin the same: the XOR of the labels along a
 * closed walk depends on the walk's homology class only, and is 0 where the walk divides the surface or is
 * contractible. A class that is not 0 has the label 0 with a chance of 2⁻⁶⁴. Settles the vertices that edges of the
 * file reach from the first one, by paths whose labels are 0. *left: 2·genus half-edges, one for each generator of the
 * homology, which the paths do not use; the caller frees them, also after a failure. Edges with a face of the file are
 * left over rather than others. O(F log F). */
ORB_MUST_CHECK orb_status orb_labels_find(orb_dijkstra *p, int32_t **left, int32_t *left_count);

#endif
