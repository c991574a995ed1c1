/* The bytes of a glTF or GLB file as a JSON document and a binary chunk. */
#ifndef ORB_FORMAT_GLTF_PARSE_HH
#define ORB_FORMAT_GLTF_PARSE_HH

#include "format/gltf_values.hh"

namespace gltf {

/* cJSON parses the document; it copies no buffer and limits how deep values nest. The bytes must outlive it. */
class Document {
 public:
  Document(orb_context *ctx, const unsigned char *bytes, size_t size, bool binary);

  cJSON *root() const { return root_.get(); }
  Bytes chunk() const { return chunk_; }
  /* Bytes of a GLB after its binary chunk, which mean something to an unknown extension only. */
  size_t rest() const { return rest_; }

 private:
  Counted<char> reserve_;
  Bytes chunk_;
  size_t rest_ = 0;
  std::unique_ptr<cJSON, void (*)(cJSON *)> root_;
};

/* The error of the exception that is being handled. */
orb_status status_of_exception(orb_context *ctx, size_t size);

/* Runs `work` on a file of `size` bytes and turns its exceptions into the error of the context. No exception leaves it.
 */
template <typename Work>
orb_status guarded(orb_context *ctx, size_t size, const Work &work) {
  try {
    work();
  } catch (...) {
    return status_of_exception(ctx, size);
  }
  return ORB_OK;
}

}  // namespace gltf

#endif
