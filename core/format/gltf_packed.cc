#include "format/gltf_packed.hh"

#include <meshoptimizer.h>

namespace gltf {

namespace {

/* Compressed meshes are 3 to 30 times smaller; a run of equal bytes may be much more. */
const size_t GROWTH_MAX = 200, SMALL = 1u << 20;

/* What looking up the members of a compressed primitive, and an attribute of its mesh, counts as, in bytes. */
const size_t LOOK_UP = 1024;

const cJSON *extension_of(const cJSON *object, const char *name) {
  return member(member(object, "extensions"), name);
}

Bytes part_of(const Bytes &bytes, size_t offset, size_t length) {
  if (offset > bytes.size || length > bytes.size - offset) {
    malformed("A compressed glTF buffer view reaches beyond its buffer.");
  }
  return Bytes{bytes.at + offset, length};
}

/* What an integer gives as a share, without the rounding of 32-bit floats; below -1 it is -1. */
double nearest_share(double value, double most) {
  const double whole = std::round(value * most);
  return std::fabs(value * most - whole) < SHARE_ERROR ? std::fmax(whole / most, -1) : value;
}

/* Calls use(primitive, its extension) for all primitives that Draco has compressed. */
template <typename Use>
void for_compressed(const cJSON *doc, Use use) {
  for (const cJSON *mesh : array_of(doc, "meshes")) {
    for (const cJSON *primitive : array_of(mesh, "primitives")) {
      if (const cJSON *extension = extension_of(primitive, DRACO)) {
        use(primitive, extension);
      }
    }
  }
}

}  // namespace

bool is_normalized(const cJSON *accessor) {
  const int64_t type = whole(accessor, "componentType", 0);
  return cJSON_IsTrue(member(accessor, "normalized")) && type >= 5120 && type <= 5123;
}

double component_most(int64_t type) {
  switch (type) {
    case 5120:
      return 127;
    case 5121:
      return 255;
    case 5122:
      return 32767;
    case 5123:
      return 65535;
    case 5125:
      return 4294967295.0;
    default:
      return 1;
  }
}

bool is_fallback(const cJSON *buffer) {
  return cJSON_IsTrue(member(extension_of(buffer, MESHOPT), "fallback"));
}

const Packed::Octets *Packed::view(int64_t index) const {
  auto found = views_.find(index);
  return found == views_.end() ? nullptr : &found->second;
}

const Packed::Values *Packed::accessor(int64_t index) const {
  auto found = accessors_.find(index);
  return found == accessors_.end() ? nullptr : &found->second;
}

void Packed::spend(size_t *left, size_t bytes) {
  if (bytes > *left) {
    throw Fault{ORB_E_TOO_LARGE, "The compressed glTF file holds more than its size justifies."};
  }
  *left -= bytes;
}

void Packed::charge(size_t bytes) {
  spend(&left_, bytes);
}

/* https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression */
void Packed::load_view(int64_t index, const cJSON *extension, Bytes bytes) {
  size_t count = static_cast<size_t>(whole(extension, "count", 0));
  size_t stride = static_cast<size_t>(whole(extension, "byteStride", 0));
  std::string mode = text_of(extension, "mode"), filter = text_of(extension, "filter");
  bool attributes = mode == "ATTRIBUTES";
  if (stride == 0 || stride > 256 || (attributes ? stride % 4 != 0 : stride != 2 && stride != 4) ||
      count > SIZE_MAX / 256) {
    malformed("A compressed glTF buffer view has a stride that is not valid.");
  }
  charge(count * stride);
  Octets out(count * stride, 0, Charged<unsigned char>(ctx_));
  int failed = 1;
  if (attributes) {
    failed = meshopt_decodeVertexBuffer(out.data(), count, stride, bytes.at, bytes.size);
  } else if (mode == "TRIANGLES" && count % 3 == 0) {
    failed = meshopt_decodeIndexBuffer(out.data(), count, stride, bytes.at, bytes.size);
  } else if (mode == "INDICES") {
    failed = meshopt_decodeIndexSequence(out.data(), count, stride, bytes.at, bytes.size);
  }
  if (failed) {
    malformed("A compressed glTF buffer view (EXT_meshopt_compression) cannot be decoded.");
  }
  if (attributes && filter == "OCTAHEDRAL" && (stride == 4 || stride == 8)) {
    meshopt_decodeFilterOct(out.data(), count, stride);
  } else if (attributes && filter == "QUATERNION" && stride == 8) {
    meshopt_decodeFilterQuat(out.data(), count, stride);
  } else if (attributes && filter == "EXPONENTIAL") {
    meshopt_decodeFilterExp(out.data(), count, stride);
  } else if (!filter.empty() && filter != "NONE") {
    malformed("A compressed glTF buffer view has an unknown filter (\"" + filter.substr(0, 16) + "\").");
  }
  views_.insert_or_assign(index, std::move(out));
}

/* The mesh of a view, which is kept for further primitives that have it. */
const draco::Mesh &Packed::mesh_of(int64_t view, Bytes bytes) {
  auto found = meshes_.find(view);
  if (found == meshes_.end()) {
    found = meshes_.emplace(view, decode_draco(ctx_, bytes, [this](size_t decoded) { spend(&decoded_left_, decoded); }))
                .first;
  }
  return *found->second.mesh;
}

/* https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_draco_mesh_compression */
void Packed::load_primitive(const List &accessors, const cJSON *primitive, const cJSON *extension,
                            const draco::Mesh &mesh) {
  const cJSON *attributes = member(primitive, "attributes"), *ids = member(extension, "attributes");
  for (const cJSON *id = cJSON_IsObject(ids) ? ids->child : nullptr; id; id = id->next) {
    charge(LOOK_UP);
    must(orb_context_check(ctx_));
    int64_t index = whole(attributes, id->string, NONE);
    const draco::PointAttribute *attribute =
        mesh.GetAttributeByUniqueId(static_cast<uint32_t>(whole(ids, id->string, 0)));
    if (index == NONE || !attribute) {
      malformed("A compressed glTF primitive lacks an attribute that it names.");
    }
    const cJSON *accessor = element(accessors, index, "accessor");
    size_t width = static_cast<size_t>(attribute->num_components()), points = mesh.num_points();
    if (static_cast<size_t>(whole(accessor, "count", 0)) != points || width < 1 || width > 4) {
      malformed("A compressed glTF primitive does not fit its accessors.");
    }
    if (attribute->data_type() == draco::DT_BOOL) { /* glTF has no such numbers, and Draco reads any byte as one */
      malformed("A compressed glTF primitive has an attribute of truth values, which glTF lacks.");
    }
    charge(points * width * sizeof(double));
    Values values{Numbers(points * width, 0, Charged<double>(ctx_)), width};
    /* Draco itself converts integers to fractions where its attribute is marked as normalized. */
    const int64_t type = whole(accessor, "componentType", 0);
    const bool is_share = is_normalized(accessor);
    const double unit = is_share && !attribute->normalized() ? component_most(type) : 1;
    for (size_t i = 0; i < points; i++) {
      float value[4] = {0, 0, 0, 0};
      auto at = attribute->mapped_index(draco::PointIndex(static_cast<uint32_t>(i)));
      if (!attribute->ConvertValue<float>(at, static_cast<int8_t>(width), value)) {
        malformed("A compressed glTF primitive has an attribute that is not numbers.");
      }
      for (size_t k = 0; k < width; k++) {
        const double number = static_cast<double>(value[k]) / unit;
        values.list[i * width + k] = is_share ? nearest_share(number, component_most(type)) : number;
      }
    }
    accessors_.insert_or_assign(index, std::move(values));
  }
  int64_t indices = whole(primitive, "indices", NONE);
  if (indices == NONE) {
    malformed("A compressed glTF primitive has no indices.");
  }
  charge(static_cast<size_t>(mesh.num_faces()) * 3 * sizeof(double));
  Values corners{Numbers(Charged<double>(ctx_)), 1};
  corners.list.reserve(static_cast<size_t>(mesh.num_faces()) * 3);
  for (uint32_t f = 0; f < mesh.num_faces(); f++) {
    for (draco::PointIndex corner : mesh.face(draco::FaceIndex(f))) {
      corners.list.push_back(corner.value());
    }
  }
  accessors_.insert_or_assign(indices, std::move(corners));
}

void Packed::load_primitives(const cJSON *doc, const std::function<Bytes(int64_t)> &view) {
  const List accessors = array_of(doc, "accessors");
  std::map<int64_t, size_t> uses; /* of each view, by primitives that are still to be loaded */
  for_compressed(doc, [&](const cJSON *, const cJSON *extension) { uses[whole(extension, "bufferView", NONE)]++; });
  for_compressed(doc, [&](const cJSON *primitive, const cJSON *extension) {
    const int64_t index = whole(extension, "bufferView", NONE);
    charge(LOOK_UP);
    load_primitive(accessors, primitive, extension, mesh_of(index, view(index)));
    if (--uses[index] == 0) {
      meshes_.erase(index);
    }
    must(orb_context_check(ctx_));
  });
}

void Packed::load(const cJSON *doc, const std::function<Bytes(int64_t)> &buffer,
                  const std::function<Bytes(int64_t)> &view, size_t file_size) {
  left_ = decoded_left_ = SMALL + GROWTH_MAX * file_size;
  const List views = array_of(doc, "bufferViews");
  for (size_t i = 0; i < views.size(); i++) {
    if (const cJSON *extension = extension_of(views[i], MESHOPT)) {
      Bytes whole_buffer = buffer(whole(extension, "buffer", NONE));
      Bytes bytes = part_of(whole_buffer, static_cast<size_t>(whole(extension, "byteOffset", 0)),
                            static_cast<size_t>(whole(extension, "byteLength", 0)));
      load_view(static_cast<int64_t>(i), extension, bytes);
    }
  }
  load_primitives(doc, view);
}

}  // namespace gltf
