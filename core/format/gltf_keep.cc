#include "format/gltf_keep.h"

#include <map>
#include <set>

#include "format/gltf_blocks.hh"
#include "format/gltf_named.hh"
#include "format/gltf_parse.hh"
#include "format/gltf_scene.hh"
#include "format/gltf_unpack.hh"
#include "format/gltf_weights.hh"

extern "C" {
#include "mesh/dropped.h"
#include "numeric/rotate_along.h"
}

namespace gltf {

namespace {

[[noreturn]] void refuse(const std::string &detail, Culprits culprits) {
  throw Fault{ORB_E_BAD_OPTION, detail + " Or use another method than 'template'.", std::move(culprits)};
}

/* The linear part of a matrix and its inverse, which take vectors to the scene and back. */
struct Frame {
  double to[9], back[9]; /* row-major */

  Frame(const Matrix &matrix, size_t mesh, const Culprits &culprits) {
    double determinant = matrix.determinant();
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) {
        int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
        to[3 * i + j] = matrix.at(i, j);
        back[3 * j + i] = (matrix.at(a, c) * matrix.at(b, d) - matrix.at(a, d) * matrix.at(b, c)) / determinant;
      }
    }
    for (double value : back) {
      if (!std::isfinite(value)) {
        refuse("The node of mesh " + std::to_string(mesh) +
                   " flattens it, so no target of the mesh gives a shape; give the node another scale.",
               culprits);
      }
    }
  }
};

void multiply(const double m[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; i++) {
    out[i] = m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2];
  }
}

/* v × m, which takes normals back. */
void multiply_transposed(const double m[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; i++) {
    out[i] = m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2];
  }
}

struct Keeper {
  orb_context *ctx;
  cJSON *doc;
  const orb_gltf_shapes &shapes;
  orb_gltf_kept *kept;
  List meshes;
  Buffers buffers;
  Counted<int32_t> first;  /* per mesh: the number of its first vertex */
  Counted<int32_t> showed; /* how often the scene shows it */
  Counted<Matrix> matrix;
  std::map<size_t, int64_t> zeros; /* accessors of this many vertices that stay */
  Widened widened;

  Keeper(orb_context *context, cJSON *document, const orb_gltf_shapes &given, orb_gltf_kept *facts)
      : ctx(context),
        doc(document),
        shapes(given),
        kept(facts),
        buffers(context),
        first(Charged<int32_t>(context)),
        showed(Charged<int32_t>(context)),
        matrix(Charged<Matrix>(context)) {}

  void drop(const std::string &what, const std::string &where, const char *why) const {
    must(orb_dropped_add(ctx, &kept->dropped, &kept->dropped_count, what.c_str(), where.c_str(), why));
  }

  /* How many vertices a primitive has; 0: it has no positions. */
  size_t count_of(const cJSON *primitive) const {
    int64_t index = whole(member(primitive, "attributes"), "POSITION", NONE);
    const cJSON *accessor =
        index == NONE ? nullptr : cJSON_GetArrayItem(member(doc, "accessors"), static_cast<int>(index));
    return static_cast<size_t>(whole(accessor, "count", 0));
  }

  /* Whether one of `count` vertices from `from` is on the surface. */
  bool is_on(int64_t from, size_t count) const {
    for (size_t i = 0; i < count; i++) {
      if (shapes.on_surface[from + static_cast<int64_t>(i)] >= 0) {
        return true;
      }
    }
    return false;
  }

  size_t size_of(size_t mesh) const {
    size_t count = 0;
    for (const cJSON *primitive : array_of(meshes[mesh], "primitives")) {
      count += is_surface(primitive) ? count_of(primitive) : 0;
    }
    return count;
  }

