/* glTF and GLB: all triangle primitives of the default scene, positions after node transforms.
 *
 * cJSON parses the document; it copies no buffer and limits how deep values nest. Accessors are decoded in place, after
 * every offset has been checked against the bytes.
 *
 * Vertices are numbered over the triangle primitives of all meshes in file order, whether the scene shows them or not;
 * a mesh that is shown more than once gets further numbers after all of these. Errors inside are exceptions; all end in
 * read_either().
 */
#include <cjson/cJSON.h>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <vector>

extern "C" {
#include "base/error.h"
#include "format/bytes.h"
#include "format/json_check.h"
#include "format/readers.h"
#include "format/text.h"
#include "format/texture.h"
}

#include "format/gltf_values.hh"

namespace {

struct Reader {
  orb_context *ctx;
  size_t file_size;
  const cJSON *doc = nullptr;
  List accessors, views, meshes, image_list, textures, samplers;
  Bytes chunk; /* of a GLB */
  std::vector<Bytes> buffers;
  std::vector<std::vector<unsigned char>> decoded;
  orb_build build;
  std::vector<orb_image> images;     /* owned: the context's memory, passed to the mesh or freed */
  std::vector<int32_t> image_number; /* of each image of the file: its number in images, −1: none, −2: not yet known */
  size_t image_bytes = 0;

  Reader(orb_context *context, size_t size) : ctx(context), file_size(size) { orb_build_init(&build, ctx); }
  ~Reader() {
    orb_build_free(&build);
    for (orb_image &image : images) {
      orb_free(ctx, image.bytes);
    }
  }
  Reader(const Reader &) = delete;
  Reader &operator=(const Reader &) = delete;

  void load_buffers() {
    for (const cJSON *buffer : array_of(doc, "buffers")) {
      if (!cJSON_IsObject(buffer)) {
        malformed("A glTF buffer is not an object.");
      }
      size_t length = static_cast<size_t>(whole(buffer, "byteLength", 0));
      std::string uri = text_of(buffer, "uri");
      Bytes bytes;
      if (uri.empty()) {
        bytes = buffers.empty() ? chunk : Bytes();
      } else if (uri.compare(0, 5, "data:") == 0) {
        decoded.push_back(decode_uri(uri));
        bytes = Bytes{decoded.back().data(), decoded.back().size()};
      } else {
        malformed("The glTF file keeps its data in another file (" + uri.substr(0, 80) +
                  "); send a GLB, or a glTF file with embedded data.");
      }
      if (bytes.size < length) {
        malformed("A glTF buffer announces " + std::to_string(length) + " bytes but has " + std::to_string(bytes.size) +
                  ".");
      }
      bytes.size = length;
      buffers.push_back(bytes);
    }
  }

  Bytes view(int64_t index) const {
    const cJSON *v = element(views, index, "buffer view");
    int64_t buffer = whole(v, "buffer", NONE);
    if (buffer < 0 || buffer >= static_cast<int64_t>(buffers.size())) {
      malformed("A glTF buffer view refers to a missing buffer.");
    }
    const Bytes &bytes = buffers[static_cast<size_t>(buffer)];
    size_t offset = static_cast<size_t>(whole(v, "byteOffset", 0));
    size_t length = static_cast<size_t>(whole(v, "byteLength", 0));
    if (offset > bytes.size || length > bytes.size - offset) {
      malformed("A glTF buffer view reaches beyond its buffer.");
    }
    return Bytes{bytes.at + offset, length};
  }

  /* Reads `count` elements of `width` components from a view into `out`. */
  void read_elements(int64_t view_index, size_t offset, size_t stride, int64_t type, bool normalized, size_t count,
                     size_t width, std::vector<double> &out) const {
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
    out.resize(count * width);
    for (size_t i = 0; i < count; i++) {
      const unsigned char *p = bytes.at + offset + i * stride;
      for (size_t k = 0; k < width; k++) {
        out[i * width + k] = component(p + k * size, type, normalized);
      }
    }
  }

