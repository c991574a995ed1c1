#include "format/gltf_given.h"

#include <map>

#include "format/gltf_blocks.hh"
#include "format/gltf_parse.hh"
#include "orbmorph/utf8.h"

extern "C" {
#include "base/memory.h"
}

namespace gltf {

namespace {

const size_t TARGETS_A_CHECK = 4096; /* targets between two checks for cancellation */

using Chosen = Counted<const Block *>;

struct Given {
  orb_context *ctx;
  Document document;
  Buffers buffers;
  List meshes;
  Counted<Block> blocks;

  Given(orb_context *context, const unsigned char *bytes, size_t size)
      : ctx(context),
        document(context, bytes, size, size >= 4 && std::memcmp(bytes, "glTF", 4) == 0),
        buffers(context),
        blocks(Charged<Block>(context)) {
    buffers.load(document.root(), document.chunk(), size);
    meshes = array_of(document.root(), "meshes");
    blocks = blocks_of(ctx, document.root());
  }

  /* The blocks with vertices that count. */
  Chosen used_blocks(const orb_given_file &file) const {
    Chosen out{Charged<const Block *>(ctx)};
    for (const Block &block : blocks) {
      if (block.first + static_cast<int64_t>(block.count) > file.vertex_count) {
        malformed("The glTF file has more vertices than were read.");
      }
      if (std::memchr(file.used + block.first, 1, block.count)) {
        out.push_back(&block);
      }
    }
    return out;
  }
};

template <typename T>
T *allocate(orb_context *ctx, size_t count) {
  T *block = static_cast<T *>(orb_alloc(ctx, count, sizeof(T)));
  if (!block) {
    throw Passed{ORB_E_NO_MEMORY};
  }
  return block;
}

/* An attribute of a block; a fault names its mesh. */
Numbers attribute_of(const Given &given, const Block &block, const std::string &name, size_t low, size_t high,
                     size_t *width) {
  Numbers out{Charged<double>(given.ctx)};
  blaming({culprit("meshes", given.meshes, block.mesh)},
          [&] { out = given.buffers.attribute(block.primitive, name.c_str(), block.count, low, high, width); });
  return out;
}

void read_set(const Given &given, const orb_given_file &file, const std::string &name, int32_t width, float *out) {
  std::fill_n(out, static_cast<size_t>(width) * static_cast<size_t>(file.vertex_count), width == 4 ? 1.0f : 0.0f);
  for (const Block *block : given.used_blocks(file)) {
    size_t has = 0, low = width == 4 ? 3 : 2, high = static_cast<size_t>(width);
    Numbers values = attribute_of(given, *block, name, low, high, &has);
    for (size_t i = 0; !values.empty() && i < block->count; i++) {
      float *to = out + static_cast<size_t>(width) * (static_cast<size_t>(block->first) + i);
      for (size_t k = 0; k < has; k++) {
        double value = values[has * i + k];
        to[k] = std::fabs(value) < 1e30 ? static_cast<float>(value) : 0.0f;
      }
    }
  }
}

void read_sets(const Given &given, const orb_given_file &file, const std::string &prefix, orb_given_sets *out) {
  for (int32_t n = 0; n < ORB_GIVEN_SETS; n++) {
    std::string name = prefix + std::to_string(n);
    bool has = false;
    for (const Block *block : given.used_blocks(file)) {
      has = has || member(member(block->primitive, "attributes"), name.c_str());
    }
    if (has) {
      float *values =
          allocate<float>(given.ctx, static_cast<size_t>(out->width) * static_cast<size_t>(file.vertex_count));
      out->values[out->count] = values;
      out->number[out->count++] = n;
      read_set(given, file, name, out->width, values);
    }
  }
}

std::string title_of(const Given &given, size_t mesh) {
  return "mesh " + std::to_string(mesh) + " (\"" + text_of(given.meshes[mesh], "name").substr(0, 60) + "\")";
}

/* Of each mesh its skin. */
using Skins = std::map<size_t, int64_t, std::less<size_t>, Charged<std::pair<const size_t, int64_t>>>;

/* The skin with which the nodes show each mesh that is used; NONE: without one. */
Skins skins_of(const Given &given, const Chosen &used) {
  Skins out{Skins::allocator_type(given.ctx)};
  for (const Block *block : used) {
    out[block->mesh] = NONE;
  }
  const List nodes = array_of(given.document.root(), "nodes");
  for (size_t n = 0; n < nodes.size(); n++) {
    int64_t mesh = index_of(nodes[n], "mesh"), skin = index_of(nodes[n], "skin");
    auto found = mesh == NONE || skin == NONE ? out.end() : out.find(static_cast<size_t>(mesh));
    if (found == out.end()) {
      continue;
    }
    if (found->second != NONE && found->second != skin) {
      throw Fault{ORB_E_BAD_OPTION,
                  "The nodes of " + title_of(given, found->first) +
                      " have several skins, and an asset can have one. Leave \"skin\" out.",
                  mesh_and_nodes(given.document.root(), found->first)};
    }
    found->second = skin;
  }
  return out;
}

bool same_matrix(const Matrix &a, const Matrix &b) {
  for (int i = 0; i < 16; i++) {
    if (!(std::fabs(a.m[i] - b.m[i]) <= 1e-6 * (1 + std::fabs(a.m[i])))) {
      return false;
    }
  }
  return true;
}

Culprits both(const Given &given, const Block &a, const Block &b) {
  return {culprit("meshes", given.meshes, a.mesh), culprit("meshes", given.meshes, b.mesh)};
}

/* The blocks that are skinned; fills skin and place. */
Chosen skinned_blocks(const Given &given, const orb_given_file &file, orb_given_skin *out) {
  Chosen blocks{Charged<const Block *>(given.ctx)};
  const Chosen used = given.used_blocks(file);
  const Skins skins = skins_of(given, used);
  for (const Block *block : used) {
    int64_t skin = skins.at(block->mesh);
    if (skin == NONE || !member(member(block->primitive, "attributes"), "JOINTS_0")) {
      continue;
    }
    if (!blocks.empty() && skin != out->skin) {
      throw Fault{ORB_E_BAD_OPTION,
                  "The meshes of its closed surface have several skins, and an asset can have one. Leave \"skin\" "
                  "out, or upload the file with part=NAME.",
                  both(given, *blocks[0], *block)};
    }
    if (!blocks.empty() && !same_matrix(blocks[0]->matrix, block->matrix)) {
      throw Fault{ORB_E_BAD_OPTION,
                  "The meshes of its closed surface stand under nodes with different transforms, which one skeleton "
                  "does not fit. Apply the transforms in the program that made the file.",
                  both(given, *blocks[0], *block)};
    }
    out->skin = static_cast<int32_t>(skin);
    blocks.push_back(block);
  }
  return blocks;
}

int32_t sets_of(const Chosen &blocks) {
  int32_t sets = 0;
  for (const Block *block : blocks) {
    int32_t n = 0;
    while (n < 4 && member(member(block->primitive, "attributes"), ("JOINTS_" + std::to_string(n)).c_str())) {
      n++;
    }
    sets = std::max(sets, n);
  }
  return sets;
}

void read_weights(const Given &given, const Block &block, int32_t set, orb_given_skin *out) {
  size_t width = 0;
  std::string number = std::to_string(set);
  Numbers joints = attribute_of(given, block, "JOINTS_" + number, 4, 4, &width);
  Numbers weights = attribute_of(given, block, "WEIGHTS_" + number, 4, 4, &width);
  for (size_t i = 0; !joints.empty() && !weights.empty() && i < 4 * block.count; i++) {
    if (!(joints[i] >= 0 && joints[i] < out->joint_count)) {
      malformed("A vertex of " + title_of(given, block.mesh) + " names a joint that its skin does not have.",
                {culprit("meshes", given.meshes, block.mesh)});
    }
    size_t vertex = static_cast<size_t>(block.first) + i / 4;
    size_t at = vertex * static_cast<size_t>(out->influences) + 4 * static_cast<size_t>(set) + i % 4;
    out->joints[at] = static_cast<uint16_t>(joints[i]);
    out->weights[at] = weights[i] > 0 && weights[i] < 1e9 ? static_cast<float>(weights[i]) : 0.0f;
  }
}

void read_skin(const Given &given, const orb_given_file &file, orb_given_skin *out) {
  const Chosen blocks = skinned_blocks(given, file, out);
  if (blocks.empty()) {
    return;
  }
  const List skins = array_of(given.document.root(), "skins");
  const cJSON *skin = element(skins, out->skin, "skin");
  size_t joints = array_of(skin, "joints").size();
  if (joints == 0 || joints > ORB_GIVEN_JOINTS) {
    malformed("The skin of the glTF file has no joints, or more than " + std::to_string(ORB_GIVEN_JOINTS) + ".",
              {culprit("skins", skins, static_cast<size_t>(out->skin))});
  }
  out->joint_count = static_cast<int32_t>(joints);
  out->influences = 4 * sets_of(blocks);
  std::memcpy(out->place, blocks[0]->matrix.m, sizeof out->place);
  size_t count = static_cast<size_t>(out->influences) * static_cast<size_t>(file.vertex_count);
  out->joints = allocate<uint16_t>(given.ctx, count);
  out->weights = allocate<float>(given.ctx, count);
  std::fill_n(out->joints, count, static_cast<uint16_t>(0));
  std::fill_n(out->weights, count, 0.0f);
  for (const Block *block : blocks) {
    for (int32_t set = 0; set < out->influences / 4; set++) {
      read_weights(given, *block, set, out);
    }
  }
}

/* The names of the targets of a mesh that has `count`. */
Counted<std::string> target_names(const Given &given, size_t mesh, size_t count) {
  const cJSON *list = member(member(given.meshes[mesh], "extras"), "targetNames");
  const cJSON *name = cJSON_IsArray(list) ? list->child : nullptr;
  Counted<std::string> out{Charged<std::string>(given.ctx)};
  for (size_t k = 0; k < count; k++, name = name ? name->next : nullptr) {
    if (k % TARGETS_A_CHECK == 0) {
      must(orb_context_check(given.ctx));
    }
    bool is_text = cJSON_IsString(name) && *name->valuestring;
    out.push_back(is_text ? std::string(name->valuestring) : "target " + std::to_string(k));
  }
  return out;
}

/* Adds what a target does to the vertices of a block. */
void read_moves(const Given &given, const Block &block, const cJSON *target, float *moves) {
  int64_t index = whole(target, "POSITION", NONE);
  if (index == NONE) {
    return;
  }
  size_t width = 0;
  Numbers move = given.buffers.accessor(index, &width);
  if (width != 3 || move.size() != 3 * block.count) {
    malformed("A morph target of " + title_of(given, block.mesh) + " does not fit its POSITION.");
  }
  for (size_t i = 0; i < block.count; i++) {
    for (int r = 0; r < 3; r++) {
      double sum = 0;
      for (int c = 0; c < 3; c++) {
        sum += block.matrix.at(r, c) * move[3 * i + static_cast<size_t>(c)];
      }
      moves[3 * (static_cast<size_t>(block.first) + i) + static_cast<size_t>(r)] =
          std::fabs(sum) < 1e30 ? static_cast<float>(sum) : 0.0f;
    }
  }
}

void read_targets(const Given &given, const orb_given_file &file, orb_given_targets *out) {
  std::map<std::string, int32_t> known;
  out->names = static_cast<char(*)[ORB_NAME_MAX]>(orb_calloc(given.ctx, ORB_GIVEN_TARGETS, ORB_NAME_MAX));
  out->moves = static_cast<float **>(orb_calloc(given.ctx, ORB_GIVEN_TARGETS, sizeof(float *)));
  if (!out->names || !out->moves) {
    throw Passed{ORB_E_NO_MEMORY};
  }
  for (const Block *block : given.used_blocks(file)) {
    const List targets = array_of(block->primitive, "targets");
    const Counted<std::string> names = target_names(given, block->mesh, targets.size());
    for (size_t k = 0; k < targets.size(); k++) {
      if (k % TARGETS_A_CHECK == 0) {
        must(orb_context_check(given.ctx));
      }
      if (!known.count(names[k])) {
        if (out->count == ORB_GIVEN_TARGETS) {
          throw Fault{ORB_E_TOO_LARGE,
                      "\"transfer\" takes at most " + std::to_string(ORB_GIVEN_TARGETS) + " morph targets of a file.",
                      {culprit("meshes", given.meshes, block->mesh)}};
        }
        known[names[k]] = out->count;
        (void)orb_utf8_copy(out->names[out->count], ORB_NAME_MAX, names[k].c_str());
        size_t count = 3 * static_cast<size_t>(file.vertex_count);
        float *moves = out->moves[out->count++] = allocate<float>(given.ctx, count);
        std::fill_n(moves, count, 0.0f);
      }
      blaming({culprit("meshes", given.meshes, block->mesh)},
              [&] { read_moves(given, *block, targets[k], out->moves[known[names[k]]]); });
    }
  }
}

using Integers = Counted<int32_t>;

void read_triangles(const Given &given, const Block &block, Integers *triangles, Integers *materials) {
  int64_t index = whole(block.primitive, "indices", NONE);
  if (whole(block.primitive, "mode", 4) != 4) {
    return;
  }
  size_t width = 0, count = block.count;
  Numbers numbers{Charged<double>(given.ctx)};
  if (index != NONE) {
    numbers = given.buffers.accessor(index, &width);
    count = numbers.size();
  }
  for (size_t i = 0; i < count / 3 * 3; i++) {
    double v = index == NONE ? static_cast<double>(i) : numbers[i];
    if (!(v >= 0 && v < static_cast<double>(block.count))) {
      malformed("A glTF primitive names a vertex that it does not have.");
    }
    triangles->push_back(static_cast<int32_t>(block.first + static_cast<int64_t>(v)));
    if (i % 3 == 0) {
      materials->push_back(static_cast<int32_t>(whole(block.primitive, "material", NONE)));
    }
  }
}

void read_charts(const Given &given, orb_given_charts *out) {
  Integers triangles{Charged<int32_t>(given.ctx)}, materials{Charged<int32_t>(given.ctx)};
  const Block *last = given.blocks.empty() ? nullptr : &given.blocks.back();
  size_t vertices = last ? static_cast<size_t>(last->first) + last->count : 0;
  out->uv = allocate<float>(given.ctx, 2 * vertices);
  out->has = allocate<unsigned char>(given.ctx, vertices);
  std::fill_n(out->uv, 2 * vertices, 0.0f);
  std::fill_n(out->has, vertices, static_cast<unsigned char>(0));
  const List all = array_of(given.document.root(), "materials");
  for (const Block &block : given.blocks) {
    size_t width = 0, first = static_cast<size_t>(block.first);
    std::string name = "TEXCOORD_" + std::to_string(painted_set(all, block.primitive));
    Numbers uv = attribute_of(given, block, name, 2, 2, &width);
    for (size_t i = 0; i < uv.size(); i++) {
      out->uv[2 * first + i] = static_cast<float>(uv[i]);
      out->has[first + i / 2] = 1;
    }
    blaming({culprit("meshes", given.meshes, block.mesh)},
            [&] { read_triangles(given, block, &triangles, &materials); });
  }
  out->vertex_count = static_cast<int32_t>(vertices);
  out->triangles = allocate<int32_t>(given.ctx, triangles.size());
  out->material = allocate<int32_t>(given.ctx, materials.size());
  std::copy(triangles.begin(), triangles.end(), out->triangles);
  std::copy(materials.begin(), materials.end(), out->material);
  out->triangle_count = static_cast<int32_t>(materials.size());
}

}  // namespace

}  // namespace gltf