  /* Numbers the vertices as the reader does. */
  void number() {
    const Counted<Shown> shown = shown_meshes(ctx, doc, meshes.size());
    showed.assign(meshes.size(), 0);
    matrix.assign(meshes.size(), Matrix());
    for (const auto &[mesh, at, node] : shown) {
      (void)element(meshes, mesh, "mesh");
      if (showed[static_cast<size_t>(mesh)]++ == 0) {
        matrix[static_cast<size_t>(mesh)] = at;
      }
    }
    size_t next = 0;
    for (size_t m = 0; m < meshes.size(); m++) {
      first.push_back(static_cast<int32_t>(next));
      next += size_of(m);
      if (next > static_cast<size_t>(shapes.file_vertex_count)) {
        malformed("The glTF file has more vertices than were read.");
      }
    }
    kept->vertex_count = static_cast<int32_t>(next);
    std::vector<bool> seen(meshes.size(), false);
    for (const auto &[mesh, at, node] :
         shown) { /* the copies of a mesh come after all meshes, in the order of the nodes */
      size_t m = static_cast<size_t>(mesh), size = size_of(m);
      if (seen[m]) {
        if (next + size > static_cast<size_t>(shapes.file_vertex_count)) {
          malformed("The glTF file has more vertices than were read.");
        }
        if (is_on(static_cast<int64_t>(next), size)) {
          refuse_copies(m);
        }
        next += size;
      }
      seen[m] = true;
    }
  }

  [[noreturn]] void refuse_copies(size_t mesh) const {
    refuse("The scene shows " + title(mesh) + " " + std::to_string(showed[mesh]) +
               " times, and targets of a mesh move all its copies alike. Give each node a mesh of its own.",
           mesh_and_nodes(doc, mesh));
  }

  std::string title(size_t mesh) const {
    std::string name = text_of(meshes[mesh], "name").substr(0, 60);
    return "mesh " + std::to_string(mesh) + (name.empty() ? "" : " (\"" + name + "\")");
  }

  /* The surface was chosen at the upload; it must be what the request names. */
  void check_parts() const {
    if (shapes.parts.mesh_count + shapes.parts.node_count == 0) {
      return;
    }
    const std::vector<bool> named = named_meshes(doc, meshes.size(), shapes.parts);
    Culprits wrong;
    for (size_t m = 0; m < meshes.size(); m++) {
      if (is_on(first[m], size_of(m)) != named[m]) {
        wrong.add(culprit("meshes", meshes, m));
      }
    }
    if (!wrong.empty()) {
      const std::string mesh = title(wrong.kept()[0].index);
      throw Fault{ORB_E_BAD_OPTION,
                  named[wrong.kept()[0].index]
                      ? "\"template\" names " + mesh +
                            ", but the closed surface has no vertex of it. Omit it, or upload the file with "
                            "part=NAME so that it is the surface."
                      : "The closed surface has vertices of " + mesh +
                            ", which \"template\" does not name. Name it, or upload the file with part=NAME.",
                  wrong};
    }
  }

  int64_t zero_target(Editor *editor, size_t count) {
    if (!zeros.count(count)) {
      Floats none{Charged<float>(ctx)};
      none.assign(3 * count, 0);
      zeros[count] = editor->add(none, 3, true, true);
    }
    return zeros[count];
  }

  Floats room(size_t count) const {
    Floats out{Charged<float>(ctx)};
    out.assign(3 * count, 0);
    return out;
  }

  void put(const double v[3], size_t mesh, float *out) const {
    for (int k = 0; k < 3; k++) {
      out[k] = static_cast<float>(v[k]);
      if (!std::isfinite(out[k])) {
        refuse(
            "A target is too large for float32 in the coordinates of " + title(mesh) + "; give its node another scale.",
            mesh_and_nodes(doc, mesh));
      }
    }
  }

  Floats moves(size_t mesh, int64_t from, size_t count, const Frame &frame, int32_t target) const {
    Floats out = room(count);
    for (size_t i = 0; i < count; i++) {
      int64_t at = 3 * static_cast<int64_t>(shapes.on_surface[from + static_cast<int64_t>(i)]);
      if (at >= 0) {
        double way[3], local[3];
        orb_sub(shapes.positions[target + 1] + at, shapes.positions[0] + at, way);
        multiply(frame.back, way, local);
        put(local, mesh, &out[3 * i]);
      }
    }
    return out;
  }

