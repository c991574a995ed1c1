#include "format/gltf_add.h"

#include <cstdio>
#include <map>
#include <set>

#include "format/gltf_blocks.hh"
#include "format/gltf_edit.hh"
#include "format/gltf_parse.hh"
#include "format/gltf_rig.hh"

extern "C" {
#include "format/gltf_document.h"
}

namespace gltf {

namespace {

const char *const VARIANTS = "KHR_materials_variants";
const char *const SKINNED[] = {"JOINTS_0", "WEIGHTS_0"};

struct Adder {
  orb_context *ctx;
  cJSON *doc;
  const orb_additions &more;
  Editor editor;
  std::set<size_t> meshes; /* those on the surface */
  Counted<Block> blocks;   /* of these meshes */
  Counted<size_t> twin;    /* per block: the first block with the same accessor of positions */

  Adder(orb_context *context, const Document &document, Bytes first, const orb_additions &additions)
      : ctx(context),
        doc(document.root()),
        more(additions),
        editor(context, document.root(), first),
        blocks(Charged<Block>(context)),
        twin(Charged<size_t>(context)) {
    const Counted<Block> all = blocks_of(ctx, doc);
    for (const Block &block : all) {
      bool is_copy = block.first + static_cast<int64_t>(block.count) > more.vertex_count; /* of a mesh shown twice */
      for (size_t i = 0; i < block.count && !is_copy; i++) {
        if (more.on_surface[block.first + static_cast<int64_t>(i)] >= 0) {
          meshes.insert(block.mesh);
          break;
        }
      }
    }
    for (const Block &block : all) {
      if (meshes.count(block.mesh) && block.first + static_cast<int64_t>(block.count) <= more.vertex_count) {
        blocks.push_back(block);
      }
    }
    std::map<int64_t, size_t> seen;
    for (size_t i = 0; i < blocks.size(); i++) {
      twin.push_back(seen.emplace(whole(attributes_of(blocks[i]), "POSITION", NONE), i).first->second);
    }
  }

  static cJSON *attributes_of(const Block &block) { return editable(member(block.primitive, "attributes")); }

  Floats floats_of(const Block &block, const float *values, size_t width) const {
    Floats out{Charged<float>(ctx)};
    const float *from = values + width * static_cast<size_t>(block.first);
    out.assign(from, from + width * block.count);
    return out;
  }

  /* Whether block i shares its vertices with an earlier one, and has the same values: it gets the same accessor. */
  template <typename T>
  bool is_repeated(size_t i, const T *values, size_t width) const {
    const T *own = values + width * static_cast<size_t>(blocks[i].first);
    const T *other = values + width * static_cast<size_t>(blocks[twin[i]].first);
    return twin[i] != i && std::memcmp(own, other, width * blocks[i].count * sizeof(T)) == 0;
  }

  /* Sets of one primitive must be numbered from 0 without gaps: what it lacks below `number` gets white or zeros.
   * plain: an accessor of these, by its number of vertices. */
  void fill_below(const Block &block, const std::string &prefix, int32_t number, size_t width,
                  std::map<size_t, int64_t> *plain) {
    for (int32_t n = 0; n < number; n++) {
      std::string name = prefix + std::to_string(n);
      if (!member(attributes_of(block), name.c_str())) {
        if (!plain->count(block.count)) {
          Floats values{Charged<float>(ctx)};
          values.assign(width * block.count, width == 4 ? 1.0f : 0.0f);
          (*plain)[block.count] = editor.add(values, width, true, false);
        }
        set(attributes_of(block), name.c_str(), static_cast<double>((*plain)[block.count]));
      }
    }
  }

