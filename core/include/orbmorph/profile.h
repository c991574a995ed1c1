/* Profiles of an asset: the same morph in fewer bytes. */
#ifndef ORBMORPH_PROFILE_H
#define ORBMORPH_PROFILE_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum orb_profile {
  ORB_PROFILE_FLOAT = 0, /* as orb_asset_write() writes it */
  ORB_PROFILE_QUANTIZED, /* KHR_mesh_quantization */
  ORB_PROFILE_MESHOPT,   /* QUANTIZED with EXT_meshopt_compression, without a fallback */
  ORB_PROFILES
} orb_profile;

/* The name on the wire, such as "quantized"; NULL if there is no such profile. */
ORB_API const char *orb_profile_name(orb_profile profile);

/* Bounds on what quantization changes. */
typedef struct orb_profile_facts {
  /* The largest distance between a vertex and its place in the float asset, at every weight from 0 to 1 of one target,
   * and at all weights of several targets whose sum is at most 1. In units of the asset; computed from the stored
   * values, with the rounding of float32 arithmetic that a renderer adds. */
  double position_error;
  /* position_error divided by the smallest bounding-box diagonal: of the base, and of each target at full weight. */
  double position_relative;
  /* The largest angle between a normal and that of the float asset, at every weight from 0 to 1 of one target; below 1.
   * 0 without normals. */
  double normal_degrees;
} orb_profile_facts;

/* Appends an asset of orb_asset_write() in another profile. The triangles and vertices come in another order, which is
 * better for the caches of vertices and for compression. The one node gets a scale and a translation, which map the
 * integer positions to coordinates. Equal assets give equal bytes.
 *
 * facts may be NULL. out NULL: computes only the facts.
 *
 * Errors: ORB_E_BAD_OPTION (ORB_PROFILE_FLOAT, or an asset of orb_asset_write_document()), ORB_E_CORRUPT (not such an
 * asset), ORB_E_TOO_LARGE, ORB_E_NO_MEMORY. O(V·N). */
ORB_API ORB_MUST_CHECK orb_status orb_profile_write(orb_context *ctx, const unsigned char *asset, size_t size,
                                                    orb_profile profile, orb_profile_facts *facts, orb_buffer *out);

#ifdef __cplusplus
}
#endif
#endif