  /* How normals (width 3) or tangents (4) rotate with the surface: by the shortest rotation of its smooth normal. */
  Floats rotated_values(size_t mesh, int64_t from, size_t count, const Frame &frame, int32_t target,
                        const Numbers &values, size_t width) const {
    Floats out = room(count);
    for (size_t i = 0; i < count; i++) {
      int64_t at = 3 * static_cast<int64_t>(shapes.on_surface[from + static_cast<int64_t>(i)]);
      const double *value = &values[width * i];
      double length = orb_length(value), seen[3], rotated[3], local[3];
      if (at < 0 || !(length > 0)) {
        continue;
      }
      const double *before = shapes.normals[0] + at, *after = shapes.normals[target + 1] + at;
      if (!(orb_dot(before, before) > 0 && orb_dot(after, after) > 0)) {
        continue;
      }
      if (width == 3) {
        matrix[mesh].normal(value, seen);
      } else {
        multiply(frame.to, value, seen);
      }
      orb_rotate_along(before, after, seen, rotated);
      if (width == 3) {
        multiply_transposed(frame.to, rotated, local);
      } else {
        multiply(frame.back, rotated, local);
      }
      orb_normalize(local);
      for (int k = 0; k < 3; k++) {
        local[k] = length * local[k] - value[k];
      }
      put(local, mesh, &out[3 * i]);
    }
    return out;
  }

  /* A program that reads the asset would fail at targets that do not fit, though they come from the upload. */
  void check_targets(const cJSON *primitive, size_t mesh, size_t count) const {
    const List accessors = array_of(doc, "accessors");
    for (const cJSON *target : array_of(primitive, "targets")) {
      for (const cJSON *item = target->child; item; item = item->next) {
        int64_t index = cJSON_IsNumber(item) ? index_of(target, item->string) : NONE;
        if (static_cast<size_t>(whole(element(accessors, index, "accessor"), "count", 0)) != count) {
          malformed("A morph target of " + title(mesh) + " has another number of vertices than its primitive.");
        }
      }
    }
  }

  void add_targets(const cJSON *primitive, size_t mesh, int64_t from, const Frame &frame, Editor *editor) {
    size_t count = count_of(primitive), width = 0;
    if (count == 0) {
      malformed("A primitive of a mesh with targets has no POSITION.");
    }
    check_targets(primitive, mesh, count);
    bool moves_it = is_surface(primitive) && is_on(from, count);
    Numbers normal{Charged<double>(ctx)}, tangent{Charged<double>(ctx)};
    if (moves_it && shapes.normals) {
      normal = buffers.attribute(primitive, "NORMAL", count, 3, 3, &width);
      tangent = buffers.attribute(primitive, "TANGENT", count, 4, 4, &width);
    }
    cJSON *targets = array_in(editable(primitive), "targets");
    for (int32_t k = 0; k < shapes.target_count; k++) {
      cJSON *target = made(cJSON_CreateObject());
      push(targets, target);
      int64_t position =
          moves_it ? editor->add(moves(mesh, from, count, frame, k), 3, true, true) : zero_target(editor, count);
      set(target, "POSITION", static_cast<double>(position));
      if (!normal.empty()) {
        Floats rotated = rotated_values(mesh, from, count, frame, k, normal, 3);
        set(target, "NORMAL", static_cast<double>(editor->add(rotated, 3, true, false)));
      }
      if (!tangent.empty()) {
        Floats rotated = rotated_values(mesh, from, count, frame, k, tangent, 4);
        set(target, "TANGENT", static_cast<double>(editor->add(rotated, 3, true, false)));
      }
    }
    int32_t attributes = 1 + !normal.empty() + !tangent.empty();
    kept->attributes = std::max(kept->attributes, attributes);
  }

  /* Names of the existing targets, then those of the new ones; equal names get a number. */
  void name_targets(cJSON *mesh, size_t index, size_t had) const {
    cJSON *extras = editable(member(mesh, "extras"));
    if (extras && !cJSON_IsObject(extras)) {
      drop("targetNames", "meshes[" + std::to_string(index) + "]", "The mesh has extras that are not an object.");
      return;
    }
    if (!extras) {
      set(mesh, "extras", extras = made(cJSON_CreateObject()));
    }
    const cJSON *old = member(extras, "targetNames");
    std::vector<std::string> names;
    std::set<std::string> taken;
    const cJSON *given = cJSON_IsArray(old) ? old->child : nullptr;
    for (size_t k = 0; k < had; k++, given = given ? given->next : nullptr) {
      names.push_back(cJSON_IsString(given) ? given->valuestring : "target " + std::to_string(k));
      taken.insert(names.back());
    }
    for (int32_t k = 0; k < shapes.target_count; k++) {
      std::string name = shapes.names[k];
      for (int again = 2; taken.count(name); again++) {
        name = std::string(shapes.names[k]) + " (" + std::to_string(again) + ")";
      }
      names.push_back(name);
      taken.insert(name);
    }
    cJSON *list = made(cJSON_CreateArray());
    set(extras, "targetNames", list);
    for (const std::string &name : names) {
      push(list, cJSON_CreateString(name.c_str()));
    }
    set(extras, "firstShape", static_cast<double>(had));
  }