  void add_set(orb_added_set *added) {
    const std::string prefix = added->width == 4 ? "COLOR_" : "TEXCOORD_";
    const size_t width = static_cast<size_t>(added->width);
    int32_t number = 0;
    for (const Block &block : blocks) {
      while (member(attributes_of(block), (prefix + std::to_string(number)).c_str())) {
        number++;
      }
    }
    std::map<size_t, int64_t> plain;
    std::vector<int64_t> accessors;
    for (size_t i = 0; i < blocks.size(); i++) {
      fill_below(blocks[i], prefix, number, width, &plain);
      accessors.push_back(is_repeated(i, added->values, width)
                              ? accessors[twin[i]]
                              : editor.add(floats_of(blocks[i], added->values, width), width, true, false));
      set(attributes_of(blocks[i]), (prefix + std::to_string(number)).c_str(), static_cast<double>(accessors[i]));
    }
    added->number = number;
  }

  void add_weights(size_t i) {
    const Block &block = blocks[i];
    if (is_repeated(i, more.skin.joints, 4) && is_repeated(i, more.skin.weights, 4)) {
      for (const char *name : SKINNED) {
        set(attributes_of(block), name, static_cast<double>(whole(attributes_of(blocks[twin[i]]), name, NONE)));
      }
      return;
    }
    const size_t from = 4 * static_cast<size_t>(block.first), count = 4 * block.count;
    int64_t joints = NONE;
    if (more.skin.joint_count <= 256) {
      Counted<unsigned char> bytes{Charged<unsigned char>(ctx)};
      for (size_t k = 0; k < count; k++) {
        bytes.push_back(static_cast<unsigned char>(more.skin.joints[from + k]));
      }
      joints = editor.add_list(bytes.data(), count, ORB_GLTF_UBYTE, block.count, "VEC4", true);
    } else {
      joints = editor.add_list(more.skin.joints + from, 2 * count, ORB_GLTF_USHORT, block.count, "VEC4", true);
    }
    set(attributes_of(block), SKINNED[0], static_cast<double>(joints));
    int64_t weights = editor.add(floats_of(block, more.skin.weights, 4), 4, true, false);
    set(attributes_of(block), SKINNED[1], static_cast<double>(weights));
  }

  [[noreturn]] void refuse_skin(size_t mesh) const {
    throw Fault{ORB_E_BAD_OPTION,
                "The document of the first shape has a skin already, and a mesh can have one. Leave \"skin\" of "
                "\"transfer\" out, or use another method than 'template'.",
                {culprit("meshes", array_of(doc, "meshes"), mesh)}};
  }

  /* Refuses a skin beside another one, and one for several places. */
  void check_skin() const {
    const List all = array_of(doc, "meshes");
    for (const Block &block : blocks) {
      for (const char *name : SKINNED) {
        if (member(member(block.primitive, "attributes"), name)) {
          refuse_skin(block.mesh);
        }
      }
      if (std::memcmp(block.matrix.m, blocks[0].matrix.m, sizeof block.matrix.m) != 0) {
        throw Fault{
            ORB_E_BAD_OPTION,
            "The meshes of the first shape stand under nodes with different transforms, which one skeleton does "
            "not fit. Leave \"skin\" of \"transfer\" out, or use another method than 'template'.",
            {culprit("meshes", all, blocks[0].mesh), culprit("meshes", all, block.mesh)}};
      }
    }
    for (const cJSON *node : array_of(doc, "nodes")) {
      const int64_t mesh = index_of(node, "mesh");
      if (mesh != NONE && meshes.count(static_cast<size_t>(mesh)) && index_of(node, "skin") != NONE) {
        refuse_skin(static_cast<size_t>(mesh));
      }
    }
  }

  void add_skin() {
    check_skin();
    for (size_t i = 0; i < blocks.size(); i++) {
      add_weights(i);
    }
    int64_t skin = copy_skin(ctx, doc, &editor, more.skin, blocks[0].matrix);
    for (const cJSON *node : array_of(doc, "nodes")) {
      if (index_of(node, "mesh") != NONE && meshes.count(static_cast<size_t>(index_of(node, "mesh")))) {
        set(editable(node), "skin", static_cast<double>(skin));
      }
    }
  }

