/* The materials of a glTF document, with their textures and images. What the mesh cannot have is noted, not refused:
 * only what concerns the base colour is checked strictly. */
#ifndef ORB_FORMAT_GLTF_MATERIAL_HH
#define ORB_FORMAT_GLTF_MATERIAL_HH

#include "format/gltf_accessor.hh"

extern "C" {
#include "format/build.h"
}

namespace gltf {

class Materials {
 public:
  /* All must outlive this; the build may be freed before. file_size: bounds the size of all images together. */
  Materials(orb_context *ctx, orb_build *build, const Buffers *buffers, size_t file_size)
      : ctx_(ctx),
        build_(build),
        buffers_(buffers),
        file_size_(file_size),
        sets_(Charged<int64_t>(ctx)),
        image_number_(Charged<int32_t>(ctx)),
        image_fault_(Charged<const char *>(ctx)) {}
  ~Materials();
  Materials(const Materials &) = delete;
  Materials &operator=(const Materials &) = delete;

  /* Adds the materials to the build. */
  void load(const cJSON *doc);

  /* The set of texture coordinates that a material uses: n of TEXCOORD_n. A mesh has one, so the textures of a material
   * that use another set are omitted. 0 for none and for a number that the file does not have. */
  int64_t set_of(int64_t material) const;

  /* Passes the images to the finished mesh. */
  void finish(orb_mesh *out);

 private:
  /* A member of the present material; reference: of a texture, what names it. */
  struct Value {
    orb_material_value value;
    const cJSON *reference;
  };

  void load_one(const cJSON *material);
  void load_base(const cJSON *material, orb_material *out) const;
  void load_members(const cJSON *object, const char *extension);
  void load_member(const cJSON *item, orb_material_member number);
  void load_extensions(const cJSON *material);
  void settle();
  int64_t choose_set(const cJSON *base) const;
  void load_textures(const cJSON *base, orb_material *out);
  const char *load_texture(const cJSON *reference, bool is_base, orb_texture *out);
  const char *use_image(int64_t index, int32_t *number);
  const char *find_image(const cJSON *image, Bytes *bytes, std::vector<unsigned char> *own) const;
  void keep(orb_material *out) const;
  const Value *find(orb_material_member member) const;
  bool has(const char *extension) const;
  void remove(orb_material_member member);
  void remove(const char *extension, const char *why);
  void drop(const std::string &what, const char *why) const;

  orb_context *ctx_;
  orb_build *build_;
  const Buffers *buffers_;
  size_t file_size_, image_bytes_ = 0;
  List images_, textures_, samplers_;
  Counted<int64_t> sets_;             /* of each material */
  std::vector<orb_image> kept_;       /* owned: the context's memory, passed to the mesh or freed */
  Counted<int32_t> image_number_;     /* of each image of the file: its number in kept_; −1: not yet known */
  Counted<const char *> image_fault_; /* of each image: why it is omitted; NULL: it is not */
  std::string where_;                 /* the present material */
  std::vector<Value> values_;         /* of the present material */
  int64_t set_ = 0;                   /* that the present material uses */
};

}  // namespace gltf

#endif
