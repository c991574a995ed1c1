/* What a material may have besides its base colour, metalness and roughness: a row for each member that glTF 2.0 and
 * its material extensions define. Reader, asset and writer follow from this list, whose order is the order in the
 * asset: members of glTF itself by name, then the extensions by name.
 *
 * MEMBER(id, extension, name, kind, low, high, needs)
 *   extension: "" for glTF itself; name: of the member, "" where the mere presence of the extension says something
 *   kind:      PRESENCE, NUMBER, COLOR (three numbers), COLOR4 (four), FLAG, MODE (alphaMode), TEXTURE
 *   low, high: limits of the numbers; of a texture, those of its "scale" or "strength" (0, 0: it has neither)
 *   needs:     TANGENTS where the texture bends normals or directions, else NOTHING
 *
 * Sources: glTF 2.0, 3.9 and 5.19; the README of each extension in KhronosGroup/glTF. */
#ifndef ORBMORPH_MATERIAL_MEMBERS_H
#define ORBMORPH_MATERIAL_MEMBERS_H

#define ORB_MATERIAL_ANY 1e30 /* instead of infinity, so that products stay finite in float32 too */

#define ORB_MATERIAL_MEMBERS(M)                                                                                        \
  M(ALPHA_CUTOFF, "", "alphaCutoff", NUMBER, 0, ORB_MATERIAL_ANY, NOTHING)                                             \
  M(ALPHA_MODE, "", "alphaMode", MODE, 0, 2, NOTHING)                                                                  \
  M(DOUBLE_SIDED, "", "doubleSided", FLAG, 0, 1, NOTHING)                                                              \
  M(EMISSIVE, "", "emissiveFactor", COLOR, 0, 1, NOTHING)                                                              \
  M(EMISSIVE_TEXTURE, "", "emissiveTexture", TEXTURE, 0, 0, NOTHING)                                                   \
  M(METALLIC_ROUGHNESS_TEXTURE, "", "metallicRoughnessTexture", TEXTURE, 0, 0, NOTHING)                                \
  M(NORMAL_TEXTURE, "", "normalTexture", TEXTURE, -ORB_MATERIAL_ANY, ORB_MATERIAL_ANY, TANGENTS)                       \
  M(OCCLUSION_TEXTURE, "", "occlusionTexture", TEXTURE, 0, 1, NOTHING)                                                 \
  M(ANISOTROPY_ROTATION, "KHR_materials_anisotropy", "anisotropyRotation", NUMBER, -ORB_MATERIAL_ANY,                  \
    ORB_MATERIAL_ANY, NOTHING)                                                                                         \
  M(ANISOTROPY, "KHR_materials_anisotropy", "anisotropyStrength", NUMBER, 0, 1, NOTHING)                               \
  M(ANISOTROPY_TEXTURE, "KHR_materials_anisotropy", "anisotropyTexture", TEXTURE, 0, 0, TANGENTS)                      \
  M(CLEARCOAT, "KHR_materials_clearcoat", "clearcoatFactor", NUMBER, 0, 1, NOTHING)                                    \
  M(CLEARCOAT_NORMAL_TEXTURE, "KHR_materials_clearcoat", "clearcoatNormalTexture", TEXTURE, -ORB_MATERIAL_ANY,         \
    ORB_MATERIAL_ANY, TANGENTS)                                                                                        \
  M(CLEARCOAT_ROUGHNESS, "KHR_materials_clearcoat", "clearcoatRoughnessFactor", NUMBER, 0, 1, NOTHING)                 \
  M(CLEARCOAT_ROUGHNESS_TEXTURE, "KHR_materials_clearcoat", "clearcoatRoughnessTexture", TEXTURE, 0, 0, NOTHING)       \
  M(CLEARCOAT_TEXTURE, "KHR_materials_clearcoat", "clearcoatTexture", TEXTURE, 0, 0, NOTHING)                          \
  M(DIFFUSE_TRANSMISSION_COLOR, "KHR_materials_diffuse_transmission", "diffuseTransmissionColorFactor", COLOR, 0, 1,   \
    NOTHING)                                                                                                           \
  M(DIFFUSE_TRANSMISSION_COLOR_TEXTURE, "KHR_materials_diffuse_transmission", "diffuseTransmissionColorTexture",       \
    TEXTURE, 0, 0, NOTHING)                                                                                            \
  M(DIFFUSE_TRANSMISSION, "KHR_materials_diffuse_transmission", "diffuseTransmissionFactor", NUMBER, 0, 1, NOTHING)    \
  M(DIFFUSE_TRANSMISSION_TEXTURE, "KHR_materials_diffuse_transmission", "diffuseTransmissionTexture", TEXTURE, 0, 0,   \
    NOTHING)                                                                                                           \
  M(DISPERSION, "KHR_materials_dispersion", "dispersion", NUMBER, 0, ORB_MATERIAL_ANY, NOTHING)                        \
  M(EMISSIVE_STRENGTH, "KHR_materials_emissive_strength", "emissiveStrength", NUMBER, 0, ORB_MATERIAL_ANY, NOTHING)    \
  M(IOR, "KHR_materials_ior", "ior", NUMBER, 1, ORB_MATERIAL_ANY, NOTHING)                                             \
  M(IRIDESCENCE, "KHR_materials_iridescence", "iridescenceFactor", NUMBER, 0, 1, NOTHING)                              \
  M(IRIDESCENCE_IOR, "KHR_materials_iridescence", "iridescenceIor", NUMBER, 1, ORB_MATERIAL_ANY, NOTHING)              \
  M(IRIDESCENCE_TEXTURE, "KHR_materials_iridescence", "iridescenceTexture", TEXTURE, 0, 0, NOTHING)                    \
  M(IRIDESCENCE_THICKNESS_MAX, "KHR_materials_iridescence", "iridescenceThicknessMaximum", NUMBER, 0,                  \
    ORB_MATERIAL_ANY, NOTHING)                                                                                         \
  M(IRIDESCENCE_THICKNESS_MIN, "KHR_materials_iridescence", "iridescenceThicknessMinimum", NUMBER, 0,                  \
    ORB_MATERIAL_ANY, NOTHING)                                                                                         \
  M(IRIDESCENCE_THICKNESS_TEXTURE, "KHR_materials_iridescence", "iridescenceThicknessTexture", TEXTURE, 0, 0, NOTHING) \
  M(SPECULAR_GLOSSINESS, "KHR_materials_pbrSpecularGlossiness", "", PRESENCE, 0, 0, NOTHING)                           \
  M(DIFFUSE, "KHR_materials_pbrSpecularGlossiness", "diffuseFactor", COLOR4, 0, 1, NOTHING)                            \
  M(DIFFUSE_TEXTURE, "KHR_materials_pbrSpecularGlossiness", "diffuseTexture", TEXTURE, 0, 0, NOTHING)                  \
  M(GLOSSINESS, "KHR_materials_pbrSpecularGlossiness", "glossinessFactor", NUMBER, 0, 1, NOTHING)                      \
  M(GLOSSY_SPECULAR, "KHR_materials_pbrSpecularGlossiness", "specularFactor", COLOR, 0, 1, NOTHING)                    \
  M(SPECULAR_GLOSSINESS_TEXTURE, "KHR_materials_pbrSpecularGlossiness", "specularGlossinessTexture", TEXTURE, 0, 0,    \
    NOTHING)                                                                                                           \
  M(SHEEN_COLOR, "KHR_materials_sheen", "sheenColorFactor", COLOR, 0, 1, NOTHING)                                      \
  M(SHEEN_COLOR_TEXTURE, "KHR_materials_sheen", "sheenColorTexture", TEXTURE, 0, 0, NOTHING)                           \
  M(SHEEN_ROUGHNESS, "KHR_materials_sheen", "sheenRoughnessFactor", NUMBER, 0, 1, NOTHING)                             \
  M(SHEEN_ROUGHNESS_TEXTURE, "KHR_materials_sheen", "sheenRoughnessTexture", TEXTURE, 0, 0, NOTHING)                   \
  M(SPECULAR_COLOR, "KHR_materials_specular", "specularColorFactor", COLOR, 0, ORB_MATERIAL_ANY, NOTHING)              \
  M(SPECULAR_COLOR_TEXTURE, "KHR_materials_specular", "specularColorTexture", TEXTURE, 0, 0, NOTHING)                  \
  M(SPECULAR, "KHR_materials_specular", "specularFactor", NUMBER, 0, 1, NOTHING)                                       \
  M(SPECULAR_TEXTURE, "KHR_materials_specular", "specularTexture", TEXTURE, 0, 0, NOTHING)                             \
  M(TRANSMISSION, "KHR_materials_transmission", "transmissionFactor", NUMBER, 0, 1, NOTHING)                           \
  M(TRANSMISSION_TEXTURE, "KHR_materials_transmission", "transmissionTexture", TEXTURE, 0, 0, NOTHING)                 \
  M(UNLIT, "KHR_materials_unlit", "", PRESENCE, 0, 0, NOTHING)                                                         \
  M(ATTENUATION_COLOR, "KHR_materials_volume", "attenuationColor", COLOR, 0, 1, NOTHING)                               \
  M(ATTENUATION_DISTANCE, "KHR_materials_volume", "attenuationDistance", NUMBER, 1e-30, ORB_MATERIAL_ANY, NOTHING)     \
  M(THICKNESS, "KHR_materials_volume", "thicknessFactor", NUMBER, 0, ORB_MATERIAL_ANY, NOTHING)                        \
  M(THICKNESS_TEXTURE, "KHR_materials_volume", "thicknessTexture", TEXTURE, 0, 0, NOTHING)

#endif
