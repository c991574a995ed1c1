#include "format/gltf_edit.hh"

extern "C" {
#include "format/glb_text.h"
#include "format/gltf_document.h"
#include "format/gltf_write.h"
}

namespace gltf {

namespace {

size_t padding(size_t size) {
  return (4 - size % 4) % 4;
}

void write_value(orb_glb_writer *w, const cJSON *item) {
  if (cJSON_IsRaw(item)) { /* see keep_digits() */
    orb_glb_text(w, item->valuestring);
  } else if (cJSON_IsString(item)) {
    orb_glb_quoted(w, "", item->valuestring);
  } else if (cJSON_IsNumber(item)) {
    double value = item->valuedouble;
    if (!std::isfinite(value)) {
      malformed("A number of the glTF file is too large.");
    }
    if (value >= 0 && value < EXACT && value == std::floor(value)) {
      orb_glb_integer(w, "", static_cast<size_t>(value));
    } else {
      orb_glb_number(w, "", value);
    }
  } else {
    orb_glb_text(w, cJSON_IsTrue(item) ? "true" : cJSON_IsFalse(item) ? "false" : "null");
  }
}

/* All digits of all numbers, unlike cJSON's own printer. */
void write_json(orb_glb_writer *w, const cJSON *root) {
  std::vector<const cJSON *> above; /* at most as deep as cJSON parses, 1,000, and a few more */
  for (const cJSON *item = root; item;) {
    if (!above.empty() && item != above.back()->child) {
      orb_glb_text(w, ",");
    }
    if (!above.empty() && cJSON_IsObject(above.back())) {
      orb_glb_quoted(w, "", item->string);
      orb_glb_text(w, ":");
    }
    bool is_list = cJSON_IsObject(item) || cJSON_IsArray(item);
    if (is_list) {
      orb_glb_text(w, cJSON_IsObject(item) ? "{" : "[");
    } else {
      write_value(w, item);
    }
    must(w->status);
    if (is_list && item->child) {
      above.push_back(item);
      item = item->child;
      continue;
    }
    if (is_list) {
      orb_glb_text(w, cJSON_IsObject(item) ? "}" : "]");
    }
    while (!above.empty() && !item->next) {
      item = above.back();
      above.pop_back();
      orb_glb_text(w, cJSON_IsObject(item) ? "}" : "]");
    }
    item = above.empty() ? nullptr : item->next;
  }
}

}  // namespace

void set(cJSON *object, const char *key, cJSON *value) {
  made(value);
  bool fine = member(object, key) ? cJSON_ReplaceItemInObjectCaseSensitive(object, key, value)
                                  : cJSON_AddItemToObject(object, key, value);
  if (!fine) {
    cJSON_Delete(value);
    throw std::bad_alloc();
  }
}

void set(cJSON *object, const char *key, double value) {
  set(object, key, cJSON_CreateNumber(value));
}

void push(cJSON *array, cJSON *value) {
  if (!cJSON_AddItemToArray(array, made(value))) {
    cJSON_Delete(value);
    throw std::bad_alloc();
  }
}

int64_t append(cJSON *array, cJSON *value) {
  int64_t index = cJSON_GetArraySize(array);
  push(array, value);
  return index;
}

cJSON *array_in(cJSON *object, const char *key) {
  if (!member(object, key)) {
    set(object, key, cJSON_CreateArray());
  }
  if (!cJSON_IsArray(member(object, key))) {
    malformed(std::string("The glTF member \"") + key + "\" is not an array.");
  }
  return editable(member(object, key));
}

Editor::Editor(orb_context *ctx, cJSON *doc, Bytes first)
    : ctx_(ctx),
      doc_(doc),
      accessors_(array_in(doc, "accessors")),
      views_(array_in(doc, "bufferViews")),
      accessor_count_(cJSON_GetArraySize(accessors_)),
      view_count_(cJSON_GetArraySize(views_)),
      first_(first) {}

size_t Editor::add_bytes(const void *bytes, size_t size) {
  static const unsigned char zeros[4] = {0, 0, 0, 0};
  must(orb_context_check(ctx_));
  must(orb_buffer_append(ctx_, &added_, zeros, padding(added_.size)));
  size_t start = first_.size + padding(first_.size) + added_.size;
  must(orb_buffer_append(ctx_, &added_, bytes, size));
  return start;
}

int64_t Editor::add_view(const void *bytes, size_t size, int target, size_t stride) {
  size_t start = add_bytes(bytes, size);
  cJSON *view = made(cJSON_CreateObject());
  push(views_, view);
  set(view, "buffer", 0.0);
  set(view, "byteOffset", static_cast<double>(start));
  set(view, "byteLength", static_cast<double>(size));
  if (stride) {
    set(view, "byteStride", static_cast<double>(stride));
  }
  if (target) {
    set(view, "target", static_cast<double>(target));
  }
  return view_count_++;
}

int64_t Editor::add_list(const void *bytes, size_t size, int component_type, size_t count, const char *type,
                         bool attribute) {
  int64_t view = add_view(bytes, size, attribute ? ORB_GLTF_ARRAY_BUFFER : 0);
  cJSON *accessor = newest_ = made(cJSON_CreateObject());
  push(accessors_, accessor);
  set(accessor, "bufferView", static_cast<double>(view));
  set(accessor, "componentType", static_cast<double>(component_type));
  set(accessor, "count", static_cast<double>(count));
  set(accessor, "type", cJSON_CreateString(type));
  return accessor_count_++;
}

int64_t Editor::add(const Floats &values, size_t width, bool attribute, bool bounded) {
  static const char *const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  int64_t number = add_list(values.data(), values.size() * sizeof(float), ORB_GLTF_FLOAT, values.size() / width,
                            types[width - 1], attribute);
  if (bounded) {
    double low[4], high[4];
    for (size_t k = 0; k < width; k++) {
      float least = values[k], greatest = values[k];
      for (size_t i = k; i < values.size(); i += width) {
        least = std::min(least, values[i]);
        greatest = std::max(greatest, values[i]);
      }
      low[k] = static_cast<double>(least);
      high[k] = static_cast<double>(greatest);
    }
    set(newest_, "min", cJSON_CreateDoubleArray(low, static_cast<int>(width)));
    set(newest_, "max", cJSON_CreateDoubleArray(high, static_cast<int>(width)));
  }
  return number;
}

void Editor::write(orb_buffer *out) {
  orb_buffer json = {};
  struct Guard {
    orb_context *ctx;
    orb_buffer *buffer;
    ~Guard() { orb_buffer_free(ctx, buffer); }
  } guard{ctx_, &json};
  static const unsigned char zeros[4] = {0, 0, 0, 0};
  size_t binary = first_.size + padding(first_.size) + added_.size;
  cJSON *buffer = cJSON_GetArrayItem(array_in(doc_, "buffers"), 0);
  set(buffer, "byteLength", static_cast<double>(binary));
  cJSON_DeleteItemFromObjectCaseSensitive(buffer, "uri");
  orb_glb_writer w = {ctx_, &json, ORB_OK};
  write_json(&w, doc_);
  must(w.status);
  must(orb_glb_head(ctx_, &json, binary, out));
  must(orb_buffer_append(ctx_, out, first_.at, first_.size));
  must(orb_buffer_append(ctx_, out, zeros, padding(first_.size)));
  must(orb_buffer_append(ctx_, out, added_.data, added_.size));
  must(orb_buffer_append(ctx_, out, zeros, padding(binary)));
}

}  // namespace gltf
