/* Values of a glTF document: errors, members of objects, arrays, data: URIs, matrices, components. Only gltf.cc
 * includes this. */
#ifndef ORB_FORMAT_GLTF_VALUES_HH
#define ORB_FORMAT_GLTF_VALUES_HH

#include <cjson/cJSON.h>
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "orbmorph/context.h"

namespace {

using List = std::vector<const cJSON *>;

/* A document that is refused. */
struct Fault {
  orb_status status;
  std::string detail;
};

[[noreturn]] void malformed(const std::string &detail) {
  throw Fault{ORB_E_MALFORMED_MESH, detail};
}

/* A failed call of the C side: its status becomes an exception, its error record stays. */
struct Passed {
  orb_status status;
};
void must(orb_status status) {
  if (status != ORB_OK) {
    throw Passed{status};
  }
}

const int64_t NONE = -1;
const size_t VALUES_MAX = 1000000;  /* of a document: cJSON takes 64 bytes or more for each */
const size_t STRIDE_MAX = 1u << 20; /* bytes between elements that are accepted; glTF itself allows 252 at most */

struct Bytes {
  const unsigned char *at = nullptr;
  size_t size = 0;
};

const cJSON *member(const cJSON *object, const char *key) {
  return cJSON_GetObjectItemCaseSensitive(object, key);
}

List array_of(const cJSON *object, const char *key) {
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
int64_t whole(const cJSON *object, const char *key, int64_t fallback) {
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

const cJSON *element(const List &list, int64_t index, const char *what) {
  if (index < 0 || index >= static_cast<int64_t>(list.size()) || !cJSON_IsObject(list[static_cast<size_t>(index)])) {
    malformed(std::string("The glTF file refers to a missing ") + what + " (" + std::to_string(index) + ").");
  }
  return list[static_cast<size_t>(index)];
}

std::string text_of(const cJSON *object, const char *key) {
  const cJSON *item = member(object, key);
  return cJSON_IsString(item) ? std::string(item->valuestring) : std::string();
}

/* Reads an array member of exactly `count` numbers; false where it is absent. */
bool numbers(const cJSON *object, const char *key, double *out, size_t count) {
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

std::vector<unsigned char> decode_base64(const std::string &uri, size_t from) {
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
std::vector<unsigned char> decode_uri(const std::string &uri) {
  size_t comma = uri.find(',');
  if (comma == std::string::npos || uri.rfind(";base64", comma) == std::string::npos) {
    malformed("A data: URI of the glTF file is not base64.");
  }
  return decode_base64(uri, comma + 1);
}

struct Matrix {
  double m[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; /* column-major */
  bool identity = true;

  double at(int row, int column) const { return m[4 * column + row]; }

  double determinant() const {
    return at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
           at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
           at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  }

  void point(const double p[3], double out[3]) const {
    for (int i = 0; i < 3; i++) {
      out[i] = identity ? p[i] : at(i, 0) * p[0] + at(i, 1) * p[1] + at(i, 2) * p[2] + at(i, 3);
    }
  }

  /* By the cofactors: the inverse transpose up to scale, defined for singular matrices too. */
  void normal(const double n[3], double out[3]) const {
    double sign = determinant() < 0 ? -1 : 1;
    for (int i = 0; i < 3; i++) {
      int a = (i + 1) % 3, b = (i + 2) % 3;
      double sum = 0;
      for (int j = 0; j < 3; j++) {
        int c = (j + 1) % 3, d = (j + 2) % 3;
        sum += (at(a, c) * at(b, d) - at(a, d) * at(b, c)) * n[j];
      }
      out[i] = identity ? n[i] : sign * sum;
    }
  }
};

Matrix operator*(const Matrix &a, const Matrix &b) {
  if (a.identity) {
    return b;
  }
  if (b.identity) {
    return a;
  }
  Matrix out;
  out.identity = false;
  for (int column = 0; column < 4; column++) {
    for (int row = 0; row < 4; row++) {
      double sum = 0;
      for (int k = 0; k < 4; k++) {
        sum += a.at(row, k) * b.at(k, column);
      }
      out.m[4 * column + row] = sum;
    }
  }
  return out;
}

Matrix matrix_of(const cJSON *node) {
  Matrix out;
  if (!numbers(node, "matrix", out.m, 16)) {
    double t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    numbers(node, "translation", t, 3);
    numbers(node, "rotation", q, 4);
    numbers(node, "scale", s, 3);
    double x = q[0], y = q[1], z = q[2], w = q[3];
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w),     2 * (x * z - y * w),
                         2 * (x * y - z * w),     1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
                         2 * (x * z + y * w),     2 * (y * z - x * w),     1 - 2 * (x * x + y * y)};
    for (int column = 0; column < 3; column++) {
      for (int row = 0; row < 3; row++) {
        out.m[4 * column + row] = r[3 * column + row] * s[column];
      }
      out.m[12 + column] = t[column];
    }
  }
  const Matrix one;
  out.identity = std::memcmp(out.m, one.m, sizeof out.m) == 0;
  return out;
}

int component_size(int64_t type) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      malformed("A glTF accessor has an unknown component type.");
  }
}

double component(const unsigned char *p, int64_t type, bool normalized) {
  switch (type) {
    case 5120: {
      double value = static_cast<signed char>(*p);
      return normalized ? std::fmax(value / 127, -1) : value;
    }
    case 5121:
      return normalized ? *p / 255.0 : *p;
    case 5122: {
      double value = static_cast<int16_t>(orb_read_u16(p, 0));
      return normalized ? std::fmax(value / 32767, -1) : value;
    }
    case 5123:
      return normalized ? orb_read_u16(p, 0) / 65535.0 : orb_read_u16(p, 0);
    case 5125:
      return orb_read_u32(p, 0);
    default:
      return orb_read_f32(p, 0);
  }
}

}  // namespace

#endif