extern "C" orb_status orb_given_sets_read(orb_context *ctx, const orb_given_file *file, const char *prefix,
                                          orb_given_sets *out) {
  *out = orb_given_sets{};
  out->width = std::strcmp(prefix, "COLOR_") == 0 ? 4 : 2;
  return gltf::guarded(ctx, file->size, [&] {
    gltf::Given given(ctx, file->bytes, file->size);
    gltf::read_sets(given, *file, prefix, out);
  });
}

extern "C" void orb_given_sets_free(orb_context *ctx, orb_given_sets *sets) {
  for (int32_t i = 0; i < sets->count; i++) {
    orb_free(ctx, sets->values[i]);
  }
  *sets = orb_given_sets{};
}

extern "C" orb_status orb_given_skin_read(orb_context *ctx, const orb_given_file *file, orb_given_skin *out) {
  *out = orb_given_skin{};
  out->skin = -1;
  return gltf::guarded(ctx, file->size, [&] {
    gltf::Given given(ctx, file->bytes, file->size);
    gltf::read_skin(given, *file, out);
  });
}

extern "C" void orb_given_skin_free(orb_context *ctx, orb_given_skin *skin) {
  orb_free(ctx, skin->joints);
  orb_free(ctx, skin->weights);
  *skin = orb_given_skin{};
}

