#include "format/gltf_weights.hh"

#include <cstdio>
#include <set>

namespace gltf {

namespace {

struct Weights {
  orb_context *ctx;
  cJSON *doc;
  const Buffers &buffers;
  const Widened &widened;
  const orb_gltf_shapes &shapes;
  Editor *editor;
  List nodes;

  size_t more() const { return static_cast<size_t>(shapes.target_count); }

  /* Appends zeros to the default weights of a mesh or node, of which it has `had` or none. */
  void widen_defaults(cJSON *object, size_t had, bool always) const {
    std::vector<double> weights(had, 0);
    if (had + more() == 0) {
      return;
    }
    if (numbers(object, "weights", weights.data(), had) || always) {
      weights.resize(had + more(), 0);
      set(object, "weights", cJSON_CreateDoubleArray(weights.data(), static_cast<int>(weights.size())));
    }
  }

  /* The mesh whose weights a channel animates; NONE: another one, or something else. */
  int64_t mesh_of(const cJSON *channel) const {
    const cJSON *target = member(channel, "target");
    std::string path = text_of(target, "path");
    int64_t node = NONE, mesh = NONE;
    if (path == "weights") {
      node = index_of(target, "node");
    } else if (path == "pointer") {
      std::string pointer = text_of(member(member(target, "extensions"), "KHR_animation_pointer"), "pointer");
      int number = -1, end = 0;
      if (std::sscanf(pointer.c_str(), "/nodes/%9d/weights%n", &number, &end) == 1 &&
          static_cast<size_t>(end) == pointer.size()) {
        node = number;
      } else if (std::sscanf(pointer.c_str(), "/meshes/%9d/weights%n", &number, &end) == 1 &&
                 static_cast<size_t>(end) == pointer.size()) {
        mesh = number;
      }
    }
    if (node >= 0 && node < static_cast<int64_t>(nodes.size())) {
      mesh = index_of(nodes[static_cast<size_t>(node)], "mesh");
    }
    return widened.count(mesh) ? mesh : NONE;
  }

  /* How many values a sampler has for each target: one a keyframe, or three. */
  size_t keys_of(const cJSON *sampler) const {
    const cJSON *input = element(array_of(doc, "accessors"), whole(sampler, "input", NONE), "accessor");
    size_t keys = static_cast<size_t>(whole(input, "count", 0));
    return text_of(sampler, "interpolation") == "CUBICSPLINE" ? 3 * keys : keys;
  }

  /* The keyframes of a sampler with zeros for the new targets. */
  int64_t widen_keys(const cJSON *sampler, size_t had) const {
    size_t width = 0;
    Numbers old = buffers.accessor(whole(sampler, "output", NONE), &width);
    if (had == 0 || width != 1 || old.empty() || old.size() != had * keys_of(sampler)) {
      malformed("An animation of weights does not fit the morph targets of its mesh.");
    }
    size_t keys = old.size() / had, wide = had + more();
    Floats fresh{Charged<float>(ctx)};
    fresh.resize(keys * wide);
    for (size_t i = 0; i < keys; i++) {
      for (size_t k = 0; k < had; k++) {
        fresh[i * wide + k] = static_cast<float>(old[i * had + k]);
      }
    }
    return editor->add(fresh, 1, false, false);
  }

  void widen_animation(cJSON *animation) const {
    const List channels = array_of(animation, "channels"), samplers = array_of(animation, "samplers");
    std::map<std::pair<int64_t, int64_t>, int64_t> fresh; /* sampler and targets before: the sampler in its place */
    std::map<int64_t, std::set<int64_t>> users;           /* of a sampler: targets before, NONE: not of ours */
    auto had = [&](const cJSON *channel) {
      int64_t mesh = mesh_of(channel);
      return mesh == NONE ? NONE : static_cast<int64_t>(widened.at(mesh));
    };
    for (const cJSON *channel : channels) {
      users[whole(channel, "sampler", NONE)].insert(had(channel));
    }
    for (const cJSON *channel : channels) {
      int64_t before = had(channel), sampler = whole(channel, "sampler", NONE);
      if (before == NONE) {
        continue;
      }
      auto key = std::make_pair(sampler, before);
      if (!fresh.count(key)) {
        const cJSON *old = element(samplers, sampler, "sampler");
        double output = static_cast<double>(widen_keys(old, static_cast<size_t>(before)));
        if (users[sampler].size() == 1) {
          set(editable(old), "output", output);
          fresh[key] = sampler;
        } else {
          cJSON *copy = made(cJSON_Duplicate(old, 1));
          fresh[key] = append(array_in(animation, "samplers"), copy);
          set(copy, "output", output);
        }
      }
      set(editable(channel), "sampler", static_cast<double>(fresh[key]));
    }
  }

