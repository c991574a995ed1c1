/* The decoders of both methods stop twice: before the faces, whose number comes first, and before the values of the
 * attributes, once their sizes are known. */
#include "format/gltf_draco.hh"

#include <draco/compression/decode.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

namespace gltf {

namespace {

/* What Draco takes, in bytes: the largest table of its entropy coder (2^20 entries of 4 bytes), which a mesh of any
 * size may ask for; for each byte; for each face by either method, most of it in tables of corners, and for each face
 * and part of the attributes with seams of its own; and for each component of a value beside the value. Spheres of
 * 180,000 faces took 59 to 101 for each face beside their values, those of the sequential method up to 12. */
const size_t TABLE = 4u << 20, A_BYTE = 16, A_FACE = 64, A_SEAM = 24, A_LISTED_FACE = 24, A_COMPONENT = 8;

const size_t FACE = 3 * sizeof(uint32_t); /* of what is decoded */

/* Why a decoder has stopped. */
struct Bound {
  orb_context *ctx;
  const std::function<void(size_t)> &charge;
  std::vector<Counted<unsigned char>> &reserves;
  std::exception_ptr stopped; /* no exception passes through Draco, which may be compiled without them */

  void reserve(size_t bytes) {
    reserves.emplace_back(Charged<unsigned char>(ctx));
    reserves.back().reserve(bytes);
  }

  template <typename Ask>
  bool grants(Ask ask) {
    try {
      ask();
    } catch (...) {
      stopped = std::current_exception();
    }
    return !stopped;
  }

  /* Whether the file justifies so many decoded bytes, and whether there is room for what that takes. */
  bool justifies(size_t decoded) {
    return grants([&] { charge(decoded); });
  }
  bool has_room(size_t taken) {
    return grants([&] { reserve(taken); });
  }
};

size_t size_product(size_t a, size_t b) {
  return b != 0 && a > SIZE_MAX / 2 / b ? SIZE_MAX / 2 : a * b;
}

/* A number of the file: 32 bits in old versions. */
bool take_number(draco::DecoderBuffer *from, bool old, uint32_t *out) {
  return old ? from->Decode(out) : draco::DecodeVarint(out, from);
}

/* The number of faces, and of parts of the attributes with seams of their own, which an edgebreaker mesh begins with.
 */
bool peek_edgebreaker(draco::DecoderBuffer from, uint16_t version, uint32_t *faces, uint8_t *seams) {
  const bool old = version < DRACO_BITSTREAM_VERSION(2, 0);
  uint32_t vertices = 0;
  if (version < DRACO_BITSTREAM_VERSION(2, 2) && !take_number(&from, old, &vertices)) {
    return false; /* vertices that were made */
  }
  return take_number(&from, old, &vertices) && take_number(&from, old, faces) && from.Decode(seams);
}

bool peek_sequential(draco::DecoderBuffer from, uint16_t version, uint32_t *faces) {
  return take_number(&from, version < DRACO_BITSTREAM_VERSION(2, 2), faces);
}

template <class Method>
class Bounded : public Method {
 public:
  explicit Bounded(Bound *bound) : bound_(bound) {}

 protected:
  bool DecodeConnectivity() override {
    const bool breaks_edges = std::is_same<Method, draco::MeshEdgebreakerDecoder>::value;
    uint32_t faces = 0;
    uint8_t seams = 0;
    const bool read = breaks_edges ? peek_edgebreaker(*this->buffer(), this->bitstream_version(), &faces, &seams)
                                   : peek_sequential(*this->buffer(), this->bitstream_version(), &faces);
    const size_t each = breaks_edges ? A_FACE + A_SEAM * static_cast<size_t>(seams) : A_LISTED_FACE;
    return read && bound_->justifies(size_product(faces, FACE)) && bound_->has_room(size_product(faces, each)) &&
           Method::DecodeConnectivity();
  }

  bool DecodeAllAttributes() override {
    const draco::PointCloud *cloud = this->point_cloud();
    const size_t points = cloud->num_points();
    size_t taken = 0; /* 13 times what is justified at most, so the sum does not overflow */
    for (int32_t i = 0; i < cloud->num_attributes(); i++) {
      const draco::PointAttribute *one = cloud->attribute(i);
      const int32_t width = one->num_components(), length = draco::DataTypeLength(one->data_type());
      if (width < 1 || length < 1) {
        return false;
      }
      const size_t components = static_cast<size_t>(width), value = static_cast<size_t>(length);
      if (!bound_->justifies(size_product(points, components * value))) {
        return false;
      }
      taken += size_product(points, components * (value + A_COMPONENT) + sizeof(uint32_t));
    }
    return bound_->has_room(taken) && Method::DecodeAllAttributes();
  }

 private:
  Bound *bound_;
};

[[noreturn]] void refuse(const draco::Status &status) {
  malformed("A glTF primitive (KHR_draco_mesh_compression) cannot be decoded: " +
            status.error_msg_string().substr(0, 80));
}

template <class Method>
void decode_by(Bound *bound, draco::DecoderBuffer *buffer, draco::Mesh *out) {
  Bounded<Method> decoder(bound);
  const draco::Status status = decoder.Decode(draco::DecoderOptions(), buffer, out);
  if (bound->stopped) {
    std::rethrow_exception(bound->stopped);
  }
  if (!status.ok()) {
    refuse(status);
  }
}

}  // namespace

DracoMesh decode_draco(orb_context *ctx, Bytes bytes, const std::function<void(size_t)> &charge) {
  DracoMesh out{{}, std::make_unique<draco::Mesh>()};
  Bound bound{ctx, charge, out.reserves, nullptr};
  bound.reserve(TABLE + A_BYTE * bytes.size);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char *>(bytes.at), bytes.size);
  draco::DecoderBuffer head = buffer;
  draco::DracoHeader header;
  const draco::Status status = draco::PointCloudDecoder::DecodeHeader(&head, &header);
  if (!status.ok()) {
    refuse(status);
  }
  if (header.encoder_type != draco::TRIANGULAR_MESH) {
    malformed("A glTF primitive (KHR_draco_mesh_compression) is not a mesh.");
  }
  if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) {
    decode_by<draco::MeshEdgebreakerDecoder>(&bound, &buffer, out.mesh.get());
  } else if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
    decode_by<draco::MeshSequentialDecoder>(&bound, &buffer, out.mesh.get());
  } else {
    malformed("A glTF primitive (KHR_draco_mesh_compression) has an unknown method.");
  }
  return out;
}

}  // namespace gltf