  void whiten() {
    for (const cJSON *material : array_of(doc, "materials")) {
      cJSON *surface = editable(member(material, "pbrMetallicRoughness"));
      if (surface) {
        cJSON *tone = made(cJSON_CreateArray());
        set(surface, "baseColorFactor", tone);
        for (int k = 0; k < 4; k++) {
          append(tone, cJSON_CreateNumber(1));
        }
      }
    }
  }

  cJSON *object_in(cJSON *object, const char *key) {
    if (!member(object, key)) {
      set(object, key, made(cJSON_CreateObject()));
    }
    if (!cJSON_IsObject(member(object, key))) {
      malformed(std::string("The glTF member \"") + key + "\" is not an object.");
    }
    return editable(member(object, key));
  }

  void use_extension(const char *name) {
    for (const cJSON *used : array_of(doc, "extensionsUsed")) {
      if (cJSON_IsString(used) && std::strcmp(used->valuestring, name) == 0) {
        return;
      }
    }
    append(array_in(doc, "extensionsUsed"), cJSON_CreateString(name));
  }

  /* Adds a variant to the document's list; returns its number, and its name made unique. */
  int64_t name_variant(cJSON *list, std::string *name) {
    std::set<std::string> taken;
    for (const cJSON *variant = list->child; variant; variant = variant->next) {
      taken.insert(text_of(variant, "name"));
    }
    std::string plain = *name;
    for (int again = 2; taken.count(*name); again++) {
      *name = plain + " (" + std::to_string(again) + ")";
    }
    cJSON *variant = made(cJSON_CreateObject());
    int64_t number = append(list, variant);
    set(variant, "name", cJSON_CreateString(name->c_str()));
    return number;
  }

  int64_t add_material(const orb_added_variant &variant, const std::string &name, const orb_added_image &image,
                       int64_t texcoord) {
    int64_t view = editor.add_view(image.png, image.size, 0);
    cJSON *picture = made(cJSON_CreateObject()), *texture = made(cJSON_CreateObject());
    int64_t source = append(array_in(doc, "images"), picture);
    set(picture, "name", cJSON_CreateString(name.c_str()));
    set(picture, "bufferView", static_cast<double>(view));
    set(picture, "mimeType", cJSON_CreateString("image/png"));
    int64_t number = append(array_in(doc, "textures"), texture);
    set(texture, "source", static_cast<double>(source));
    cJSON *material = made(cJSON_CreateObject());
    int64_t index = append(array_in(doc, "materials"), material);
    set(material, "name", cJSON_CreateString(name.c_str()));
    cJSON *surface = object_in(material, "pbrMetallicRoughness"), *used = object_in(surface, "baseColorTexture");
    set(used, "index", static_cast<double>(number));
    if (texcoord > 0) {
      set(used, "texCoord", static_cast<double>(texcoord));
    }
    set(surface, "metallicFactor", variant.metallic);
    set(surface, "roughnessFactor", variant.roughness);
    if (variant.is_blended) {
      set(material, "alphaMode", cJSON_CreateString("BLEND"));
    }
    if (variant.is_double_sided) {
      set(material, "doubleSided", cJSON_CreateBool(1));
    }
    return index;
  }

  static void add_mapping(cJSON *mappings, int64_t material, int64_t variant) {
    cJSON *mapping = made(cJSON_CreateObject());
    append(mappings, mapping);
    set(mapping, "material", static_cast<double>(material));
    append(array_in(mapping, "variants"), cJSON_CreateNumber(static_cast<double>(variant)));
  }

  cJSON *mappings_of(const Block &block) {
    cJSON *out = nullptr;
    blaming({culprit("meshes", array_of(doc, "meshes"), block.mesh)}, [&] {
      cJSON *extensions = object_in(editable(block.primitive), "extensions");
      out = array_in(object_in(extensions, VARIANTS), "mappings");
    });
    return out;
  }

