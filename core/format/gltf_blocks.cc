#include "format/gltf_blocks.hh"

namespace gltf {

bool is_surface(const cJSON *primitive) {
  int64_t mode = whole(primitive, "mode", 4);
  return mode >= 4 && mode <= 6 && member(member(primitive, "attributes"), "POSITION");
}

Counted<Block> blocks_of(orb_context *ctx, const cJSON *doc) {
  const List meshes = array_of(doc, "meshes"), accessors = array_of(doc, "accessors");
  Counted<Block> out{Charged<Block>(ctx)};
  int64_t next = 0;
  auto add = [&](size_t mesh, const Matrix &matrix) {
    for (const cJSON *primitive : array_of(meshes[mesh], "primitives")) {
      if (is_surface(primitive)) {
        const cJSON *position =
            element(accessors, whole(member(primitive, "attributes"), "POSITION", NONE), "accessor");
        size_t count = static_cast<size_t>(whole(position, "count", 0));
        if (next + static_cast<int64_t>(count) > INT32_MAX) {
          throw Fault{ORB_E_TOO_LARGE, "The glTF file has too many vertices."};
        }
        out.push_back(Block{mesh, primitive, next, count, matrix});
        next += static_cast<int64_t>(count);
      }
    }
  };
  const auto shown = shown_meshes(ctx, doc, meshes.size());
  Counted<const Matrix *> matrix(meshes.size(), nullptr, Charged<const Matrix *>(ctx));
  std::vector<bool> again(shown.size(), false);
  for (size_t i = 0; i < shown.size(); i++) {
    (void)element(meshes, shown[i].mesh, "mesh");
    const Matrix *&at = matrix[static_cast<size_t>(shown[i].mesh)];
    again[i] = at != nullptr;
    at = at ? at : &shown[i].matrix;
  }
  for (size_t m = 0; m < meshes.size(); m++) {
    add(m, matrix[m] ? *matrix[m] : Matrix());
  }
  for (size_t i = 0; i < shown.size(); i++) {
    if (again[i]) {
      add(static_cast<size_t>(shown[i].mesh), shown[i].matrix);
    }
  }
  return out;
}

int64_t painted_set(const List &materials, const cJSON *primitive) {
  int64_t number = whole(primitive, "material", NONE);
  const cJSON *material = number == NONE ? nullptr : element(materials, number, "material");
  const cJSON *texture = member(member(material, "pbrMetallicRoughness"), "baseColorTexture");
  const cJSON *moved = member(member(texture, "extensions"), "KHR_texture_transform");
  int64_t set = whole(moved, "texCoord", whole(texture, "texCoord", 0));
  return set < 100 ? set : 0;
}

}  // namespace gltf