  /* One channel a node; existing targets keep their default weights. */
  bool add_animation() const {
    Floats times{Charged<float>(ctx)};
    for (int32_t k = 0; k < shapes.key_count; k++) {
      times.push_back(static_cast<float>(shapes.key_times[k]));
    }
    cJSON *animation = nullptr;
    int64_t input = NONE;
    for (size_t n = 0; n < nodes.size(); n++) {
      auto mesh = widened.find(index_of(nodes[n], "mesh"));
      if (mesh == widened.end()) {
        continue;
      }
      if (!animation) {
        animation = made(cJSON_CreateObject());
        append(array_in(doc, "animations"), animation);
        set(animation, "name", cJSON_CreateString("morph"));
        input = editor->add(times, 1, false, true);
      }
      std::vector<double> rest = weights_of(nodes[n], mesh->first);
      size_t had = mesh->second;
      Floats keys{Charged<float>(ctx)};
      for (int32_t k = 0; k < shapes.key_count; k++) {
        for (size_t i = 0; i < had + more(); i++) {
          bool shown = i >= had && static_cast<int32_t>(i - had) + 1 == shapes.key_frames[k];
          keys.push_back(i < had ? static_cast<float>(rest[i]) : shown ? 1 : 0);
        }
      }
      cJSON *sampler = made(cJSON_CreateObject());
      int64_t index = append(array_in(animation, "samplers"), sampler);
      set(sampler, "input", static_cast<double>(input));
      set(sampler, "interpolation", cJSON_CreateString("LINEAR"));
      set(sampler, "output", static_cast<double>(editor->add(keys, 1, false, false)));
      cJSON *channel = made(cJSON_CreateObject()), *target = nullptr;
      append(array_in(animation, "channels"), channel);
      set(channel, "sampler", static_cast<double>(index));
      set(channel, "target", target = made(cJSON_CreateObject()));
      set(target, "node", static_cast<double>(n));
      set(target, "path", cJSON_CreateString("weights"));
    }
    return animation != nullptr;
  }

  /* Of the existing targets, as the node shows them. */
  std::vector<double> weights_of(const cJSON *node, int64_t mesh) const {
    size_t had = widened.at(mesh), all = had + more();
    std::vector<double> out(all, 0);
    if (!numbers(node, "weights", out.data(), all)) {
      const cJSON *item = cJSON_GetArrayItem(member(doc, "meshes"), static_cast<int>(mesh));
      (void)numbers(item, "weights", out.data(), all);
    }
    return out;
  }

  bool widen() {
    nodes = array_of(doc, "nodes");
    const List meshes = array_of(doc, "meshes");
    for (const auto &[mesh, had] : widened) {
      widen_defaults(editable(element(meshes, mesh, "mesh")), had, true);
    }
    for (const cJSON *node : nodes) {
      auto mesh = widened.find(index_of(node, "mesh"));
      if (mesh != widened.end()) {
        widen_defaults(editable(node), mesh->second, false);
      }
    }
    const List animations = array_of(doc, "animations");
    for (size_t i = 0; i < animations.size(); i++) {
      blaming({culprit("animations", animations, i)}, [&] { widen_animation(editable(animations[i])); });
    }
    return shapes.key_count == 0 || add_animation();
  }
};

}  // namespace

bool widen_weights(orb_context *ctx, cJSON *doc, const Buffers &buffers, const Widened &widened,
                   const orb_gltf_shapes &shapes, Editor *editor) {
  Weights weights{ctx, doc, buffers, widened, shapes, editor, {}};
  return weights.widen();
}

}  // namespace gltf
