/* Mesh files: reading OBJ, OFF, PLY, STL, 3MF and glTF/GLB from memory, and writing the binary sphere PLY.
 *
 * The content decides the format; a file name plays no part. Readers are linear in the size of the file, trust no count
 * of a header before the bytes are there, and allocate at most a small multiple of the file's size.
 */
#ifndef ORBMORPH_FORMAT_H
#define ORBMORPH_FORMAT_H

#include "orbmorph/formats.h"
#include "orbmorph/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ORB_FORMAT_OBJ = 1, …: see formats.h. */
typedef enum orb_format {
  ORB_FORMAT_AUTO = 0,
#define ORB_FORMAT_ID(id, value, function, name) ORB_FORMAT_##id = (value),
  ORB_FORMATS(ORB_FORMAT_ID)
#undef ORB_FORMAT_ID
} orb_format;

ORB_API const char *orb_format_name(orb_format format); /* "obj", … ; "auto" */

/* "obj" → ORB_FORMAT_OBJ; ORB_FORMAT_AUTO for an unknown name. */
ORB_API orb_format orb_format_of_name(const char *name);

/* The format of these bytes by their content; ORB_FORMAT_AUTO if it is none of them, such as FBX. */
ORB_API orb_format orb_format_detect(const unsigned char *bytes, size_t size);

/* Reads a mesh as it is in the file: polygons are cut into triangles, nothing else is repaired (see orb_mesh_repair()).
 * format AUTO detects the format. *format_out (may be NULL) receives the format that was read. Errors:
 * ORB_E_UNKNOWN_FORMAT, ORB_E_MALFORMED_MESH with line or offset, ORB_E_NOT_FINITE (also beyond ORB_COORDINATE_MAX),
 * ORB_E_TOO_LARGE, ORB_E_NO_MEMORY. */
ORB_API ORB_MUST_CHECK orb_status orb_mesh_read(orb_context *ctx, const unsigned char *bytes, size_t size,
                                                orb_format format, orb_mesh *out, orb_format *format_out);

/* Appends the binary little-endian PLY of a mesh and its sphere: per vertex double x,y,z, double px,py,pz, int source;
 * per face uchar int list vertex_indices. points: 3 per vertex. */
ORB_API ORB_MUST_CHECK orb_status orb_sphere_ply_write(orb_context *ctx, const orb_mesh *mesh, const double *points,
                                                       orb_buffer *out);

#ifdef __cplusplus
}
#endif
#endif