extern "C" orb_status orb_given_targets_read(orb_context *ctx, const orb_given_file *file, orb_given_targets *out) {
  *out = orb_given_targets{};
  return gltf::guarded(ctx, file->size, [&] {
    gltf::Given given(ctx, file->bytes, file->size);
    gltf::read_targets(given, *file, out);
  });
}

extern "C" void orb_given_targets_free(orb_context *ctx, orb_given_targets *targets) {
  for (int32_t k = 0; k < targets->count; k++) {
    orb_free(ctx, targets->moves[k]);
  }
  orb_free(ctx, targets->moves);
  orb_free(ctx, targets->names);
  *targets = orb_given_targets{};
}

extern "C" orb_status orb_given_charts_read(orb_context *ctx, const unsigned char *bytes, size_t size,
                                            orb_given_charts *out) {
  *out = orb_given_charts{};
  return gltf::guarded(ctx, size, [&] {
    gltf::Given given(ctx, bytes, size);
    gltf::read_charts(given, out);
  });
}

extern "C" void orb_given_charts_free(orb_context *ctx, orb_given_charts *charts) {
  orb_free(ctx, charts->triangles);
  orb_free(ctx, charts->material);
  orb_free(ctx, charts->uv);
  orb_free(ctx, charts->has);
  *charts = orb_given_charts{};
}

extern "C" orb_status orb_given_last_targets(orb_context *ctx, const unsigned char *bytes, size_t size,
                                             const int32_t *on_surface, int32_t vertex_count, int32_t count,
                                             orb_given_name *names) {
  return gltf::guarded(ctx, size, [&] {
    gltf::Given given(ctx, bytes, size);
    for (const gltf::Block &block : given.blocks) {
      bool is_on = false;
      for (int64_t v = block.first; v < block.first + static_cast<int64_t>(block.count) && v < vertex_count; v++) {
        is_on = is_on || on_surface[v] >= 0;
      }
      if (!is_on) {
        continue;
      }
      int32_t all = static_cast<int32_t>(gltf::array_of(block.primitive, "targets").size());
      const gltf::Counted<std::string> found = gltf::target_names(given, block.mesh, static_cast<size_t>(all));
      for (int32_t k = 0; k < count && all >= count; k++) {
        (void)orb_utf8_copy(names[k], sizeof names[k], found[static_cast<size_t>(all - count + k)].c_str());
      }
      return;
    }
  });
}
