#include "format/gltf_accessor.hh"

extern "C" {
#include "format/bytes.h"
}

namespace gltf {

namespace {

const size_t STRIDE_MAX = 1u << 20;       /* bytes between elements that are accepted; glTF itself allows 252 at most */
const size_t ELEMENTS_A_CHECK = 1u << 20; /* elements between two checks for cancellation */

/* Components that may be decoded in all: exporters let 50 primitives share an accessor, not a thousand. */
const size_t WORK_PER_BYTE = 32, WORK_OF_ANY = 4u << 20;

double component(const unsigned char *p, int64_t type, bool normalized) {
  switch (type) {
    case 5120: {
      double value = static_cast<signed char>(*p);
      return normalized ? std::fmax(value / 127, -1) : value;
    }
    case 5121:
      return normalized ? *p / 255.0 : *p;
    case 5122: {
      double value = static_cast<int16_t>(orb_read_u16(p, 0));
      return normalized ? std::fmax(value / 32767, -1) : value;
    }
    case 5123:
      return normalized ? orb_read_u16(p, 0) / 65535.0 : orb_read_u16(p, 0);
    case 5125:
      return orb_read_u32(p, 0);
    default:
      return orb_read_f32(p, 0);
  }
}

}  // namespace

int component_size(int64_t type) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      malformed("A glTF accessor has an unknown component type.");
  }
}

void Buffers::spend(size_t work) const {
  if (work > work_left_) {
    throw Fault{ORB_E_TOO_LARGE,
                "The glTF file uses its accessors so often that reading it takes more work than its "
                "size justifies; export each mesh once."};
  }
  work_left_ -= work;
}

void Buffers::load(const cJSON *doc, Bytes chunk, size_t file_size) {
  file_size_ = file_size;
  work_left_ = WORK_PER_BYTE * file_size + WORK_OF_ANY;
  accessors_ = array_of(doc, "accessors");
  views_ = array_of(doc, "bufferViews");
  for (const cJSON *buffer : array_of(doc, "buffers")) {
    if (!cJSON_IsObject(buffer)) {
      malformed("A glTF buffer is not an object.");
    }
    size_t length = static_cast<size_t>(whole(buffer, "byteLength", 0));
    std::string uri = text_of(buffer, "uri");
    Bytes bytes;
    if (uri.empty()) {
      bytes = buffers_.empty() ? chunk : Bytes();
    } else if (uri.compare(0, 5, "data:") == 0) {
      decoded_.push_back(decode_uri(uri));
      bytes = Bytes{decoded_.back().data(), decoded_.back().size()};
    } else {
      malformed("The glTF file keeps its data in another file (" + uri.substr(0, 80) +
                "); send a GLB, or a glTF file with embedded data.");
    }
    if (uri.empty() && is_fallback(buffer)) {
      buffers_.push_back(Bytes()); /* its views are compressed */
      continue;
    }
    if (bytes.size < length) {
      malformed("A glTF buffer announces " + std::to_string(length) + " bytes but has " + std::to_string(bytes.size) +
                ".");
    }
    bytes.size = length;
    buffers_.push_back(bytes);
  }
  packed_.load(
      doc, [&](int64_t index) { return buffer(index); }, [&](int64_t index) { return view(index); }, file_size);
}

Bytes Buffers::view(int64_t index) const {
  const cJSON *v = element(views_, index, "buffer view");
  if (const Packed::Octets *bytes = packed_.view(index)) {
    return Bytes{bytes->data(), bytes->size()};
  }
  int64_t buffer = whole(v, "buffer", NONE);
  if (buffer < 0 || buffer >= static_cast<int64_t>(buffers_.size())) {
    malformed("A glTF buffer view refers to a missing buffer.");
  }
  const Bytes &bytes = buffers_[static_cast<size_t>(buffer)];
  size_t offset = static_cast<size_t>(whole(v, "byteOffset", 0));
  size_t length = static_cast<size_t>(whole(v, "byteLength", 0));
  if (offset > bytes.size || length > bytes.size - offset) {
    malformed("A glTF buffer view reaches beyond its buffer.");
  }
  return Bytes{bytes.at + offset, length};
}

