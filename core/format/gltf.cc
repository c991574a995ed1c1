/* glTF and GLB: all triangle primitives of the default scene, positions after node transforms.
 *
 * Accessors are decoded in place, after every offset has been checked against the bytes.
 *
 * Vertices are numbered over the triangle primitives of all meshes in file order, whether the scene shows them or not;
 * a mesh that is shown more than once gets further numbers after all of these. Errors inside are exceptions; all end in
 * guarded().
 */
#include <cjson/cJSON.h>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>
#include <set>
#include <string>
#include <vector>

extern "C" {
#include "format/readers.h"
#include "format/text.h"
}

#include "format/gltf_material.hh"
#include "format/gltf_parse.hh"
#include "format/gltf_scene.hh"

namespace gltf {

namespace {

/* Looking up the members of a primitive and of its accessors, in components decoded; a mesh may be shown often. */
const size_t WORK_OF_PRIMITIVE = 1024;

struct Reader {
  orb_context *ctx;
  size_t file_size;
  const cJSON *doc;
  List meshes;
  Buffers buffers;
  orb_build build;
  Materials materials;

  Reader(orb_context *context, size_t size, const cJSON *document)
      : ctx(context), file_size(size), doc(document), buffers(context), materials(context, &build, &buffers, size) {
    orb_build_init(&build, ctx);
  }
  ~Reader() { orb_build_free(&build); }
  Reader(const Reader &) = delete;
  Reader &operator=(const Reader &) = delete;

  void add_triangle(int64_t base, int64_t a, int64_t b, int64_t c, bool mirrored) {
    int64_t corner[3] = {a, mirrored ? c : b, mirrored ? b : c};
    for (int64_t index : corner) {
      must(orb_build_corner(&build, orb_corner{static_cast<int32_t>(base + index), -1, -1}, 0));
    }
    must(orb_build_face_end(&build, 3));
  }

  Numbers indices_of(const cJSON *primitive, size_t vertices) const {
    int64_t index = whole(primitive, "indices", NONE);
    Numbers out{Charged<double>(ctx)};
    if (index == NONE) {
      buffers.spend(vertices);
      out.resize(vertices);
      for (size_t i = 0; i < vertices; i++) {
        out[i] = static_cast<double>(i);
      }
      return out;
    }
    size_t width = 0;
    out = buffers.accessor(index, &width);
    for (double value : out) {
      if (width != 1 || !(value >= 0 && value < static_cast<double>(vertices)) || value != std::floor(value)) {
        malformed("A glTF primitive names vertex " + std::to_string(value) + " of " + std::to_string(vertices) + ".");
      }
    }
    return out;
  }

