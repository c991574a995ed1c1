/* The decoders of both methods stop twice: before the faces, whose number comes first, and before the values of the
 * attributes, once their sizes are known. */
#include "format/gltf_draco.hh"

#include <draco/compression/decode.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include <algorithm>
#include <new>
#include <stdexcept>

extern "C" {
#include "base/context.h"
}

namespace gltf {

namespace {

/* What Draco takes, in bytes: the table of its entropy coder that an encoder makes for 20 bits at most, which a mesh of
 * any size may ask for; for each byte, of metadata and of what describes attributes; for each face and vertex by the
 * method that breaks edges, and for each face by the other one; for each face and vertex once more for each part of the
 * attributes with seams of its own; and for each component of a value beside the value. Measured: spheres of 180,000
 * faces, 59 to 101 for each face beside their values; isolated faces, whose vertices are six times as many, 93, and 123
 * for each part. */
const size_t TABLE = 4u << 20, A_BYTE = 40, A_FACE = 64, A_VERTEX = 24, A_LISTED_FACE = 48, A_SEAM_FACE = 8,
             A_SEAM_VERTEX = 44, A_COMPONENT = 8;

/* Attributes of a mesh; glTF uses few. Looking one up takes a step for each. */
const int32_t ATTRIBUTES_MOST = 256;

/* Symbols of the entropy coder of listed faces. Encoders use 18 bits at most. */
const uint32_t SYMBOLS_MOST = 1u << 18;

const size_t FACE = 3 * sizeof(uint32_t); /* of what is decoded */

/* Bytes that are taken for each that the file justifies. A sphere takes 5 for each decoded one; with seams in all 255
 * parts of its attributes, a small file that a fuzzer made took 35. */
const size_t TAKEN_MOST = 3;

/* What a decoder may take, and why it has stopped. */
struct Bound {
  orb_context *ctx;
  const std::function<void(size_t)> &charge;
  std::vector<Counted<unsigned char>> &reserves;
  std::exception_ptr stopped; /* the exception, which does not pass through Draco */
  size_t counted = 0;         /* bytes of the reserves */

  void reserve(size_t bytes) {
    reserves.emplace_back(Charged<unsigned char>(ctx));
    reserves.back().reserve(bytes);
    counted += bytes;
    orb_library_runs(ctx, counted);
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

  bool has_room(size_t taken) {
    return grants([&] { reserve(taken); });
  }
  /* Whether the file justifies so many decoded bytes and what that takes, and there is room for it. */
  bool justifies(size_t decoded, size_t taken) {
    return grants([&] { charge(std::max(decoded, taken / TAKEN_MOST)); }) && has_room(taken);
  }
};

size_t size_product(size_t a, size_t b) {
  return b != 0 && a > SIZE_MAX / 2 / b ? SIZE_MAX / 2 : a * b;
}

/* A number of the file: 32 bits in old versions. */
bool take_number(draco::DecoderBuffer *from, bool old, uint32_t *out) {
  return old ? from->Decode(out) : draco::DecodeVarint(out, from);
}

/* What a mesh begins with. */
struct Head {
  uint32_t vertices = 0, faces = 0;
  uint8_t seams = 0;    /* parts of the attributes with seams of their own */
  uint32_t symbols = 0; /* of the entropy coder of listed faces; 0: they have none */
};

/* By the method that breaks edges. */
bool peek_edgebreaker(draco::DecoderBuffer from, uint16_t version, Head *out) {
  const bool old = version < DRACO_BITSTREAM_VERSION(2, 0);
  if (version < DRACO_BITSTREAM_VERSION(2, 2) && !take_number(&from, old, &out->vertices)) {
    return false; /* vertices that were made */
  }
  return take_number(&from, old, &out->vertices) && take_number(&from, old, &out->faces) && from.Decode(&out->seams);
}

/* By the method that lists faces. The entropy coder has schemes; 1 is that of one table for all symbols. */
bool peek_sequential(draco::DecoderBuffer from, uint16_t version, Head *out) {
  const bool old = version < DRACO_BITSTREAM_VERSION(2, 2);
  uint8_t compressed = 0, scheme = 0, bits = 0;
  if (!take_number(&from, old, &out->faces) || !take_number(&from, old, &out->vertices) || !from.Decode(&compressed)) {
    return false;
  }
  if (compressed != 0 || !from.Decode(&scheme) || scheme != 1) { /* 0 is the code of compressed faces */
    return true;
  }
  return from.Decode(&bits) && take_number(&from, version < DRACO_BITSTREAM_VERSION(2, 0), &out->symbols);
}

template <class Method>
class Bounded : public Method {
 public:
  explicit Bounded(Bound *bound) : bound_(bound) {}