/* Reads `count` elements of `width` components from a view into `out`. */
void Buffers::read_elements(int64_t view_index, size_t offset, size_t stride, int64_t type, bool normalized,
                            size_t count, size_t width, Numbers &out) const {
  size_t size = static_cast<size_t>(component_size(type)), packed = size * width;
  if (count == 0) {
    return;
  }
  Bytes bytes = view(view_index);
  stride = stride ? stride : packed;
  if (offset > bytes.size || packed > bytes.size - offset || stride > STRIDE_MAX ||
      (count - 1) > (bytes.size - offset - packed) / stride) {
    malformed("A glTF accessor reaches beyond its buffer view.");
  }
  spend(count * width);
  out.resize(count * width);
  for (size_t i = 0; i < count; i++) {
    if (i % ELEMENTS_A_CHECK == 0) {
      must(orb_context_check(ctx_));
    }
    const unsigned char *p = bytes.at + offset + i * stride;
    for (size_t k = 0; k < width; k++) {
      out[i * width + k] = component(p + k * size, type, normalized);
    }
  }
}

void Buffers::apply_sparse(const cJSON *sparse, int64_t type, bool normalized, size_t count, size_t width,
                           Numbers &out) const {
  const cJSON *indices = member(sparse, "indices"), *values = member(sparse, "values");
  size_t changed = static_cast<size_t>(whole(sparse, "count", 0));
  Numbers where{Charged<double>(ctx_)}, what{Charged<double>(ctx_)};
  read_elements(whole(indices, "bufferView", NONE), static_cast<size_t>(whole(indices, "byteOffset", 0)), 0,
                whole(indices, "componentType", 0), false, changed, 1, where);
  read_elements(whole(values, "bufferView", NONE), static_cast<size_t>(whole(values, "byteOffset", 0)), 0, type,
                normalized, changed, width, what);
  for (size_t i = 0; i < changed; i++) {
    if (!(where[i] >= 0 && where[i] < static_cast<double>(count))) {
      malformed("A sparse glTF accessor changes an element that it does not have.");
    }
    for (size_t k = 0; k < width; k++) {
      out[static_cast<size_t>(where[i]) * width + k] = what[i * width + k];
    }
  }
}

Numbers Buffers::accessor(int64_t index, size_t *width) const {
  const cJSON *a = element(accessors_, index, "accessor");
  if (const Packed::Values *values = packed_.accessor(index)) {
    *width = values->width;
    return values->list;
  }
  std::string shape = text_of(a, "type");
  *width = shape == "SCALAR" ? 1
           : shape == "VEC2" ? 2
           : shape == "VEC3" ? 3
           : shape == "VEC4" ? 4
           : shape == "MAT4" ? 16
                             : 0;
  if (*width == 0) {
    malformed("A glTF accessor of a mesh has the type \"" + shape.substr(0, 16) + "\".");
  }
  int64_t type = whole(a, "componentType", 0), source = whole(a, "bufferView", NONE);
  size_t count = static_cast<size_t>(whole(a, "count", 0));
  bool normalized = is_normalized(a);
  Numbers out{Charged<double>(ctx_)};
  component_size(type);
  if (source == NONE) { /* zeros, which the sparse part changes */
    if (count > file_size_) {
      malformed("A glTF accessor announces more elements than the file could hold.");
    }
    spend(count * *width);
    out.assign(count * *width, 0);
  } else {
    const cJSON *v = element(views_, source, "buffer view");
    read_elements(source, static_cast<size_t>(whole(a, "byteOffset", 0)),
                  static_cast<size_t>(whole(v, "byteStride", 0)), type, normalized, count, *width, out);
  }
  const cJSON *sparse = member(a, "sparse");
  if (sparse) {
    apply_sparse(sparse, type, normalized, count, *width, out);
  }
  return out;
}

Numbers Buffers::attribute(const cJSON *primitive, const char *name, size_t count, size_t low, size_t high,
                           size_t *width) const {
  const cJSON *attributes = member(primitive, "attributes");
  int64_t index = whole(attributes, name, NONE);
  Numbers out{Charged<double>(ctx_)};
  if (index == NONE) {
    return out;
  }
  out = accessor(index, width);
  if (*width < low || *width > high || out.size() != count * *width) {
    malformed(std::string("The glTF attribute ") + name + " does not fit its POSITION.");
  }
  return out;
}

}  // namespace gltf
