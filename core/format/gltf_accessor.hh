/* The data of a glTF document: buffers, buffer views, accessors. Nothing is copied before its bytes are checked. */
#ifndef ORB_FORMAT_GLTF_ACCESSOR_HH
#define ORB_FORMAT_GLTF_ACCESSOR_HH

#include "format/gltf_packed.hh"

namespace gltf {

/* The bytes of a component. */
int component_size(int64_t type);

class Buffers {
 public:
  explicit Buffers(orb_context *ctx) : ctx_(ctx), packed_(ctx) {}

  /* chunk: the binary chunk of a GLB, which must outlive this; file_size: bounds what sparse accessors may announce,
   * and the work. */
  void load(const cJSON *doc, Bytes chunk, size_t file_size);

  Bytes view(int64_t index) const;

  /* The bytes of a buffer; none if there is no such buffer, or it stands for uncompressed data only. */
  Bytes buffer(int64_t index) const {
    return index >= 0 && index < static_cast<int64_t>(buffers_.size()) ? buffers_[static_cast<size_t>(index)] : Bytes();
  }

  const Packed &packed() const { return packed_; }

  /* Counts work: 1 is one component decoded. Refuses the file when it asks for more than its size justifies, which it
   * does by naming the same accessors over and over. */
  void spend(size_t work) const;

  /* All elements of an accessor as doubles, `width` components each; *width is set. */
  Numbers accessor(int64_t index, size_t *width) const;

  /* An attribute of a primitive, or an empty list; `low` to `high` components are accepted. */
  Numbers attribute(const cJSON *primitive, const char *name, size_t count, size_t low, size_t high,
                    size_t *width) const;

 private:
  void read_elements(int64_t view_index, size_t offset, size_t stride, int64_t type, bool normalized, size_t count,
                     size_t width, Numbers &out) const;
  void apply_sparse(const cJSON *sparse, int64_t type, bool normalized, size_t count, size_t width, Numbers &out) const;

  orb_context *ctx_;
  size_t file_size_ = 0;
  mutable size_t work_left_ = 0;
  List accessors_, views_;
  std::vector<Bytes> buffers_;
  std::vector<std::vector<unsigned char>> decoded_;
  Packed packed_;
};

}  // namespace gltf

#endif
