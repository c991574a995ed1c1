#include "format/gltf_motion.hh"

#include <map>
#include <tuple>

namespace gltf {

namespace {

struct Motion {
  const Skeleton &from;
  const Buffers &buffers;
  const Indices &number;
  const Numbers &shift;
  Editor *editor;
  Culprit animation;                                   /* that is copied */
  std::map<int64_t, std::pair<int64_t, size_t>> times; /* of an accessor: its copy, and how many keys it has */
  /* Of an accessor, by what it is read as: spline, keys, width, and node if it is shifted. */
  std::map<std::tuple<int64_t, bool, size_t, size_t, int64_t>, int64_t> keys;

  [[noreturn]] void misfit() const {
    malformed("Animation " + std::to_string(animation.index) +
              " of the glTF file moves its skeleton, and its values do not fit its times.");
  }

  Floats floats_of(const Numbers &values) const {
    Floats out{Charged<float>(from.ctx)};
    out.assign(values.begin(), values.end());
    return out;
  }

  const std::pair<int64_t, size_t> &times_of(int64_t accessor) {
    auto found = times.find(accessor);
    if (found == times.end()) {
      size_t width = 0;
      const Numbers values = buffers.accessor(accessor, &width);
      if (width != 1 || values.empty()) {
        misfit();
      }
      found =
          times.emplace(accessor, std::make_pair(editor->add(floats_of(values), 1, false, true), values.size())).first;
    }
    return found->second;
  }

  /* Of a cubic spline only the middle one of three values is a place. */
  int64_t keys_of(int64_t accessor, size_t count, bool is_spline, size_t width, int64_t node) {
    bool is_shifted = false;
    for (size_t k = 0; width == 3 && node != NONE && k < 3; k++) {
      is_shifted = is_shifted || shift[3 * static_cast<size_t>(node) + k] != 0;
    }
    auto key = std::make_tuple(accessor, is_spline, count, width, is_shifted ? node : NONE);
    auto found = keys.find(key);
    if (found == keys.end()) {
      size_t has = 0;
      Numbers values = buffers.accessor(accessor, &has);
      if (has != width || values.size() != count * width * (is_spline ? 3 : 1)) {
        misfit();
      }
      for (size_t i = 0; is_shifted && i < values.size(); i++) {
        if (!is_spline || i / 3 % 3 == 1) {
          values[i] += shift[3 * static_cast<size_t>(node) + i % 3];
        }
      }
      found = keys.emplace(key, editor->add(floats_of(values), width, false, false)).first;
    }
    return found->second;
  }

  /* A copy of a channel with a sampler of its own, the next one; false: it moves something else. */
  bool copy_channel(const cJSON *channel, const List &samplers, size_t next, cJSON *out) {
    const cJSON *target = member(channel, "target");
    int64_t node = index_of(target, "node");
    std::string path = text_of(target, "path");
    bool moves = path == "translation" || path == "rotation" || path == "scale";
    if (!moves || node < 0 || static_cast<size_t>(node) >= number.size() || number[static_cast<size_t>(node)] == NONE) {
      return false;
    }
    const cJSON *sampler = element(samplers, whole(channel, "sampler", NONE), "sampler");
    std::string way = text_of(sampler, "interpolation");
    bool is_spline = way == "CUBICSPLINE";
    auto [input, count] = times_of(whole(sampler, "input", NONE));
    int64_t output = keys_of(whole(sampler, "output", NONE), count, is_spline, path == "rotation" ? 4 : 3,
                             path == "translation" ? node : NONE);
    cJSON *made_sampler = made(cJSON_CreateObject());
    push(array_in(out, "samplers"), made_sampler);
    set(made_sampler, "input", static_cast<double>(input));
    set(made_sampler, "output", static_cast<double>(output));
    set(made_sampler, "interpolation", cJSON_CreateString(is_spline || way == "STEP" ? way.c_str() : "LINEAR"));
    cJSON *made_channel = made(cJSON_CreateObject()), *at = made(cJSON_CreateObject());
    push(array_in(out, "channels"), made_channel);
    set(made_channel, "sampler", static_cast<double>(next));
    set(made_channel, "target", at);
    set(at, "node", static_cast<double>(number[static_cast<size_t>(node)]));
    set(at, "path", cJSON_CreateString(path.c_str()));
    return true;
  }
};

struct Deleter {
  void operator()(cJSON *item) const { cJSON_Delete(item); }
};
using Owned = std::unique_ptr<cJSON, Deleter>;

/* NULL: it moves nothing of the skeleton. */
Owned copy_animation(Motion *motion, const cJSON *animation) {
  const List samplers = array_of(animation, "samplers");
  Owned copy(made(cJSON_CreateObject()));
  size_t count = 0, steps = 0;
  for (const cJSON *channel : array_of(animation, "channels")) {
    check_sometimes(motion->from.ctx, steps++);
    count += motion->copy_channel(channel, samplers, count, copy.get());
  }
  std::string name = text_of(animation, "name");
  if (!name.empty()) {
    set(copy.get(), "name", cJSON_CreateString(name.c_str()));
  }
  return count > 0 ? std::move(copy) : nullptr;
}

/* Puts them before the animations of the document. */
void put_first(std::vector<Owned> *copies, cJSON *doc) {
  const Owned old(cJSON_DetachItemFromObjectCaseSensitive(doc, "animations"));
  cJSON *list = array_in(doc, "animations");
  for (Owned &copy : *copies) {
    push(list, copy.release());
  }
  while (old && old->child) {
    push(list, cJSON_DetachItemViaPointer(old.get(), old->child));
  }
}

}  // namespace

void copy_animations(const Skeleton &from, const cJSON *source, const Buffers &buffers, const Indices &number,
                     const Numbers &shift, cJSON *doc, Editor *editor) {
  const List animations = array_of(source, "animations");
  Motion motion{from, buffers, number, shift, editor, {}, {}, {}};
  std::vector<Owned> copies;
  for (size_t i = 0; i < animations.size(); i++) {
    must(orb_context_check(from.ctx));
    motion.animation = culprit("animations", animations, i);
    blaming({motion.animation}, [&] {
      if (Owned copy = copy_animation(&motion, animations[i])) {
        copies.push_back(std::move(copy));
      }
    });
  }
  if (!copies.empty()) {
    put_first(&copies, doc);
  }
}

}  // namespace gltf
