/* Compressed parts of a glTF document: EXT_meshopt_compression (buffer views) and KHR_draco_mesh_compression
 * (primitives). */
#ifndef ORB_FORMAT_GLTF_PACKED_HH
#define ORB_FORMAT_GLTF_PACKED_HH

#include <functional>
#include <map>

#include "format/gltf_draco.hh"
#include "format/gltf_values.hh"

namespace gltf {

/* The names of the two extensions. */
inline constexpr char MESHOPT[] = "EXT_meshopt_compression", DRACO[] = "KHR_draco_mesh_compression";

/* The largest value of a component, which a normalized one calls 1; 1 for floats. */
double component_most(int64_t type);

/* Whether an accessor's integers are shares of the largest one. glTF allows that for those of 8 and 16 bits; elsewhere
 * `normalized` says nothing. */
bool is_normalized(const cJSON *accessor);

/* Bounds the rounding of an integer of 16 bits whose share of the largest value has been a 32-bit float. */
const double SHARE_ERROR = 1.0 / 64;

class Packed {
 public:
  using Octets = Counted<unsigned char>;

  /* What an accessor of a compressed primitive holds; normalized components as fractions. */
  struct Values {
    Numbers list;
    size_t width;
  };

  /* What is decoded counts in the budget of the context. */
  explicit Packed(orb_context *ctx) : ctx_(ctx) {}

  /* Decodes everything that is compressed. view(i) gives the bytes of a buffer view that is not; buffer(i) those of a
   * buffer. file_size bounds what is decoded. */
  void load(const cJSON *doc, const std::function<Bytes(int64_t)> &buffer, const std::function<Bytes(int64_t)> &view,
            size_t file_size);

  /* NULL if the view or accessor is not compressed. */
  const Octets *view(int64_t index) const;
  const Values *accessor(int64_t index) const;

 private:
  void load_view(int64_t index, const cJSON *extension, Bytes bytes);
  void load_primitives(const cJSON *doc, const std::function<Bytes(int64_t)> &view);
  void load_primitive(const List &accessors, const cJSON *primitive, const cJSON *extension, const draco::Mesh &mesh);
  const draco::Mesh &mesh_of(int64_t view, Bytes bytes);
  void charge(size_t bytes);
  static void spend(size_t *left, size_t bytes);

  orb_context *ctx_;
  std::map<int64_t, Octets> views_;
  std::map<int64_t, Values> accessors_;
  std::map<int64_t, DracoMesh> meshes_; /* of views that primitives still have to load */
  size_t left_ = 0;                     /* bytes of views and accessors that may still be decoded */
  size_t decoded_left_ = 0;             /* the same of Draco's meshes, before their values become those of accessors */
};

/* Whether a buffer stands for the uncompressed data only and has no bytes. */
bool is_fallback(const cJSON *buffer);

}  // namespace gltf

#endif
