/* Writes a described scene as GLB with tinygltf. No exception leaves this file. */
#include "format/gltf_write.h"

#include <tiny_gltf.h>

#include <new>
#include <sstream>
#include <streambuf>
#include <string>

namespace {

/* A stream that appends to an orb_buffer and remembers the first failure: tinygltf itself does not look. */
class BufferSink : public std::streambuf {
 public:
  BufferSink(orb_context *ctx, orb_buffer *out) : ctx_(ctx), out_(out) {}
  orb_status status() const { return status_; }

 protected:
  std::streamsize xsputn(const char *bytes, std::streamsize size) override {
    if (status_ == ORB_OK) {
      status_ = orb_buffer_append(ctx_, out_, bytes, static_cast<size_t>(size));
    }
    return status_ == ORB_OK ? size : 0;
  }
  int overflow(int byte) override {
    char c = static_cast<char>(byte);
    return byte != traits_type::eof() && xsputn(&c, 1) == 1 ? byte : traits_type::eof();
  }

 private:
  orb_context *ctx_;
  orb_buffer *out_;
  orb_status status_ = ORB_OK;
};

/* The length of the UTF-8 sequence at p, 0 if it is none. */
size_t utf8_length(const unsigned char *p) {
  size_t more = *p < 0x80                 ? 0
                : *p >= 0xc2 && *p < 0xe0 ? 1
                : *p >= 0xe0 && *p < 0xf0 ? 2
                : *p >= 0xf0 && *p < 0xf5 ? 3
                                          : 9;
  if (more == 9) {
    return 0;
  }
  for (size_t i = 1; i <= more; i++) {
    if ((p[i] & 0xc0) != 0x80) {
      return 0;
    }
  }
  if ((p[0] == 0xe0 && p[1] < 0xa0) || (p[0] == 0xed && p[1] > 0x9f) || (p[0] == 0xf0 && p[1] < 0x90) ||
      (p[0] == 0xf4 && p[1] > 0x8f)) {
    return 0;
  }
  return more + 1;
}

std::string clean_text(const char *text) {
  std::string out;
  const unsigned char *p = reinterpret_cast<const unsigned char *>(text);
  while (*p) {
    size_t length = utf8_length(p);
    if (length == 0) {
      out += "\xef\xbf\xbd";
      p++;
    } else {
      out.append(reinterpret_cast<const char *>(p), length);
      p += length;
    }
  }
  return out;
}

int element_type(int components) {
  return components == 1   ? TINYGLTF_TYPE_SCALAR
         : components == 2 ? TINYGLTF_TYPE_VEC2
         : components == 3 ? TINYGLTF_TYPE_VEC3
                           : TINYGLTF_TYPE_VEC4;
}

void add_accessors(const orb_gltf_scene *scene, tinygltf::Model &model) {
  for (int32_t i = 0; i < scene->accessor_count; i++) {
    const orb_gltf_accessor &from = scene->accessors[i];
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = from.offset;
    view.byteLength = from.length;
    view.target = from.target;
    model.bufferViews.push_back(view);
    tinygltf::Accessor accessor;
    accessor.bufferView = i;
    accessor.byteOffset = 0;
    accessor.normalized = false;
    accessor.componentType = from.component_type;
    accessor.count = static_cast<size_t>(from.count);
    accessor.type = element_type(from.components);
    accessor.sparse.isSparse = false;
    if (from.bounded) {
      accessor.minValues.assign(from.min, from.min + from.components);
      accessor.maxValues.assign(from.max, from.max + from.components);
    }
    model.accessors.push_back(accessor);
  }
}

std::map<std::string, int> attribute_map(const orb_gltf_attributes &from) {
  std::map<std::string, int> out;
  out["POSITION"] = from.position;
  if (from.normal >= 0) {
    out["NORMAL"] = from.normal;
  }
  if (from.texcoord >= 0) {
    out["TEXCOORD_0"] = from.texcoord;
  }
  if (from.color >= 0) {
    out["COLOR_0"] = from.color;
  }
  return out;
}

void add_mesh(const orb_gltf_scene *scene, tinygltf::Model &model) {
  tinygltf::Mesh mesh;
  mesh.name = clean_text(scene->name);
  for (int32_t i = 0; i < scene->primitive_count; i++) {
    const orb_gltf_primitive &from = scene->primitives[i];
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.indices = from.indices;
    primitive.material = from.material;
    primitive.attributes = attribute_map(from.base);
    for (int32_t k = 0; k < scene->target_count; k++) {
      primitive.targets.push_back(attribute_map(from.targets[k]));
    }
    mesh.primitives.push_back(primitive);
  }
  mesh.weights.assign(static_cast<size_t>(scene->target_count), 0.0);
  tinygltf::Value::Array names;
  for (int32_t k = 0; k < scene->target_count; k++) {
    names.push_back(tinygltf::Value(clean_text(scene->target_names[k])));
  }
  tinygltf::Value::Object extras;
  extras["targetNames"] = tinygltf::Value(names);
  for (int32_t i = 0; i < scene->extra_count; i++) {
    const orb_gltf_extra &from = scene->extras[i];
    extras[from.name] = from.text ? tinygltf::Value(clean_text(from.text)) : tinygltf::Value(from.number);
  }
  mesh.extras = tinygltf::Value(extras);
  model.meshes.push_back(mesh);
  tinygltf::Node node;
  node.mesh = 0;
  node.name = mesh.name;
  model.nodes.push_back(node);
  tinygltf::Scene root;
  root.nodes.push_back(0);
  model.scenes.push_back(root);
  model.defaultScene = 0;
}

/* A sampler and a texture for each image that a material uses; materials that share both share the texture. */
int add_texture(const orb_material &from, tinygltf::Model &model) {
  tinygltf::Sampler sampler;
  sampler.minFilter = from.min_filter ? from.min_filter : TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
  sampler.magFilter = from.mag_filter ? from.mag_filter : TINYGLTF_TEXTURE_FILTER_LINEAR;
  sampler.wrapS = from.wrap_s ? from.wrap_s : TINYGLTF_TEXTURE_WRAP_REPEAT;
  sampler.wrapT = from.wrap_t ? from.wrap_t : TINYGLTF_TEXTURE_WRAP_REPEAT;
  for (size_t i = 0; i < model.textures.size(); i++) {
    if (model.textures[i].source == from.image &&
        model.samplers[static_cast<size_t>(model.textures[i].sampler)] == sampler) {
      return static_cast<int>(i);
    }
  }
  tinygltf::Texture texture;
  texture.source = from.image;
  texture.sampler = static_cast<int>(model.samplers.size());
  model.samplers.push_back(sampler);
  model.textures.push_back(texture);
  return static_cast<int>(model.textures.size()) - 1;
}

void add_materials(const orb_gltf_scene *scene, tinygltf::Model &model) {
  for (int32_t i = 0; i < scene->image_count; i++) {
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = scene->images[i].offset;
    view.byteLength = scene->images[i].length;
    tinygltf::Image image;
    image.bufferView = static_cast<int>(model.bufferViews.size());
    image.mimeType = scene->images[i].mime;
    model.bufferViews.push_back(view);
    model.images.push_back(image);
  }
  for (int32_t i = 0; i < scene->material_count; i++) {
    const orb_material &from = scene->materials[i];
    tinygltf::Material material;
    material.name = clean_text(from.name);
    material.pbrMetallicRoughness.baseColorFactor.assign(from.base_color, from.base_color + 4);
    material.pbrMetallicRoughness.metallicFactor = static_cast<double>(from.metallic);
    material.pbrMetallicRoughness.roughnessFactor = static_cast<double>(from.roughness);
    if (from.image >= 0) {
      material.pbrMetallicRoughness.baseColorTexture.index = add_texture(from, model);
    }
    model.materials.push_back(material);
  }
}

void add_animation(const orb_gltf_scene *scene, tinygltf::Model &model) {
  if (scene->times < 0) {
    return;
  }
  tinygltf::Animation animation;
  animation.name = "morph";
  tinygltf::AnimationSampler sampler;
  sampler.input = scene->times;
  sampler.output = scene->weights;
  sampler.interpolation = "LINEAR";
  animation.samplers.push_back(sampler);
  tinygltf::AnimationChannel channel;
  channel.sampler = 0;
  channel.target_node = 0;
  channel.target_path = "weights";
  animation.channels.push_back(channel);
  model.animations.push_back(animation);
}

orb_status write_model(orb_context *ctx, const orb_gltf_scene *scene, const orb_buffer *binary, orb_buffer *out) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = ORB_ENGINE;
  add_accessors(scene, model);
  add_mesh(scene, model);
  add_materials(scene, model);
  add_animation(scene, model);
  tinygltf::Buffer buffer;
  buffer.data.assign(binary->data, binary->data + binary->size);
  model.buffers.push_back(std::move(buffer));
  BufferSink sink(ctx, out);
  std::ostream stream(&sink);
  tinygltf::TinyGLTF writer;
  bool written = writer.WriteGltfSceneToStream(&model, stream, false, true);
  if (sink.status() != ORB_OK) {
    return sink.status();
  }
  return written && stream.good() ? ORB_OK : orb_fail(ctx, ORB_E_INTERNAL, "The GLB could not be written.");
}

}  // namespace

extern "C" orb_status orb_gltf_write(orb_context *ctx, const orb_gltf_scene *scene, const orb_buffer *binary,
                                     orb_buffer *out) {
  if (binary->size > UINT32_MAX - (size_t{64} << 20)) {
    return orb_fail(ctx, ORB_E_TOO_LARGE,
                    "The asset would be larger than a GLB can be (4 GiB); ask for fewer triangles.");
  }
  /* tinygltf copies the binary chunk twice outside the context's allocator: hold that much of the budget meanwhile. */
  void *held = orb_alloc(ctx, 2, binary->size + 65536);
  if (!held) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status;
  try {
    status = write_model(ctx, scene, binary, out);
  } catch (const std::bad_alloc &) {
    status = orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory to write the asset.");
  } catch (...) {
    status = orb_fail(ctx, ORB_E_INTERNAL, "The GLB could not be written.");
  }
  orb_free(ctx, held);
  return status;
}
