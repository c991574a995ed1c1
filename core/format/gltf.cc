/* glTF and GLB through tinygltf: the one C++ file. */
#include "format/gltf.h"

extern "C" orb_status orb_gltf_read(orb_context *ctx, const unsigned char *, size_t, int, orb_mesh *) {
  return orb_fail(ctx, ORB_E_UNSUPPORTED, "glTF files are not read yet.");
}
