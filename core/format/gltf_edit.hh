/* Editing a glTF document: members, accessors at the end of its first buffer, and the text. */
#ifndef ORB_FORMAT_GLTF_EDIT_HH
#define ORB_FORMAT_GLTF_EDIT_HH

#include "format/gltf_accessor.hh"

namespace gltf {

using Floats = Counted<float>;

/* A value that was just made; NULL: the parser's memory is spent. */
inline cJSON *made(cJSON *item) {
  if (!item) {
    throw std::bad_alloc();
  }
  return item;
}

/* What was read is const to its readers, not to those who edit it. */
inline cJSON *editable(const cJSON *item) {
  return const_cast<cJSON *>(item);
}

/* Adds a member, or replaces it at its place. */
void set(cJSON *object, const char *key, cJSON *value);
void set(cJSON *object, const char *key, double value);

/* Appends to an array. O(1). */
void push(cJSON *array, cJSON *value);

/* The same; returns the index, for which it counts the array. */
int64_t append(cJSON *array, cJSON *value);

/* The array of this name; made if it is absent. */
cJSON *array_in(cJSON *object, const char *key);

/* The elements of a document's array, which grows. */
class Editor {
 public:
  /* first: the bytes of the first buffer, which stay. */
  Editor(orb_context *ctx, cJSON *doc, Bytes first);
  ~Editor() { orb_buffer_free(ctx_, &added_); }
  Editor(const Editor &) = delete;
  Editor &operator=(const Editor &) = delete;

  /* Adds an accessor of float32 with a view of its own, and returns its number. attribute: of vertices; bounded: with
   * min and max. */
  int64_t add(const Floats &values, size_t width, bool attribute, bool bounded);

  /* Adds an accessor of a glTF type such as "MAT4" over any bytes; returns its number. */
  int64_t add_list(const void *bytes, size_t size, int component_type, size_t count, const char *type, bool attribute);

  /* Adds a view; returns its number. target, stride 0: none. */
  int64_t add_view(const void *bytes, size_t size, int target, size_t stride = 0);

  /* Appends to the first buffer; returns where, a multiple of 4. */
  size_t add_bytes(const void *bytes, size_t size);

  /* Appends the GLB. */
  void write(orb_buffer *out);

 private:
  orb_context *ctx_;
  cJSON *doc_, *accessors_, *views_, *newest_ = nullptr; /* newest: of the accessors */
  int64_t accessor_count_, view_count_;
  Bytes first_;
  orb_buffer added_ = {};
};

}  // namespace gltf

#endif