  void apply_sparse(const cJSON *sparse, int64_t type, bool normalized, size_t count, size_t width,
                    std::vector<double> &out) const {
    const cJSON *indices = member(sparse, "indices"), *values = member(sparse, "values");
    size_t changed = static_cast<size_t>(whole(sparse, "count", 0));
    std::vector<double> where, what;
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

  /* All elements of an accessor as doubles, `width` components each; *width is set. */
  std::vector<double> accessor(int64_t index, size_t *width) const {
    const cJSON *a = element(accessors, index, "accessor");
    std::string shape = text_of(a, "type");
    *width = shape == "SCALAR" ? 1 : shape == "VEC2" ? 2 : shape == "VEC3" ? 3 : shape == "VEC4" ? 4 : 0;
    if (*width == 0) {
      malformed("A glTF accessor of a mesh has the type \"" + shape.substr(0, 16) + "\".");
    }
    int64_t type = whole(a, "componentType", 0), source = whole(a, "bufferView", NONE);
    size_t count = static_cast<size_t>(whole(a, "count", 0));
    bool normalized = cJSON_IsTrue(member(a, "normalized"));
    std::vector<double> out;
    component_size(type);
    if (source == NONE) { /* zeros, which the sparse part changes */
      if (count > file_size) {
        malformed("A glTF accessor announces more elements than the file could hold.");
      }
      out.assign(count * *width, 0);
    } else {
      const cJSON *v = element(views, source, "buffer view");
      read_elements(source, static_cast<size_t>(whole(a, "byteOffset", 0)),
                    static_cast<size_t>(whole(v, "byteStride", 0)), type, normalized, count, *width, out);
    }
    const cJSON *sparse = member(a, "sparse");
    if (sparse) {
      apply_sparse(sparse, type, normalized, count, *width, out);
    }
    return out;
  }

  /* An attribute of a primitive, or an empty list; `low` to `high` components are accepted. */
  std::vector<double> attribute(const cJSON *primitive, const char *name, size_t count, size_t low, size_t high,
                                size_t *width) const {
    const cJSON *attributes = member(primitive, "attributes");
    int64_t index = whole(attributes, name, NONE);
    std::vector<double> out;
    if (index == NONE) {
      return out;
    }
    out = accessor(index, width);
    if (*width < low || *width > high || out.size() != count * *width) {
      malformed(std::string("The glTF attribute ") + name + " does not fit its POSITION.");
    }
    return out;
  }

  void add_triangle(int64_t base, int64_t a, int64_t b, int64_t c, bool mirrored) {
    int64_t corner[3] = {a, mirrored ? c : b, mirrored ? b : c};
    for (int64_t index : corner) {
      must(orb_build_corner(&build, orb_corner{static_cast<int32_t>(base + index), -1, -1}, 0));
    }
    must(orb_build_face_end(&build, 3));
  }

  std::vector<double> indices_of(const cJSON *primitive, size_t vertices) const {
    int64_t index = whole(primitive, "indices", NONE);
    std::vector<double> out;
    if (index == NONE) {
      out.resize(vertices);
      for (size_t i = 0; i < vertices; i++) {
        out[i] = static_cast<double>(i);
      }
      return out;
    }
    size_t width = 0;
    out = accessor(index, &width);
    for (double value : out) {
      if (width != 1 || !(value >= 0 && value < static_cast<double>(vertices)) || value != std::floor(value)) {
        malformed("A glTF primitive names vertex " + std::to_string(value) + " of " + std::to_string(vertices) + ".");
      }
    }
    return out;
  }

  void add_faces(const cJSON *primitive, int64_t mode, int64_t base, size_t vertices, bool mirrored) {
    std::vector<double> index = indices_of(primitive, vertices);
    build.material = static_cast<int32_t>(whole(primitive, "material", NONE));
    if (build.material >= static_cast<int32_t>(build.material_count)) {
      malformed("A glTF primitive refers to a missing material.");
    }
    auto at = [&](size_t i) { return static_cast<int64_t>(index[i]); };
    if (mode == 4) {
      if (index.size() % 3 != 0) {
        malformed("A glTF primitive of triangles has a number of corners that is not a multiple of three.");
      }
      for (size_t i = 0; i + 2 < index.size(); i += 3) {
        add_triangle(base, at(i), at(i + 1), at(i + 2), mirrored);
      }
      return;
    }
    for (size_t i = 0; i + 2 < index.size(); i++) {
      int64_t a = mode == 5 ? at(i) : at(i + 1), b = mode == 5 ? at(i + 1 + i % 2) : at(i + 2),
              c = mode == 5 ? at(i + 2 - i % 2) : at(0);
      if (a != b && b != c && c != a) { /* strips repeat corners to change direction */
        add_triangle(base, a, b, c, mirrored);
      }
    }
  }

  /* Adds the vertices of a primitive, and its faces if it is shown. */
  void add_primitive(const cJSON *primitive, const Matrix &matrix, bool shown, bool normals, bool texcoords) {
    int64_t mode = whole(primitive, "mode", 4);
    if (mode < 4 || mode > 6 || whole(member(primitive, "attributes"), "POSITION", NONE) == NONE) {
      return;
    }
    size_t width = 0;
    std::vector<double> position = accessor(whole(member(primitive, "attributes"), "POSITION", NONE), &width);
    if (width != 3) {
      malformed("The glTF attribute POSITION does not have three components.");
    }
    size_t count = position.size() / 3, color_width = 0;
    if (static_cast<size_t>(build.vertices) + count > 2 * file_size + 1024 ||
        static_cast<size_t>(build.triangles) > 2 * file_size + 1024) {
      throw Fault{ORB_E_TOO_LARGE,
                  "The glTF file shows its meshes so often that they need more memory than the file justifies."};
    }
    std::vector<double> normal = attribute(primitive, "NORMAL", count, 3, 3, &width);
    std::vector<double> texcoord = attribute(primitive, "TEXCOORD_0", count, 2, 2, &width);
    std::vector<double> color = attribute(primitive, "COLOR_0", count, 3, 4, &color_width);
    int64_t base = build.vertices;
    for (size_t i = 0; i < count; i++) {
      double p[3], n[3] = {0, 0, 0}, uv[2] = {0, 0};
      matrix.point(&position[3 * i], p);
      must(orb_build_vertex(&build, p));
      if (normals) {
        if (!normal.empty()) {
          matrix.normal(&normal[3 * i], n);
        }
        must(orb_build_normal(&build, n));
      }
      if (texcoords) {
        must(orb_build_texcoord(&build, texcoord.empty() ? uv : &texcoord[2 * i]));
      }
      if (!color.empty()) {
        must(orb_build_color(&build, &color[color_width * i], static_cast<int>(color_width)));
      }
    }
    if (shown) {
      add_faces(primitive, mode, base, count, matrix.determinant() < 0);
    }
  }

  /* Whether any triangle primitive has this attribute: then all get it. */
  bool any_has(const char *name) const {
    for (const cJSON *mesh : meshes) {
      for (const cJSON *primitive : array_of(mesh, "primitives")) {
        if (member(member(primitive, "attributes"), name)) {
          return true;
        }
      }
    }
    return false;
  }

  /* Mesh number and matrix of each node of the scene that shows a mesh, in depth-first order from the roots. */
  std::vector<std::pair<int64_t, Matrix>> instances() const {
    const List nodes = array_of(doc, "nodes"), scenes = array_of(doc, "scenes");
    std::vector<std::pair<int64_t, Matrix>> stack, out;
    if (!scenes.empty()) {
      const cJSON *scene = element(scenes, whole(doc, "scene", 0), "scene");
      for (const cJSON *root : array_of(scene, "nodes")) {
        stack.emplace_back(number_of(root), Matrix());
      }
    } else if (!nodes.empty()) {
      std::vector<bool> is_child(nodes.size(), false);
      for (const cJSON *node : nodes) {
        for (const cJSON *child : array_of(node, "children")) {
          int64_t index = number_of(child);
          if (index < static_cast<int64_t>(nodes.size())) {
            is_child[static_cast<size_t>(index)] = true;
          }
        }
      }
      for (size_t i = 0; i < nodes.size(); i++) {
        if (!is_child[i]) {
          stack.emplace_back(static_cast<int64_t>(i), Matrix());
        }
      }
    } else {
      for (size_t i = 0; i < meshes.size(); i++) {
        out.emplace_back(static_cast<int64_t>(i), Matrix());
      }
    }
    std::vector<bool> seen(nodes.size(), false);
    std::reverse(stack.begin(), stack.end());
    while (!stack.empty()) {
      auto [index, above] = stack.back();
      stack.pop_back();
      const cJSON *node = element(nodes, index, "node");
      if (seen[static_cast<size_t>(index)]) {
        malformed("Node " + std::to_string(index) + " of the glTF file is a child of two nodes, or of itself.");
      }
      seen[static_cast<size_t>(index)] = true;
      Matrix matrix = above * matrix_of(node);
      int64_t mesh = whole(node, "mesh", NONE);
      if (mesh != NONE) {
        out.emplace_back(mesh, matrix);
      }
      const List children = array_of(node, "children");
      for (size_t i = children.size(); i-- > 0;) {
        stack.emplace_back(number_of(children[i]), matrix);
      }
    }
    return out;
  }

  static int64_t number_of(const cJSON *value) {
    if (!cJSON_IsNumber(value) || !(value->valuedouble >= 0 && value->valuedouble <= INT32_MAX)) {
      malformed("A glTF list of nodes contains something that is not an index.");
    }
    return static_cast<int64_t>(value->valuedouble);
  }

  /* The number in the result of an image of the file; −1 where its bytes are not in the file, or are not a picture. */
  int32_t use_image(int64_t index) {
    const cJSON *image = element(image_list, index, "image");
    if (image_number[static_cast<size_t>(index)] != -2) {
      return image_number[static_cast<size_t>(index)];
    }
    image_number[static_cast<size_t>(index)] = -1;
    std::vector<unsigned char> own;
    Bytes bytes;
    std::string uri = text_of(image, "uri");
    if (uri.compare(0, 5, "data:") == 0) {
      own = decode_uri(uri);
      bytes = Bytes{own.data(), own.size()};
    } else if (member(image, "bufferView")) {
      bytes = view(whole(image, "bufferView", NONE));
    }
    const char *type = orb_image_type(bytes.at, bytes.size);
    image_bytes += bytes.size;
    if (!type || image_bytes > 2 * file_size) {
      return -1;
    }
    orb_image kept = {};
    kept.bytes = static_cast<unsigned char *>(orb_alloc(ctx, bytes.size, 1));
    if (!kept.bytes) {
      throw Passed{ORB_E_NO_MEMORY};
    }
    std::memcpy(kept.bytes, bytes.at, bytes.size);
    kept.size = bytes.size;
    std::strcpy(kept.mime, type);
    images.push_back(kept);
    return image_number[static_cast<size_t>(index)] = static_cast<int32_t>(images.size() - 1);
  }

  void load_texture(const cJSON *pbr, orb_material *out) {
    const cJSON *reference = member(pbr, "baseColorTexture");
    int64_t index = whole(reference, "index", NONE);
    if (index == NONE || whole(reference, "texCoord", 0) != 0) {
      return;
    }
    const cJSON *texture = element(textures, index, "texture");
    int64_t source = whole(texture, "source", NONE), sampler = whole(texture, "sampler", NONE);
    out->image = source == NONE ? -1 : use_image(source);
    if (sampler != NONE) {
      const cJSON *s = element(samplers, sampler, "sampler");
      out->wrap_s = orb_sampler_wrap(whole(s, "wrapS", 0));
      out->wrap_t = orb_sampler_wrap(whole(s, "wrapT", 0));
      out->mag_filter = orb_sampler_magnify(whole(s, "magFilter", 0));
      out->min_filter = orb_sampler_minify(whole(s, "minFilter", 0));
    }
  }

  void load_materials() {
    const List materials = array_of(doc, "materials");
    image_number.assign(image_list.size(), -2);
    if (materials.size() > ORB_MATERIALS_MAX) {
      throw Fault{ORB_E_TOO_LARGE, "The glTF file has too many materials."};
    }
    must(orb_build_grow(ctx, &build.materials, &build.materials_room, static_cast<int64_t>(materials.size()) + 1,
                        sizeof(orb_material)));
    for (const cJSON *material : materials) {
      orb_material out = {};
      double color[4] = {1, 1, 1, 1};
      const cJSON *pbr = member(material, "pbrMetallicRoughness");
      numbers(pbr, "baseColorFactor", color, 4);
      for (int i = 0; i < 4; i++) {
        out.base_color[i] = static_cast<float>(std::fmin(std::fmax(color[i], 0), 1));
      }
      auto factor = [&](const char *key) {
        const cJSON *it = member(pbr, key);
        double value = cJSON_IsNumber(it) ? it->valuedouble : 1;
        return static_cast<float>(std::fmin(std::fmax(value, 0), 1));
      };
      out.metallic = factor("metallicFactor");
      out.roughness = factor("roughnessFactor");
      out.image = -1;
      std::string name = text_of(material, "name");
      std::memcpy(out.name, name.c_str(), std::min(name.size(), sizeof out.name - 1));
      load_texture(pbr, &out);
      build.materials[build.material_count++] = out;
    }
  }

  void check_extensions() const {
    for (const cJSON *name : array_of(doc, "extensionsRequired")) {
      for (const char *packed : {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}) {
        if (cJSON_IsString(name) && std::strcmp(name->valuestring, packed) == 0) {
          malformed(std::string("The glTF file is compressed with ") + packed + "; export it without compression.");
        }
      }
    }
  }

  void read(orb_mesh *out) {
    if (!cJSON_IsObject(doc) || text_of(member(doc, "asset"), "version").compare(0, 2, "2.") != 0) {
      malformed("The file is not glTF 2.0.");
    }
    check_extensions();
    accessors = array_of(doc, "accessors");
    views = array_of(doc, "bufferViews");
    meshes = array_of(doc, "meshes");
    image_list = array_of(doc, "images");
    textures = array_of(doc, "textures");
    samplers = array_of(doc, "samplers");
    load_buffers();
    load_materials();
    build.by_vertex = 1;
    build.texcoords_v_down = 1;
    std::vector<std::pair<int64_t, Matrix>> shown = instances();
    std::vector<int64_t> first(meshes.size(), NONE);
    for (size_t i = 0; i < shown.size(); i++) {
      (void)element(meshes, shown[i].first, "mesh");
      int64_t &at = first[static_cast<size_t>(shown[i].first)];
      at = at == NONE ? static_cast<int64_t>(i) : at;
    }
    bool normals = any_has("NORMAL"), texcoords = any_has("TEXCOORD_0");
    auto add = [&](size_t mesh, const Matrix &matrix, bool visible) {
      for (const cJSON *primitive : array_of(meshes[mesh], "primitives")) {
        if (!cJSON_IsObject(primitive)) {
          malformed("A glTF primitive is not an object.");
        }
        add_primitive(primitive, matrix, visible, normals, texcoords);
        must(orb_context_check(ctx));
      }
    };
    for (size_t i = 0; i < meshes.size(); i++) {
      add(i, first[i] == NONE ? Matrix() : shown[static_cast<size_t>(first[i])].second, first[i] != NONE);
    }
    for (size_t i = 0; i < shown.size(); i++) {
      if (first[static_cast<size_t>(shown[i].first)] != static_cast<int64_t>(i)) {
        add(static_cast<size_t>(shown[i].first), shown[i].second, true);
      }
    }
    finish(out);
  }

  void finish(orb_mesh *out) {
    orb_image *kept = nullptr;
    if (!images.empty()) {
      kept = static_cast<orb_image *>(orb_alloc(ctx, images.size(), sizeof(orb_image)));
      if (!kept) {
        throw Passed{ORB_E_NO_MEMORY};
      }
    }
    orb_status status = orb_build_finish(&build, 0, static_cast<int64_t>(file_size), out);
    if (status != ORB_OK || !kept || !out->materials) {
      orb_free(ctx, kept);
      for (int32_t i = 0; status == ORB_OK && i < out->material_count; i++) {
        out->materials[i].image = -1;
      }
      must(status);
      return;
    }
    std::copy(images.begin(), images.end(), kept);
    out->images = kept;
    out->image_count = static_cast<int32_t>(images.size());
    images.clear();
  }
};

/* Counts the separators outside strings: a bound on how many values the document has. */
size_t count_values(const unsigned char *text, size_t size) {
  size_t count = 1;
  bool quoted = false;
  for (size_t i = 0; i < size; i++) {
    unsigned char c = text[i];
    if (quoted) {
      i += c == '\\';
      quoted = c != '"';
    } else {
      quoted = c == '"';
      count += c == ',' || c == '[' || c == '{';
    }
  }
  return count;
}

/* The JSON text and the binary chunk of a GLB. */
Bytes split_glb(const unsigned char *bytes, size_t size, Bytes *chunk) {
  if (size < 20) {
    malformed("The GLB ends within its header.");
  }
  size_t length = orb_read_u32(bytes + 8, 0), text = orb_read_u32(bytes + 12, 0);
  if (orb_read_u32(bytes + 4, 0) != 2 || orb_read_u32(bytes + 16, 0) != 0x4e4f534a) {
    malformed("The GLB is not version 2, or does not begin with its JSON.");
  }
  if (length > size || length < 20 || text > length - 20) {
    malformed("The GLB announces " + std::to_string(length) + " bytes but has " + std::to_string(size) + ".");
  }
  size_t after = 20 + text;
  if (length - after >= 8 && orb_read_u32(bytes + after + 4, 0) == 0x004e4942) {
    size_t binary = orb_read_u32(bytes + after, 0);
    if (binary > length - after - 8) {
      malformed("The binary chunk of the GLB is longer than the file.");
    }
    *chunk = Bytes{bytes + after + 8, binary};
  }
  return Bytes{bytes + 20, text};
}

void read_document(orb_context *ctx, const unsigned char *bytes, size_t size, bool binary, orb_mesh *out) {
  Bytes chunk, text{bytes, size};
  if (binary) {
    text = split_glb(bytes, size, &chunk);
  }
  size_t values = count_values(text.at, text.size);
  if (values > VALUES_MAX) {
    throw Fault{ORB_E_TOO_LARGE, "The JSON of the glTF file has too many values."};
  }
  Reader reader(ctx, size);
  reader.chunk = chunk;
  const char *end = nullptr;
  std::unique_ptr<cJSON, void (*)(cJSON *)> doc(
      cJSON_ParseWithLengthOpts(reinterpret_cast<const char *>(text.at), text.size, &end, 0), cJSON_Delete);
  if (!doc && orb_json_begins(reinterpret_cast<const char *>(text.at), text.size)) {
    throw std::bad_alloc();
  }
  if (!doc) {
    int64_t at = end ? reinterpret_cast<const unsigned char *>(end) - bytes : static_cast<int64_t>(size);
    (void)orb_build_malformed(ctx, 0, at, "The JSON of the glTF file is not valid.");
    throw Passed{ORB_E_MALFORMED_MESH};
  }
  reader.doc = doc.get();
  reader.read(out);
}

/* No exception leaves it. */
orb_status read_either(orb_context *ctx, const unsigned char *bytes, size_t size, bool binary, orb_mesh *out) {
  /* The parser's memory is not charged to the context; a block of about its size, never touched, stands for it. */
  void *reserve = orb_alloc(ctx, size, binary ? 1 : 4);
  if (!reserve) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  try {
    read_document(ctx, bytes, size, binary, out);
  } catch (const Passed &passed) {
    status = passed.status;
  } catch (const Fault &fault) {
    status = fault.status == ORB_E_MALFORMED_MESH
                 ? orb_build_malformed(ctx, 0, static_cast<int64_t>(size), "%s", fault.detail.c_str())
                 : orb_fail(ctx, fault.status, "%s", fault.detail.c_str());
  } catch (const std::bad_alloc &) {
    status = orb_fail(ctx, ORB_E_NO_MEMORY, "The machine is out of memory for the glTF file.");
  } catch (const std::exception &error) {
    status = orb_build_malformed(ctx, 0, static_cast<int64_t>(size), "The glTF file is not valid: %s", error.what());
  }
  orb_free(ctx, reserve);
  return status;
}

}  // namespace

extern "C" orb_status orb_gltf_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  return read_either(ctx, bytes, size, false, out);
}

extern "C" orb_status orb_glb_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  return read_either(ctx, bytes, size, true, out);
}

/* A JSON object. */
extern "C" orb_certainty orb_gltf_is(const unsigned char *bytes, size_t size) {
  size_t i = orb_bom(bytes, size);
  while (i < size && (bytes[i] == ' ' || bytes[i] == '\t' || bytes[i] == '\n' || bytes[i] == '\r')) {
    i++;
  }
  return i < size && bytes[i] == '{' ? ORB_LIKELY : ORB_NO;
}

extern "C" orb_certainty orb_glb_is(const unsigned char *bytes, size_t size) {
  return size >= 4 && std::memcmp(bytes, "glTF", 4) == 0 ? ORB_SURE : ORB_NO;
}
