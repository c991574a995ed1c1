/* Values of a glTF document: errors, members of objects, arrays, data: URIs. Errors inside the reader are exceptions,
 * which end in gltf.cc. */
#ifndef ORB_FORMAT_GLTF_VALUES_HH
#define ORB_FORMAT_GLTF_VALUES_HH

#include <cjson/cJSON.h>
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <new>
#include <string>
#include <type_traits>
#include <vector>

#include "orbmorph/context.h"

namespace gltf {

const double EXACT = 9007199254740992; /* 2⁵³: whole numbers below have all their digits */

using List = std::vector<const cJSON *>;

const size_t NOWHERE = SIZE_MAX; /* the index of a part that the document does not have */

/* Parts of a document, such as {"meshes", 0, name}, that a refusal is about. */
struct Culprit {
  std::string list;
  size_t index;
  std::string name;
};

/* The parts that a refusal names: all are counted, and the first ORB_ERROR_ITEMS kept. */
class Culprits {
 public:
  Culprits() = default;
  Culprits(std::initializer_list<Culprit> parts) {
    for (const Culprit &part : parts) {
      add(part);
    }
  }
  void add(const Culprit &part) {
    if (total_++ < ORB_ERROR_ITEMS) {
      kept_.push_back(part);
    }
  }
  bool empty() const { return total_ == 0; }
  size_t total() const { return total_; }
  const std::vector<Culprit> &kept() const { return kept_; }

 private:
  size_t total_ = 0;
  std::vector<Culprit> kept_;
};

/* A document that is refused. */
struct Fault {
  orb_status status;
  std::string detail;
  Culprits culprits;

  Fault(orb_status why, std::string text, Culprits parts = {})
      : status(why), detail(std::move(text)), culprits(std::move(parts)) {}
};

[[noreturn]] inline void malformed(const std::string &detail, Culprits culprits = {}) {
  throw Fault{ORB_E_MALFORMED_MESH, detail, std::move(culprits)};
}

/* Runs work(). A document that it refuses without naming parts is refused for these. */
template <typename Work>
void blaming(const Culprits &culprits, const Work &work) {
  try {
    work();
  } catch (Fault &fault) {
    if (fault.culprits.empty()) {
      fault.culprits = culprits;
    }
    throw;
  }
}

/* A failed call of the C side: its status becomes an exception, its error record stays. */
struct Passed {
  orb_status status;
};
inline void must(orb_status status) {
  if (status != ORB_OK) {
    throw Passed{status};
  }
}

/* Memory of the context for standard containers: what they take counts in the job's budget. */
template <typename T>
struct Charged {
  using value_type = T;
  using propagate_on_container_move_assignment = std::true_type;
  using propagate_on_container_swap = std::true_type;

  orb_context *ctx;

  explicit Charged(orb_context *context) : ctx(context) {}
  template <typename U>
  explicit Charged(const Charged<U> &other) : ctx(other.ctx) {}

