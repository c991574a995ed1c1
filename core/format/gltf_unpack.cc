#include "format/gltf_unpack.hh"

#include <set>

extern "C" {
#include "format/gltf_document.h"
}

namespace gltf {

namespace {

bool has_extension(const cJSON *object, const char *name) {
  return member(member(object, "extensions"), name) != nullptr;
}

/* Takes a member out of an object. A malformed one may have several of the name, of which the first is read. */
void remove_member(cJSON *object, const char *name) {
  while (member(object, name)) {
    cJSON_DeleteItemFromObjectCaseSensitive(object, name);
  }
}

/* Takes an extension out of an object, and the object's list of them with the last one. */
void remove_extension(cJSON *object, const char *name) {
  while (has_extension(object, name)) {
    cJSON *list = editable(member(object, "extensions"));
    remove_member(list, name);
    if (!list->child) {
      cJSON_DeleteItemFromObjectCaseSensitive(object, "extensions");
    }
  }
}

struct Unpacker {
  orb_context *ctx;
  cJSON *doc;
  const Buffers &buffers;
  Editor *editor;
  std::set<int64_t> done; /* accessors that are plain now */

  cJSON *item(const char *list, int64_t index) const {
    return cJSON_GetArrayItem(member(doc, list), static_cast<int>(index));
  }

  /* The values as components of a type, `stride` bytes per element. */
  Packed::Octets bytes_of(const Packed::Values &values, int64_t type, bool normalized, size_t stride) const {
    const size_t size = static_cast<size_t>(component_size(type));
    const double most = component_most(type), least = type == 5120 || type == 5122 ? -most - 1 : 0;
    Packed::Octets out(values.list.size() / values.width * stride, 0, Charged<unsigned char>(ctx));
    for (size_t i = 0; i < values.list.size(); i++) {
      unsigned char *at = &out[i / values.width * stride + i % values.width * size];
      const double exact = normalized ? values.list[i] * most : values.list[i];
      const double value = normalized ? std::round(exact) : exact;
      if (type == ORB_GLTF_FLOAT) {
        const float number = static_cast<float>(values.list[i]);
        std::memcpy(at, &number, sizeof number);
        continue;
      }
      if (!(value >= least && value <= most) || value != std::floor(value) ||
          !(std::fabs(value - exact) < SHARE_ERROR)) {
        malformed("A compressed glTF primitive has values that its accessors cannot hold.");
      }
      const uint64_t number = static_cast<uint64_t>(static_cast<int64_t>(value));
      for (size_t b = 0; b < size; b++) { /* little-endian, two's complement */
        at[b] = static_cast<unsigned char>(number >> (8 * b) & 255);
      }
    }
    return out;
  }

  /* Bounds that a document gives are those before compression, which rounds. */
  static void bound(const Packed::Values &values, cJSON *accessor) {
    double low[4] = {INFINITY, INFINITY, INFINITY, INFINITY}, high[4] = {-INFINITY, -INFINITY, -INFINITY, -INFINITY};
    if (values.list.empty() || (!member(accessor, "min") && !member(accessor, "max"))) {
      return;
    }
    for (size_t i = 0; i < values.list.size(); i++) {
      low[i % values.width] = std::fmin(low[i % values.width], values.list[i]);
      high[i % values.width] = std::fmax(high[i % values.width], values.list[i]);
    }
    set(accessor, "min", cJSON_CreateDoubleArray(low, static_cast<int>(values.width)));
    set(accessor, "max", cJSON_CreateDoubleArray(high, static_cast<int>(values.width)));
  }

  void plain_accessor(int64_t index, bool is_attribute) {
    const Packed::Values *values = buffers.packed().accessor(index);
    if (!values || !done.insert(index).second) {
      return;
    }
    cJSON *accessor = item("accessors", index);
    const int64_t type = whole(accessor, "componentType", 0);
    if (static_cast<size_t>(whole(accessor, "count", 0)) != values->list.size() / values->width) {
      malformed("A compressed glTF primitive does not fit its accessors.");
    }
    const size_t tight = values->width * static_cast<size_t>(component_size(type));
    const size_t stride = is_attribute ? (tight + 3) / 4 * 4 : tight; /* glTF aligns the attributes of vertices */
    const bool normalized = is_normalized(accessor);
    const Packed::Octets bytes = bytes_of(*values, type, normalized, stride);
    const int64_t view = editor->add_view(bytes.data(), bytes.size(),
                                          is_attribute ? ORB_GLTF_ARRAY_BUFFER : ORB_GLTF_ELEMENT_ARRAY_BUFFER,
                                          stride == tight ? 0 : stride);
    static const char *const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"}; /* where the accessor says something else */
    set(accessor, "type", cJSON_CreateString(types[values->width - 1]));
    set(accessor, "bufferView", static_cast<double>(view));
    remove_member(accessor, "byteOffset");
    remove_member(accessor, "sparse"); /* not allowed beside Draco, and not read */
    if (!normalized) {
      bound(*values, accessor);
    }
  }