 protected:
  bool DecodeConnectivity() override {
    const bool breaks_edges = std::is_same<Method, draco::MeshEdgebreakerDecoder>::value;
    Head head;
    const bool read = breaks_edges ? peek_edgebreaker(*this->buffer(), this->bitstream_version(), &head)
                                   : peek_sequential(*this->buffer(), this->bitstream_version(), &head);
    const size_t faces = head.faces, seams = head.seams;
    const size_t vertices = std::min(static_cast<size_t>(head.vertices), 3 * faces); /* Draco refuses more */
    const size_t taken = breaks_edges ? size_product(faces, A_FACE + A_SEAM_FACE * seams) +
                                            size_product(vertices, A_VERTEX + A_SEAM_VERTEX * seams)
                                      : size_product(faces, A_LISTED_FACE);
    return read && head.symbols <= SYMBOLS_MOST && bound_->justifies(size_product(faces, FACE + 4 * seams), taken) &&
           Method::DecodeConnectivity();
  }

  /* Each of up to 255 decoders has a list as long as all attributes, each of which takes some bytes of the file. */
  bool DecodePointAttributes() override {
    draco::DecoderBuffer from = *this->buffer();
    uint8_t decoders = 0;
    return from.Decode(&decoders) &&
           bound_->has_room(size_product(decoders, static_cast<size_t>(from.remaining_size()))) &&
           Method::DecodePointAttributes();
  }

  bool DecodeAllAttributes() override {
    const draco::PointCloud *cloud = this->point_cloud();
    const size_t points = cloud->num_points();
    if (cloud->num_attributes() > ATTRIBUTES_MOST) {
      return false;
    }
    size_t decoded = 0, taken = 0; /* of 256 attributes of 255 components and 2^32 points at most: no sum overflows */
    for (int32_t i = 0; i < cloud->num_attributes(); i++) {
      const draco::PointAttribute *one = cloud->attribute(i);
      const int32_t width = one->num_components(), length = draco::DataTypeLength(one->data_type());
      if (width < 1 || length < 1) {
        return false;
      }
      const size_t components = static_cast<size_t>(width), value = static_cast<size_t>(length);
      decoded += size_product(points, components * value);
      taken += size_product(points, components * (value + A_COMPONENT) + sizeof(uint32_t));
    }
    return bound_->justifies(decoded, taken) && Method::DecodeAllAttributes();
  }

 private:
  Bound *bound_;
};

[[noreturn]] void refuse(const draco::Status &status) {
  malformed("A glTF primitive (KHR_draco_mesh_compression) cannot be decoded: " +
            status.error_msg_string().substr(0, 80));
}

/* What a decoded mesh takes. */
size_t size_of(const draco::Mesh &mesh) {
  size_t size = mesh.num_faces() * FACE;
  for (int32_t i = 0; i < mesh.num_attributes(); i++) {
    const draco::PointAttribute *one = mesh.attribute(i);
    size += mesh.num_points() * (static_cast<size_t>(one->byte_stride()) + sizeof(uint32_t));
  }
  return size;
}

template <class Method>
void decode_by(Bound *bound, draco::DecoderBuffer *buffer, draco::Mesh *out) {
  Bounded<Method> decoder(bound);
  draco::Status status;
  try {
    status = decoder.Decode(draco::DecoderOptions(), buffer, out);
  } catch (const std::length_error &) { /* of a container that cannot be so long: the memory does not exist, either */
    throw std::bad_alloc();
  } catch (const std::bad_alloc &) {
    if (orb_context_error(bound->ctx)->status == ORB_E_NO_MEMORY) { /* the meter has found no room in the budget */
      throw Passed{ORB_E_NO_MEMORY};
    }
    throw;
  }
  if (bound->stopped) {
    std::rethrow_exception(bound->stopped);
  }
  if (!status.ok()) {
    refuse(status);
  }
}

/* Draco runs as long as this lives. */
struct Running {
  orb_context *ctx;
  ~Running() { orb_library_ends(ctx); }
};

void decode(Bound *bound, Bytes bytes, draco::Mesh *out) {
  const Running running{bound->ctx};
  bound->reserve(TABLE + A_BYTE * bytes.size);
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
    decode_by<draco::MeshEdgebreakerDecoder>(bound, &buffer, out);
  } else if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
    decode_by<draco::MeshSequentialDecoder>(bound, &buffer, out);
  } else {
    malformed("A glTF primitive (KHR_draco_mesh_compression) has an unknown method.");
  }
}

}  // namespace

DracoMesh decode_draco(orb_context *ctx, Bytes bytes, const std::function<void(size_t)> &charge) {
  DracoMesh out{{}, std::make_unique<draco::Mesh>()};
  Bound bound{ctx, charge, out.reserves, nullptr};
  decode(&bound, bytes, out.mesh.get());
  out.reserves.clear(); /* the decoder has gone; what is left is the mesh */
  out.reserves.emplace_back(Charged<unsigned char>(ctx));
  out.reserves.back().reserve(size_of(*out.mesh));
  return out;
}

}  // namespace gltf
