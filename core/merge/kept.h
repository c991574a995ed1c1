/* The format of alignments as bytes, which kept_write.c writes and kept_read.c reads. An aligned shape differs from the
 * given mesh by splits and edge flips, if at all: vertices of the given mesh keep their numbers, positions and sources,
 * and most triangles are the same.
 *
 *   char[8] "ORBALIGN", uint32 version, uint32 0x01020304 (byte order)
 *   int32 shapes, landmarks, found, followed; double energy; for each shape uint64[2] digests of the given positions
 *     and triangles
 *   int32 1, int32 part and double bend, clear, lead, confidence of the match, or 0
 *   int32 alternatives; for each double cost, int32 shape, int32 count, count × shapes places (int32 triangle,
 *     double[3])
 *   int32 suspects; for each int32 landmark, int32 shape, double share, double distance, its place
 *   int32 1 and double share of each landmark, or 0
 *   int32 rims; for each int32 shape, and for either side int32 hole, int32 edges, double length; double off
 *   found × shapes places, found × double[3] points, found × double confidence
 *   for each shape: int32 vertices, triangles, changed; double[3] point of each vertex; position and int32 source of
 *     each added vertex; the changed triangles, each with its number, corners, parent, source_triangle, material and
 * the attributes of its corners, where the mesh has them; int32 1 and the vertex of each landmark, or 0
 *
 * A triangle that is not listed is that of the given mesh, with itself as parent. */
#ifndef ORB_MERGE_KEPT_H
#define ORB_MERGE_KEPT_H

#include <string.h>

#include "base/hash.h"
#include "orbmorph/kept.h"

enum { ORB_KEPT_VERSION = 8, ORB_KEPT_BYTE_ORDER = 0x01020304 };
static const char orb_kept_magic[8] = {'O', 'R', 'B', 'A', 'L', 'I', 'G', 'N'};

/* A new member of the alignment must be written and read here, with a new ORB_KEPT_VERSION. */
_Static_assert(sizeof(void *) != 8 || sizeof(orb_alignment) == 152, "write and read the new member");
_Static_assert(sizeof(void *) != 8 || sizeof(orb_aligned_shape) == sizeof(orb_mesh) + sizeof(orb_certificate) + 24,
               "write and read the new member");

/* Tells meshes apart that have the same connectivity, such as one body in two poses. */
static inline void orb_kept_digest(const orb_mesh *mesh, uint64_t digest[2]) {
  static const uint64_t key[2] = {0x6f72626d6f727068, 0x616c69676e6d656e};
  digest[0] = orb_siphash13(key, mesh->positions, 3 * (size_t)mesh->vertex_count * sizeof *mesh->positions);
  digest[1] = orb_siphash13(key, mesh->triangles, 3 * (size_t)mesh->triangle_count * sizeof *mesh->triangles);
}

/* One array of a mesh with a fixed number of bytes per triangle. */
typedef struct orb_kept_column {
  void *data; /* NULL: the mesh has none */
  size_t size;
} orb_kept_column;

enum { ORB_KEPT_COLUMNS = 5 };
static inline void orb_kept_columns(const orb_mesh *mesh, orb_kept_column out[ORB_KEPT_COLUMNS]) {
  const orb_kept_column columns[ORB_KEPT_COLUMNS] = {{mesh->source_triangle, sizeof(int32_t)},
                                                     {mesh->material, sizeof(int32_t)},
                                                     {mesh->normals, 9 * sizeof(float)},
                                                     {mesh->texcoords, 6 * sizeof(float)},
                                                     {mesh->colors, 12 * sizeof(float)}};
  memcpy(out, columns, sizeof columns);
}

#endif