  void plain_primitive(cJSON *primitive) {
    if (!has_extension(primitive, DRACO)) {
      return;
    }
    const cJSON *attributes = member(primitive, "attributes");
    for (const cJSON *one = attributes ? attributes->child : nullptr; one; one = one->next) {
      plain_accessor(whole(attributes, one->string, NONE), true);
    }
    plain_accessor(whole(primitive, "indices", NONE), false);
    remove_extension(primitive, DRACO);
  }

  void plain_view(int64_t index, cJSON *view) {
    if (!has_extension(view, MESHOPT)) {
      return;
    }
    const Bytes bytes = buffers.view(index);
    set(view, "buffer", 0.0);
    set(view, "byteOffset", static_cast<double>(editor->add_bytes(bytes.at, bytes.size)));
    set(view, "byteLength", static_cast<double>(bytes.size));
    remove_extension(view, MESHOPT);
  }

  /* Buffers that stood for what is plain now have no bytes and no views. */
  void remove_fallbacks() const {
    cJSON *list = array_in(doc, "buffers");
    std::vector<int64_t> number; /* of each old buffer its new one */
    int64_t next = 0;
    for (cJSON *buffer = list->child; buffer;) {
      cJSON *after = buffer->next;
      const bool is_gone = is_fallback(buffer) && next > 0;
      number.push_back(next);
      next += !is_gone;
      if (is_gone) {
        cJSON_Delete(cJSON_DetachItemViaPointer(list, buffer));
      }
      buffer = after;
    }
    for (const cJSON *view : array_of(doc, "bufferViews")) {
      const int64_t buffer = whole(view, "buffer", NONE);
      if (buffer > 0 && buffer < static_cast<int64_t>(number.size())) {
        set(editable(view), "buffer", static_cast<double>(number[static_cast<size_t>(buffer)]));
      }
    }
  }

  /* Takes a name out of a list of the document, which must not be empty. */
  void remove_name(const char *list, const char *name) const {
    cJSON *names = editable(member(doc, list));
    for (cJSON *one = cJSON_IsArray(names) ? names->child : nullptr; one;) {
      cJSON *after = one->next;
      if (cJSON_IsString(one) && std::strcmp(one->valuestring, name) == 0) {
        cJSON_Delete(cJSON_DetachItemViaPointer(names, one));
      }
      one = after;
    }
    if (names && !names->child) {
      cJSON_DeleteItemFromObjectCaseSensitive(doc, list);
    }
  }

  void unpack() {
    const List meshes = array_of(doc, "meshes");
    for (size_t m = 0; m < meshes.size(); m++) {
      for (const cJSON *primitive : array_of(meshes[m], "primitives")) {
        blaming({culprit("meshes", meshes, m)}, [&] { plain_primitive(editable(primitive)); });
      }
    }
    const List views = array_of(doc, "bufferViews");
    for (size_t i = 0; i < views.size(); i++) {
      plain_view(static_cast<int64_t>(i), editable(views[i]));
    }
    remove_fallbacks();
    for (const char *name : {MESHOPT, DRACO}) {
      remove_name("extensionsUsed", name);
      remove_name("extensionsRequired", name);
    }
  }
};

}  // namespace

bool is_compressed(const cJSON *doc, const cJSON *mesh) {
  const List accessors = array_of(doc, "accessors"), views = array_of(doc, "bufferViews");
  const auto is_packed = [&](int64_t index) {
    if (index < 0 || index >= static_cast<int64_t>(accessors.size())) {
      return false;
    }
    const int64_t view = whole(accessors[static_cast<size_t>(index)], "bufferView", NONE);
    return view >= 0 && view < static_cast<int64_t>(views.size()) &&
           has_extension(views[static_cast<size_t>(view)], MESHOPT);
  };
  for (const cJSON *primitive : array_of(mesh, "primitives")) {
    const cJSON *attributes = member(primitive, "attributes");
    bool found = has_extension(primitive, DRACO) || is_packed(whole(primitive, "indices", NONE));
    for (const cJSON *one = attributes ? attributes->child : nullptr; one; one = one->next) {
      found = found || is_packed(whole(attributes, one->string, NONE));
    }
    if (found) {
      return true;
    }
  }
  return false;
}

void unpack(orb_context *ctx, cJSON *doc, const Buffers &buffers, Editor *editor) {
  Unpacker{ctx, doc, buffers, editor, {}}.unpack();
}

}  // namespace gltf