  void add_variant(orb_added_variant *variant, cJSON *list) {
    std::string name = variant->name;
    const List materials = array_of(doc, "materials"); /* before it gets more */
    int64_t number = name_variant(list, &name);
    std::snprintf(variant->name, sizeof variant->name, "%s", name.c_str());
    for (int32_t i = 0; i < variant->image_count; i++) {
      const orb_added_image &image = variant->images[i];
      std::map<int64_t, int64_t> made_for; /* by the set of texture coordinates */
      for (const Block &block : blocks) {
        if (whole(block.primitive, "material", NONE) != image.material) {
          continue;
        }
        int64_t texcoord = painted_set(materials, block.primitive);
        if (!member(attributes_of(block), ("TEXCOORD_" + std::to_string(texcoord)).c_str())) {
          continue;
        }
        if (!made_for.count(texcoord)) {
          made_for[texcoord] = add_material(*variant, name, image, texcoord);
        }
        add_mapping(mappings_of(block), made_for[texcoord], number);
      }
    }
  }

  void add_variants() {
    use_extension(VARIANTS);
    cJSON *extension = object_in(object_in(doc, "extensions"), VARIANTS);
    bool is_first = !member(extension, "variants");
    cJSON *list = array_in(extension, "variants");
    if (is_first) {
      std::string name = more.own_name;
      int64_t own = name_variant(list, &name);
      for (const Block &block : blocks) {
        int64_t material = whole(block.primitive, "material", NONE);
        if (material != NONE) {
          add_mapping(mappings_of(block), material, own);
        }
      }
    }
    for (int32_t i = 0; i < more.variant_count; i++) {
      add_variant(&more.variants[i], list);
    }
  }

  /* Says that the asset has more than orb_asset_write() wrote, so that no profile is made of it. */
  void mark() {
    const List all = array_of(doc, "meshes");
    for (size_t number : meshes) {
      cJSON *mesh = editable(element(all, static_cast<int64_t>(number), "mesh"));
      if (!member(mesh, "extras")) {
        set(mesh, "extras", made(cJSON_CreateObject()));
      }
      cJSON *extras = editable(member(mesh, "extras"));
      if (cJSON_IsObject(extras)) {
        set(extras, "transferred", cJSON_CreateBool(1));
      }
    }
  }

  void add(orb_buffer *out) {
    for (int32_t i = 0; i < more.set_count; i++) {
      add_set(&more.sets[i]);
      if (more.whiten && more.sets[i].width == 4 && more.sets[i].number == 0) {
        whiten();
      }
    }
    if (more.skin.bytes && !blocks.empty()) {
      add_skin();
    }
    if (more.variant_count > 0) {
      add_variants();
    }
    mark();
    editor.write(out);
  }
};

}  // namespace

}  // namespace gltf

extern "C" orb_status orb_gltf_add(orb_context *ctx, const unsigned char *bytes, size_t size,
                                   const orb_additions *additions, orb_buffer *out) {
  return gltf::guarded(ctx, size, [&] {
    gltf::Document document(ctx, bytes, size, true);
    gltf::Buffers buffers(ctx);
    buffers.load(document.root(), document.chunk(), size);
    gltf::Adder adder(ctx, document, buffers.buffer(0), *additions);
    adder.add(out);
  });
}

extern "C" orb_status orb_gltf_try_room(orb_context *ctx, const unsigned char *bytes, size_t size,
                                        const int32_t *on_surface, int32_t vertex_count) {
  orb_additions none = {};
  none.vertex_count = vertex_count;
  none.on_surface = on_surface;
  return gltf::guarded(ctx, size, [&] {
    gltf::Document document(ctx, bytes, size, size >= 4 && std::memcmp(bytes, "glTF", 4) == 0);
    gltf::Adder(ctx, document, gltf::Bytes{}, none).check_skin();
  });
}

extern "C" orb_status orb_gltf_try_skin(orb_context *ctx, const orb_added_skin *skin) {
  struct Owner {
    cJSON *doc = cJSON_CreateObject();
    ~Owner() { cJSON_Delete(doc); }
  } owner;
  return gltf::guarded(ctx, skin->size, [&] {
    gltf::Editor editor(ctx, gltf::made(owner.doc), gltf::Bytes{});
    (void)gltf::copy_skin(ctx, owner.doc, &editor, *skin, gltf::Matrix());
  });
}