  T *allocate(size_t count) {
    void *block = orb_alloc(ctx, count, sizeof(T));
    if (!block) {
      throw Passed{ORB_E_NO_MEMORY};
    }
    return static_cast<T *>(block);
  }
  void deallocate(T *block, size_t) { orb_free(ctx, block); }
  bool operator==(const Charged &other) const { return ctx == other.ctx; }
  bool operator!=(const Charged &other) const { return ctx != other.ctx; }
};

/* A list whose memory counts. */
template <typename T>
using Counted = std::vector<T, Charged<T>>;

using Numbers = Counted<double>;

const int64_t NONE = -1;

struct Bytes {
  const unsigned char *at = nullptr;
  size_t size = 0;
};

inline const cJSON *member(const cJSON *object, const char *key) {
  return cJSON_GetObjectItemCaseSensitive(object, key);
}

inline List array_of(const cJSON *object, const char *key) {
  const cJSON *array = member(object, key);
  List out;
  if (array && !cJSON_IsArray(array)) {
    malformed(std::string("The glTF member \"") + key + "\" is not an array.");
  }
  for (const cJSON *item = array ? array->child : nullptr; item; item = item->next) {
    out.push_back(item);
  }
  return out;
}

/* A whole number that is not negative, or `fallback` where the member is absent. */
inline int64_t whole(const cJSON *object, const char *key, int64_t fallback) {
  const cJSON *item = member(object, key);
  if (!item) {
    return fallback;
  }
  double value = cJSON_IsNumber(item) ? item->valuedouble : -1;
  if (!(value >= 0 && value < 9e15) || value != std::floor(value)) {
    malformed(std::string("The glTF member \"") + key + "\" is not a whole number.");
  }
  return static_cast<int64_t>(value);
}

/* The index that an object names; −1 if it names none, or not by a whole number. */
inline int64_t index_of(const cJSON *object, const char *key) {
  const cJSON *item = member(object, key);
  double value = cJSON_IsNumber(item) ? item->valuedouble : -1;
  return value >= 0 && value <= INT32_MAX && value == std::floor(value) ? static_cast<int64_t>(value) : NONE;
}

inline const cJSON *element(const List &list, int64_t index, const char *what) {
  if (index < 0 || index >= static_cast<int64_t>(list.size()) || !cJSON_IsObject(list[static_cast<size_t>(index)])) {
    malformed(std::string("The glTF file refers to a missing ") + what + " (" + std::to_string(index) + ").");
  }
  return list[static_cast<size_t>(index)];
}

inline std::string text_of(const cJSON *object, const char *key) {
  const cJSON *item = member(object, key);
  return cJSON_IsString(item) ? std::string(item->valuestring) : std::string();
}

/* A part of the document in a list of it. */
inline Culprit culprit(const char *list, const List &items, size_t index) {
  return {list, index, index < items.size() ? text_of(items[index], "name") : std::string()};
}

/* A mesh and the nodes that have it. */
inline Culprits mesh_and_nodes(const cJSON *doc, size_t mesh) {
  Culprits out{culprit("meshes", array_of(doc, "meshes"), mesh)};
  const List nodes = array_of(doc, "nodes");
  for (size_t n = 0; n < nodes.size(); n++) {
    if (index_of(nodes[n], "mesh") == static_cast<int64_t>(mesh)) {
      out.add(culprit("nodes", nodes, n));
    }
  }
  return out;
}

/* Reads an array member of exactly `count` numbers; false where it is absent. */
inline bool numbers(const cJSON *object, const char *key, double *out, size_t count) {
  if (!member(object, key)) {
    return false;
  }
  List items = array_of(object, key);
  if (items.size() != count) {
    malformed(std::string("The glTF member \"") + key + "\" has the wrong number of elements.");
  }
  for (size_t i = 0; i < count; i++) {
    if (!cJSON_IsNumber(items[i])) {
      malformed(std::string("The glTF member \"") + key + "\" contains something that is not a number.");
    }
    out[i] = items[i]->valuedouble;
  }
  return true;
}

inline std::vector<unsigned char> decode_base64(const std::string &uri, size_t from) {
  std::vector<unsigned char> out;
  out.reserve((uri.size() - from) / 4 * 3 + 3);
  uint32_t bits = 0;
  int have = 0;
  for (size_t i = from; i < uri.size() && uri[i] != '='; i++) {
    char c = uri[i];
    int value = c >= 'A' && c <= 'Z'   ? c - 'A'
                : c >= 'a' && c <= 'z' ? c - 'a' + 26
                : c >= '0' && c <= '9' ? c - '0' + 52
                : c == '+' || c == '-' ? 62
                : c == '/' || c == '_' ? 63
                                       : -1;
    if (value < 0) {
      malformed("A data: URI of the glTF file is not base64.");
    }
    bits = bits << 6 | static_cast<uint32_t>(value);
    have += 6;
    if (have >= 8) {
      have -= 8;
      out.push_back(static_cast<unsigned char>(bits >> have));
    }
  }
  return out;
}

/* The content of a data: URI. */
inline std::vector<unsigned char> decode_uri(const std::string &uri) {
  size_t comma = uri.find(',');
  if (comma == std::string::npos || uri.rfind(";base64", comma) == std::string::npos) {
    malformed("A data: URI of the glTF file is not base64.");
  }
  return decode_base64(uri, comma + 1);
}

}  // namespace gltf

#endif