  void widen_mesh(size_t m, Editor *editor) {
    const List primitives = array_of(meshes[m], "primitives");
    const Frame frame(matrix[m], m, mesh_and_nodes(doc, m));
    size_t had = 0;
    int64_t from = first[m];
    for (size_t p = 0; p < primitives.size(); p++) {
      size_t targets = array_of(primitives[p], "targets").size();
      had = p == 0 ? targets : had;
      if (targets != had) {
        malformed("The primitives of " + title(m) + " have different numbers of morph targets.");
      }
      add_targets(primitives[p], m, from, frame, editor);
      from += is_surface(primitives[p]) ? static_cast<int64_t>(count_of(primitives[p])) : 0;
    }
    widened[static_cast<int64_t>(m)] = had;
    name_targets(editable(meshes[m]), m, had);
  }

  /* Few programs read a compressed mesh with targets; the studio and the page's player do not. */
  void unpack_if_needed(Editor *editor) {
    bool is_needed = false;
    for (size_t m = 0; m < meshes.size(); m++) {
      is_needed = is_needed || (is_on(first[m], size_of(m)) && is_compressed(doc, meshes[m]));
    }
    if (is_needed) {
      unpack(ctx, doc, buffers, editor);
      drop("compression", "", "Targets belong to plain vertices; the values are those of the file.");
    }
  }

  void note_images() const {
    const List images = array_of(doc, "images");
    for (size_t i = 0; i < images.size(); i++) {
      std::string uri = text_of(images[i], "uri");
      if (!uri.empty() && uri.compare(0, 5, "data:") != 0) {
        drop("image", "images[" + std::to_string(i) + "] \"" + uri.substr(0, 100) + "\"",
             "It is in another file, which the upload does not have; the asset names it still.");
      }
    }
  }

  void keep(const Document &document, size_t size, orb_buffer *out) {
    meshes = array_of(doc, "meshes");
    buffers.load(doc, document.chunk(), size);
    Bytes bytes = buffers.buffer(0);
    if (bytes.size == 0) {
      refuse(
          "The first buffer of the glTF file has no bytes, so nothing can be added to it; send a file without a "
          "fallback for compressed data, or with that buffer last.",
          {culprit("buffers", array_of(doc, "buffers"), 0)});
    }
    number();
    check_parts();
    Editor editor(ctx, doc, bytes);
    unpack_if_needed(&editor);
    for (size_t m = 0; m < meshes.size(); m++) {
      for (const cJSON *primitive : array_of(meshes[m], "primitives")) {
        kept->primitive_count += is_surface(primitive);
      }
      if (is_on(first[m], size_of(m))) {
        if (showed[m] > 1) {
          refuse_copies(m);
        }
        blaming(mesh_and_nodes(doc, m), [&] { widen_mesh(m, &editor); });
      }
    }
    if (!widen_weights(ctx, doc, buffers, widened, shapes, &editor)) {
      drop("animation \"morph\"", "", "The document has no nodes.");
    }
    note_images();
    if (document.rest() > 0) {
      drop("chunk", "", "A GLB of the asset has a chunk of JSON and one of bytes.");
    }
    editor.write(out);
  }
};

}  // namespace

}  // namespace gltf

extern "C" orb_status orb_gltf_keep(orb_context *ctx, const unsigned char *bytes, size_t size,
                                    const orb_gltf_shapes *shapes, orb_gltf_kept *kept, orb_buffer *out) {
  *kept = orb_gltf_kept{};
  return gltf::guarded(ctx, size, [&] {
    gltf::Document document(ctx, bytes, size, size >= 4 && std::memcmp(bytes, "glTF", 4) == 0);
    gltf::Keeper keeper(ctx, document.root(), *shapes, kept);
    keeper.keep(document, size, out);
  });
}