  void add_faces(const cJSON *primitive, int64_t mode, int64_t base, size_t vertices, bool mirrored) {
    Numbers index = indices_of(primitive, vertices);
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
    Numbers position = buffers.accessor(whole(member(primitive, "attributes"), "POSITION", NONE), &width);
    if (width != 3) {
      malformed("The glTF attribute POSITION does not have three components.");
    }
    size_t count = position.size() / 3, color_width = 0;
    if (static_cast<size_t>(build.vertices) + count > 2 * file_size + 1024 ||
        static_cast<size_t>(build.triangles) > 2 * file_size + 1024) {
      throw Fault{ORB_E_TOO_LARGE,
                  "The glTF file shows its meshes so often that they need more memory than the file justifies."};
    }
    Numbers normal = buffers.attribute(primitive, "NORMAL", count, 3, 3, &width);
    Numbers texcoord = buffers.attribute(primitive, texcoord_of(primitive).c_str(), count, 2, 2, &width);
    Numbers color = buffers.attribute(primitive, "COLOR_0", count, 3, 4, &color_width);
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

  /* The attribute whose texture coordinates the mesh gets. */
  std::string texcoord_of(const cJSON *primitive) const {
    return "TEXCOORD_" + std::to_string(materials.set_of(index_of(primitive, "material")));
  }

  /* Calls use(primitive) for all primitives of all meshes. */
  template <typename Use>
  void for_primitives(Use use) const {
    for (const cJSON *mesh : meshes) {
      for (const cJSON *primitive : array_of(mesh, "primitives")) {
        use(primitive);
      }
    }
  }

  /* The faces to come are a mesh as a node shows it. at: NULL if none does. */
  void begin_object(size_t mesh, const Shown *at) {
    const std::string name = text_of(meshes[mesh], "name"), node = at ? text_of(at->node, "name") : "";
    const std::string &title = name.empty() ? node : name;
    buffers.spend(name.size() + node.size()); /* a name is copied as often as its mesh is shown */
    must(orb_build_object(&build, reinterpret_cast<const unsigned char *>(title.data()), title.size()));
    orb_build_object_node(&build, reinterpret_cast<const unsigned char *>(node.data()), node.size());
  }

  /* Says what a JSON document is that is not glTF 2.0. */
  [[noreturn]] void refuse_other() const {
    if (cJSON_IsArray(member(doc, "landmarks"))) {
      throw Fault{ORB_E_UNKNOWN_FORMAT,
                  "This is a landmark file; send landmarks as \"landmarks\" of a supermesh, or with --landmarks."};
    }
    malformed("The file is not glTF 2.0: its \"asset\" has no \"version\" that begins with 2.");
  }

  void read(Bytes chunk, orb_mesh *out) {
    if (!cJSON_IsObject(doc) || text_of(member(doc, "asset"), "version").compare(0, 2, "2.") != 0) {
      refuse_other();
    }
    meshes = array_of(doc, "meshes");
    buffers.load(doc, chunk, file_size);
    materials.load(doc);
    build.by_vertex = 1;
    build.texcoords_v_down = 1;
    const Counted<Shown> shown = shown_meshes(ctx, doc, meshes.size());
    Counted<int64_t> first(meshes.size(), NONE, Charged<int64_t>(ctx));
    for (size_t i = 0; i < shown.size(); i++) {
      (void)element(meshes, shown[i].mesh, "mesh");
      int64_t &at = first[static_cast<size_t>(shown[i].mesh)];
      at = at == NONE ? static_cast<int64_t>(i) : at;
    }
    bool normals = false, texcoords = false; /* if any triangle primitive has them, all get them */
    for_primitives([&](const cJSON *primitive) {
      const cJSON *attributes = member(primitive, "attributes");
      normals |= member(attributes, "NORMAL") != nullptr;
      texcoords |= member(attributes, texcoord_of(primitive).c_str()) != nullptr;
    });
    auto add = [&](size_t mesh, const Shown *at) {
      must(orb_context_check(ctx));
      begin_object(mesh, at);
      blaming({culprit("meshes", meshes, mesh)}, [&] {
        for (const cJSON *primitive : array_of(meshes[mesh], "primitives")) {
          if (!cJSON_IsObject(primitive)) {
            malformed("A glTF primitive is not an object.");
          }
          buffers.spend(WORK_OF_PRIMITIVE);
          add_primitive(primitive, at ? at->matrix : Matrix(), at != nullptr, normals, texcoords);
          must(orb_context_check(ctx));
        }
      });
    };
    for (size_t i = 0; i < meshes.size(); i++) {
      add(i, first[i] == NONE ? nullptr : &shown[static_cast<size_t>(first[i])]);
    }
    for (size_t i = 0; i < shown.size(); i++) {
      if (first[static_cast<size_t>(shown[i].mesh)] != static_cast<int64_t>(i)) {
        add(static_cast<size_t>(shown[i].mesh), &shown[i]);
      }
    }
    note_dropped();
    must(orb_build_finish(&build, 0, static_cast<int64_t>(file_size), out));
    materials.finish(out);
  }

  /* Notes what a file may have besides a surface and its materials. */
  void note_dropped() {
    static const struct {
      const char *what, *why;
    } lists[] = {{"animations", "The only animation of the asset is the morph."},
                 {"skins", "The asset has no skeleton."}};
    auto drop = [&](const std::string &what, const char *why) { must(orb_build_drop(&build, what.c_str(), "", why)); };
    for (const auto &list : lists) {
      if (cJSON_GetArraySize(member(doc, list.what)) > 0) {
        drop(list.what, list.why);
      }
    }
    if (member(member(doc, "extensions"), "KHR_materials_variants")) {
      drop("KHR_materials_variants", "The asset has one variant, the default one.");
    }
    std::set<std::string> sets;
    bool has_targets = false;
    for_primitives([&](const cJSON *primitive) {
      const cJSON *attributes = member(primitive, "attributes");
      has_targets |= cJSON_GetArraySize(member(primitive, "targets")) > 0;
      std::string kept = texcoord_of(primitive);
      for (const cJSON *item = cJSON_IsObject(attributes) ? attributes->child : nullptr; item; item = item->next) {
        bool is_set = std::strncmp(item->string, "TEXCOORD_", 9) == 0 || std::strncmp(item->string, "COLOR_", 6) == 0;
        if (is_set && kept != item->string && std::strcmp(item->string, "COLOR_0") != 0 && sets.size() < 16) {
          sets.insert(std::string(item->string).substr(0, 32));
        }
      }
    });
    for (const std::string &set : sets) {
      drop(set, "The asset has one set of texture coordinates and one of colours.");
    }
    if (has_targets) {
      drop("targets", "The targets of the asset are the other shapes.");
    }
  }
};

orb_status read_either(orb_context *ctx, const unsigned char *bytes, size_t size, bool binary, orb_mesh *out) {
  return guarded(ctx, size, [&] {
    Document document(ctx, bytes, size, binary);
    Reader reader(ctx, size, document.root());
    reader.read(document.chunk(), out);
  });
}

}  // namespace

}  // namespace gltf

extern "C" orb_status orb_gltf_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  return gltf::read_either(ctx, bytes, size, false, out);
}

extern "C" orb_status orb_glb_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  return gltf::read_either(ctx, bytes, size, true, out);
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
