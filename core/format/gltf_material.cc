#include "format/gltf_material.hh"

extern "C" {
#include "base/memory.h"
#include "format/material_table.h"
#include "format/texture.h"
}

namespace gltf {

namespace {

const size_t IMAGES_MAX = 4096; /* of a file */

const char *const INVALID = "Its value in the file is not valid.";
const char *const MISSING = "It refers to something that the file does not have.";

orb_material_member member_of(int number) {
  return static_cast<orb_material_member>(number);
}

const cJSON *entry(const List &list, int64_t index) {
  bool is_there = index >= 0 && index < static_cast<int64_t>(list.size());
  return is_there && cJSON_IsObject(list[static_cast<size_t>(index)]) ? list[static_cast<size_t>(index)] : nullptr;
}

const cJSON *transform_of(const cJSON *reference) {
  return member(member(reference, "extensions"), "KHR_texture_transform");
}

/* The set of texture coordinates of a reference: that of the transform, if it has one, replaces its own. */
int64_t set_of_reference(const cJSON *reference) {
  int64_t moved = index_of(transform_of(reference), "texCoord");
  return moved != NONE ? moved : std::max<int64_t>(index_of(reference, "texCoord"), 0);
}

/* Reads an array of exactly `count` finite numbers. */
bool read_numbers(const cJSON *item, double *out, int count) {
  if (!cJSON_IsArray(item) || cJSON_GetArraySize(item) != count) {
    return false;
  }
  int i = 0;
  for (const cJSON *number = item->child; number; number = number->next) {
    if (!cJSON_IsNumber(number) || !std::isfinite(number->valuedouble)) {
      return false;
    }
    out[i++] = number->valuedouble;
  }
  return true;
}

/* Reads one that is absent, too. */
bool read_optional(const cJSON *object, const char *key, double *out, int count) {
  const cJSON *item = member(object, key);
  if (item && count == 1) {
    *out = cJSON_IsNumber(item) ? item->valuedouble : NAN;
    return std::isfinite(*out);
  }
  return !item || read_numbers(item, out, count);
}

bool read_transform(const cJSON *transform, orb_texture *out) {
  double offset[2] = {0, 0}, rotation = 0, scale[2] = {1, 1};
  if (!cJSON_IsObject(transform) || !read_optional(transform, "offset", offset, 2) ||
      !read_optional(transform, "rotation", &rotation, 1) || !read_optional(transform, "scale", scale, 2)) {
    return false;
  }
  std::copy(offset, offset + 2, out->offset);
  std::copy(scale, scale + 2, out->scale);
  out->rotation = rotation;
  out->is_transformed = offset[0] != 0 || offset[1] != 0 || rotation != 0 || scale[0] != 1 || scale[1] != 1;
  return true;
}

/* The numbers of a value; false if the file has something else there. */
bool read_value(const cJSON *item, orb_material_value *out) {
  const orb_member_row *row = orb_member_row_of(out->member);
  int count = orb_member_numbers(out->member);
  if (row->kind == ORB_MEMBER_FLAG) {
    out->number[0] = cJSON_IsTrue(item);
    return cJSON_IsBool(item);
  }
  if (row->kind == ORB_MEMBER_MODE) {
    std::string mode = cJSON_IsString(item) ? item->valuestring : "";
    out->number[0] = mode == "MASK" ? 1 : mode == "BLEND" ? 2 : 0;
    return mode == "OPAQUE" || out->number[0] > 0;
  }
  if (row->kind == ORB_MEMBER_TEXTURE) {
    out->number[0] = 1;
    if (!cJSON_IsObject(item) || (count && !read_optional(item, orb_member_factor(out->member), out->number, 1))) {
      return false;
    }
  } else if (row->kind == ORB_MEMBER_NUMBER) {
    out->number[0] = cJSON_IsNumber(item) ? item->valuedouble : NAN;
    if (!std::isfinite(out->number[0])) {
      return false;
    }
  } else if (count && !read_numbers(item, out->number, count)) {
    return false;
  }
  for (int i = 0; i < count; i++) {
    out->number[i] = orb_member_clamp(out->member, out->number[i]);
  }
  return true;
}

}  // namespace

Materials::~Materials() {
  for (orb_image &image : kept_) {
    orb_free(ctx_, image.bytes);
  }
}

int64_t Materials::set_of(int64_t material) const {
  bool is_there = material >= 0 && material < static_cast<int64_t>(sets_.size());
  return is_there ? sets_[static_cast<size_t>(material)] : 0;
}

void Materials::drop(const std::string &what, const char *why) const {
  must(orb_build_drop(build_, what.c_str(), where_.c_str(), why));
}

const Materials::Value *Materials::find(orb_material_member member) const {
  for (const Value &value : values_) {
    if (value.value.member == member) {
      return &value;
    }
  }
  return nullptr;
}

bool Materials::has(const char *extension) const {
  for (const Value &value : values_) {
    if (std::strcmp(orb_member_row_of(value.value.member)->extension, extension) == 0) {
      return true;
    }
  }
  return false;
}

void Materials::remove(orb_material_member member) {
  auto is_it = [&](const Value &value) { return value.value.member == member; };
  values_.erase(std::remove_if(values_.begin(), values_.end(), is_it), values_.end());
}

void Materials::remove(const char *extension, const char *why) {
  auto is_it = [&](const Value &value) {
    return std::strcmp(orb_member_row_of(value.value.member)->extension, extension) == 0;
  };
  if (has(extension)) {
    drop(extension, why);
  }
  values_.erase(std::remove_if(values_.begin(), values_.end(), is_it), values_.end());
}

void Materials::load_base(const cJSON *material, orb_material *out) const {
  double color[4] = {1, 1, 1, 1};
  const cJSON *pbr = member(material, "pbrMetallicRoughness");
  numbers(pbr, "baseColorFactor", color, 4);
  for (int i = 0; i < 4; i++) {
    out->base_color[i] = static_cast<float>(std::fmin(std::fmax(color[i], 0), 1));
  }
  auto factor = [&](const char *key) {
    const cJSON *it = member(pbr, key);
    double value = cJSON_IsNumber(it) ? it->valuedouble : 1;
    return static_cast<float>(std::fmin(std::fmax(value, 0), 1));
  };
  out->metallic = factor("metallicFactor");
  out->roughness = factor("roughnessFactor");
  out->base_texture.image = -1;
  std::string name = text_of(material, "name");
  std::memcpy(out->name, name.c_str(), std::min(name.size(), sizeof out->name - 1));
}

void Materials::load_member(const cJSON *item, orb_material_member number) {
  Value value = {};
  value.value.member = number;
  value.value.texture.image = -1;
  value.reference = item;
  if (!read_value(item, &value.value)) {
    drop(orb_member_row_of(number)->name, INVALID);
    return;
  }
  values_.push_back(value);
}

/* The members of an extension, "" for those of the material itself. */
void Materials::load_members(const cJSON *object, const char *extension) {
  for (int i = 0; i < ORB_MATERIAL_MEMBER_COUNT; i++) {
    const orb_member_row *row = orb_member_row_of(member_of(i));
    if (std::strcmp(row->extension, extension) != 0) {
      continue;
    }
    bool in_pbr = i == ORB_MATERIAL_METALLIC_ROUGHNESS_TEXTURE;
    const cJSON *holder = in_pbr ? member(object, "pbrMetallicRoughness") : object;
    const cJSON *item = *row->name ? member(holder, row->name) : object;
    if (item) {
      load_member(item, member_of(i));
    }
  }
}

void Materials::load_extensions(const cJSON *material) {
  const cJSON *extensions = member(material, "extensions");
  for (const cJSON *item = cJSON_IsObject(extensions) ? extensions->child : nullptr; item; item = item->next) {
    bool is_known = false;
    for (int i = 0; i < ORB_MATERIAL_MEMBER_COUNT; i++) {
      is_known |= std::strcmp(orb_member_row_of(member_of(i))->extension, item->string) == 0;
    }
    if (!is_known || !cJSON_IsObject(item)) {
      drop(item->string, is_known ? INVALID : "The asset does not carry this extension.");
    } else if (!has(item->string)) {
      load_members(item, item->string);
    }
  }
  std::sort(values_.begin(), values_.end(),
            [](const Value &a, const Value &b) { return a.value.member < b.value.member; });
}

/* Removes what has no effect, or what glTF does not allow together. */
void Materials::settle() {
  static const char *const unlit = "KHR_materials_unlit";
  static const char *const volume = "KHR_materials_volume", *const glossy = "KHR_materials_pbrSpecularGlossiness";
  const char *kept = has(unlit) ? unlit : has(glossy) ? glossy : nullptr;
  for (int i = 0; kept && i < ORB_MATERIAL_MEMBER_COUNT; i++) {
    const char *extension = orb_member_row_of(member_of(i))->extension;
    if (*extension && std::strcmp(extension, kept) != 0) {
      remove(extension, "glTF does not allow it beside KHR_materials_unlit or KHR_materials_pbrSpecularGlossiness.");
    }
  }
  if (!has("KHR_materials_transmission") && !has("KHR_materials_diffuse_transmission")) {
    remove(volume, "It has no effect without KHR_materials_transmission.");
  }
  if (!has(volume)) {
    remove("KHR_materials_dispersion", "It has no effect without KHR_materials_volume.");
  }
  const Value *mode = find(ORB_MATERIAL_ALPHA_MODE), *sides = find(ORB_MATERIAL_DOUBLE_SIDED);
  const Value *thickness = find(ORB_MATERIAL_THICKNESS), *glow = find(ORB_MATERIAL_EMISSIVE);
  bool is_masked = mode && mode->value.number[0] == 1, is_opaque = mode && mode->value.number[0] == 0;
  bool has_two_sides = sides && sides->value.number[0] == 1;
  bool is_thick = thickness && thickness->value.number[0] > 0;
  const double *color = glow ? glow->value.number : nullptr;
  if (!color || (color[0] == 0 && color[1] == 0 && color[2] == 0)) {
    remove(ORB_MATERIAL_EMISSIVE);
    remove(ORB_MATERIAL_EMISSIVE_STRENGTH);
  }
  if (!is_masked) {
    remove(ORB_MATERIAL_ALPHA_CUTOFF);
  }
  if (is_opaque) {
    remove(ORB_MATERIAL_ALPHA_MODE);
  }
  if (has_two_sides && is_thick) {
    drop("doubleSided", "A material with a volume has one side.");
  }
  if (!has_two_sides || is_thick) {
    remove(ORB_MATERIAL_DOUBLE_SIDED);
  }
}

/* The set of the base colour, else the lowest one. */
int64_t Materials::choose_set(const cJSON *base) const {
  if (base) {
    return set_of_reference(base);
  }
  int64_t set = INT32_MAX;
  for (const Value &value : values_) {
    if (orb_member_row_of(value.value.member)->kind == ORB_MEMBER_TEXTURE) {
      set = std::min(set, set_of_reference(value.reference));
    }
  }
  return set == INT32_MAX ? 0 : set;
}

/* Where an image is in the file. Returns why it is omitted, NULL if it is there. */
const char *Materials::find_image(const cJSON *image, Bytes *bytes, std::vector<unsigned char> *own) const {
  std::string uri = text_of(image, "uri");
  if (uri.compare(0, 5, "data:") == 0) {
    *own = decode_uri(uri);
    *bytes = Bytes{own->data(), own->size()};
  } else if (member(image, "bufferView")) {
    *bytes = buffers_->view(whole(image, "bufferView", NONE));
  } else {
    return "Its image is not in the file.";
  }
  return nullptr;
}

/* Sets the number in kept_ of an image of the file. Returns why it is omitted, NULL if it is not. */
const char *Materials::use_image(int64_t index, int32_t *number) {
  size_t at = static_cast<size_t>(index);
  *number = image_number_[at];
  if (*number >= 0 || image_fault_[at]) {
    return image_fault_[at];
  }
  std::vector<unsigned char> own;
  Bytes bytes;
  const char *fault = find_image(images_[at], &bytes, &own), *type = nullptr;
  if (!fault) {
    type = orb_image_type(bytes.at, bytes.size);
    image_bytes_ += bytes.size;
    fault = !type                           ? "Its image is not a PNG or JPEG that viewers of glTF can open."
            : image_bytes_ > 2 * file_size_ ? "The file uses its images more often than its size justifies."
            : kept_.size() >= IMAGES_MAX    ? "The file has too many images."
                                            : nullptr;
  }
  image_fault_[at] = fault;
  if (fault) {
    return fault;
  }
  kept_.push_back(orb_image()); /* owned before it has memory */
  orb_image &kept = kept_.back();
  kept.bytes = static_cast<unsigned char *>(orb_alloc(ctx_, bytes.size, 1));
  if (!kept.bytes) {
    throw Passed{ORB_E_NO_MEMORY};
  }
  std::memcpy(kept.bytes, bytes.at, bytes.size);
  kept.size = orb_image_strip(kept.bytes, bytes.size);
  std::strcpy(kept.mime, type);
  *number = image_number_[at] = static_cast<int32_t>(kept_.size() - 1);
  return nullptr;
}

/* Returns why a texture is omitted, NULL if it is not. A base colour that refers to nothing is refused. */
const char *Materials::load_texture(const cJSON *reference, bool is_base, orb_texture *out) {
  if (is_base) {
    (void)element(textures_, whole(reference, "index", NONE), "texture");
  }
  const cJSON *texture = entry(textures_, index_of(reference, "index"));
  if (!texture) {
    return MISSING;
  }
  if (set_of_reference(reference) != set_) {
    return "It uses other texture coordinates than the material's other textures; the asset has one set.";
  }
  const cJSON *transform = transform_of(reference);
  if (transform && !read_transform(transform, out)) {
    return "Its KHR_texture_transform is not valid.";
  }
  if (!member(texture, "source")) {
    return "Its image is not a PNG or JPEG that viewers of glTF can open.";
  }
  int64_t source = index_of(texture, "source"), sampler = index_of(texture, "sampler");
  if (is_base) {
    (void)element(images_, whole(texture, "source", NONE), "image");
  }
  if (is_base && member(texture, "sampler")) {
    (void)element(samplers_, whole(texture, "sampler", NONE), "sampler");
  }
  const cJSON *s = entry(samplers_, sampler);
  if (!entry(images_, source) || (!s && member(texture, "sampler"))) {
    return MISSING;
  }
  out->wrap_s = orb_sampler_wrap(index_of(s, "wrapS"));
  out->wrap_t = orb_sampler_wrap(index_of(s, "wrapT"));
  out->mag_filter = orb_sampler_magnify(index_of(s, "magFilter"));
  out->min_filter = orb_sampler_minify(index_of(s, "minFilter"));
  try {
    return use_image(source, &out->image);
  } catch (const Fault &) {
    if (is_base) {
      throw;
    }
    return image_fault_[static_cast<size_t>(source)] = "Its image is damaged.";
  }
}

void Materials::load_textures(const cJSON *base, orb_material *out) {
  set_ = choose_set(base);
  sets_.push_back(set_);
  const char *fault = base ? load_texture(base, true, &out->base_texture) : nullptr;
  if (fault) {
    drop("baseColorTexture", fault);
    out->base_texture.image = -1;
  }
  for (Value &value : values_) {
    const orb_member_row *row = orb_member_row_of(value.value.member);
    if (row->kind == ORB_MEMBER_TEXTURE) {
      fault = load_texture(value.reference, false, &value.value.texture);
      if (fault) {
        drop(row->name, fault);
        value.value.texture.image = -1;
      }
    }
  }
}

/* Appends the values of the present material to the build, without the textures that are omitted. */
void Materials::keep(orb_material *out) const {
  out->first_value = static_cast<int32_t>(build_->value_count);
  for (const Value &value : values_) {
    if (orb_member_row_of(value.value.member)->kind == ORB_MEMBER_TEXTURE && value.value.texture.image < 0) {
      continue;
    }
    must(orb_build_grow(ctx_, &build_->material_values, &build_->value_room, build_->value_count + 1,
                        sizeof(orb_material_value)));
    build_->material_values[build_->value_count++] = value.value;
  }
  out->value_count = static_cast<int32_t>(build_->value_count) - out->first_value;
}

void Materials::load_one(const cJSON *material) {
  orb_material out = {};
  load_base(material, &out);
  where_ = "materials[" + std::to_string(build_->material_count) + "]";
  where_ += *out.name ? std::string(" \"") + out.name + "\"" : "";
  values_.clear();
  load_members(material, "");
  load_extensions(material);
  settle();
  const cJSON *base = member(member(material, "pbrMetallicRoughness"), "baseColorTexture");
  load_textures(member(base, "index") ? base : nullptr, &out);
  keep(&out);
  build_->materials[build_->material_count++] = out;
}

void Materials::load(const cJSON *doc) {
  const List materials = array_of(doc, "materials");
  images_ = array_of(doc, "images");
  textures_ = array_of(doc, "textures");
  samplers_ = array_of(doc, "samplers");
  image_number_.assign(images_.size(), -1);
  image_fault_.assign(images_.size(), nullptr);
  if (materials.size() > ORB_MATERIALS_MAX) {
    throw Fault{ORB_E_TOO_LARGE, "The glTF file has more than 65,536 materials; export it with fewer."};
  }
  must(orb_build_grow(ctx_, &build_->materials, &build_->materials_room, static_cast<int64_t>(materials.size()) + 1,
                      sizeof(orb_material)));
  for (const cJSON *material : materials) {
    load_one(material);
    must(orb_context_check(ctx_));
  }
}

void Materials::finish(orb_mesh *out) {
  if (!out->materials || kept_.empty()) {
    return;
  }
  orb_image *images = static_cast<orb_image *>(orb_alloc(ctx_, kept_.size(), sizeof(orb_image)));
  if (!images) {
    orb_mesh_free(ctx_, out);
    throw Passed{ORB_E_NO_MEMORY};
  }
  std::copy(kept_.begin(), kept_.end(), images);
  out->images = images;
  out->image_count = static_cast<int32_t>(kept_.size());
  kept_.clear();
}

}  // namespace gltf
