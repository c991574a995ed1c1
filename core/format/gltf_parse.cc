#include "format/gltf_parse.hh"

#include <cstdio>

extern "C" {
#include "base/error.h"
#include "format/build.h"
#include "format/bytes.h"
#include "format/json_check.h"
}
#include "orbmorph/utf8.h"

namespace gltf {

namespace {

const size_t VALUES_MAX = 1000000; /* of a document */
const size_t VALUE_BYTES = 96;     /* that cJSON takes for each, with the overhead of malloc(), and a list of them */
const int MEMBERS_MAX = 256;       /* of an object: each look-up passes all of them */

/* Counts the separators outside strings: a bound on how many values the document has. */
size_t count_values(const unsigned char *text, size_t size) {
  size_t count = 1;
  bool quoted = false;
  for (size_t i = 0; i < size; i++) {
    unsigned char c = text[i];
    if (quoted) {
      i += c == '\\';
      quoted = c != '"';
    } else {
      quoted = c == '"';
      count += c == ',' || c == '[' || c == '{';
    }
  }
  return count;
}

/* The next number of a JSON text from *at on; numbers are outside strings. */
std::string next_number(Bytes text, size_t *at) {
  bool quoted = false;
  for (; *at < text.size; ++*at) {
    unsigned char c = text.at[*at];
    if (quoted) {
      *at += c == '\\';
      quoted = c != '"';
    } else if (c == '-' || (c >= '0' && c <= '9')) {
      break;
    } else {
      quoted = c == '"';
    }
  }
  size_t begin = *at;
  while (*at < text.size && text.at[*at] && std::strchr("0123456789+-.eE", text.at[*at])) {
    ++*at;
  }
  return {reinterpret_cast<const char *>(text.at) + begin, *at - begin};
}

/* Whether orbmorph gives a member no meaning: extras, and extensions that are nobody's standard. */
bool is_foreign(const cJSON *item, const cJSON *above) {
  auto begins = [&](const char *prefix) { return std::strncmp(item->string, prefix, 4) == 0; };
  return item->string &&
         (std::strcmp(item->string, "extras") == 0 ||
          (above->string && std::strcmp(above->string, "extensions") == 0 && !begins("KHR_") && !begins("EXT_")));
}

/* cJSON parses numbers as doubles. The whole numbers of foreign members that lose digits, such as 64-bit ids, become
 * raw text, which the writer copies. Numbers come in one order in the tree and in the text. */
void keep_digits(cJSON *doc, Bytes text) {
  std::vector<cJSON *> above;     /* at most as deep as cJSON parses, 1,000 */
  const cJSON *foreign = nullptr; /* the outermost such member around the item */
  size_t at = 0;
  for (cJSON *item = doc; item;) {
    if (cJSON_IsNumber(item)) {
      const std::string digits = next_number(text, &at);
      bool is_free = foreign || (!above.empty() && is_foreign(item, above.back()));
      if (is_free && std::fabs(item->valuedouble) >= EXACT && digits.find_first_of(".eE") == std::string::npos) {
        item->valuestring = static_cast<char *>(cJSON_malloc(digits.size() + 1));
        if (!item->valuestring) {
          throw std::bad_alloc();
        }
        std::memcpy(item->valuestring, digits.c_str(), digits.size() + 1);
        item->type = cJSON_Raw;
      }
    }
    if (item->child) {
      foreign = !foreign && !above.empty() && is_foreign(item, above.back()) ? item : foreign;
      above.push_back(item);
      item = item->child;
      continue;
    }
    while (!item->next && !above.empty()) {
      item = above.back();
      above.pop_back();
      foreign = foreign == item ? nullptr : foreign;
    }
    item = above.empty() ? nullptr : item->next;
  }
}

/* Refuses objects whose look-ups would cost too much. The reader does not look into "extras", and looks into
 * "extensions" only once. */
void check_members(const cJSON *doc) {
  std::vector<const cJSON *> above; /* at most as deep as cJSON parses, 1,000 */
  auto is = [](const cJSON *item, const char *name) { return item->string && std::strcmp(item->string, name) == 0; };
  for (const cJSON *item = doc->child; item;) {
    if (item->child && !is(item, "extras") && !is(item, "extensions")) {
      if (cJSON_IsObject(item) && cJSON_GetArraySize(item) > MEMBERS_MAX) {
        throw Fault{ORB_E_TOO_LARGE,
                    "An object of the glTF file has more than " + std::to_string(MEMBERS_MAX) + " members."};
      }
      above.push_back(item);
      item = item->child;
      continue;
    }
    while (!item->next && !above.empty()) {
      item = above.back();
      above.pop_back();
    }
    item = item->next;
  }
}

/* The JSON text and the binary chunk of a GLB. */
Bytes split_glb(const unsigned char *bytes, size_t size, Bytes *chunk, size_t *rest) {
  if (size < 20) {
    malformed("The GLB ends within its header.");
  }
  size_t length = orb_read_u32(bytes + 8, 0), text = orb_read_u32(bytes + 12, 0);
  if (orb_read_u32(bytes + 4, 0) != 2 || orb_read_u32(bytes + 16, 0) != 0x4e4f534a) {
    malformed("The GLB is not version 2, or does not begin with its JSON.");
  }
  if (length > size || length < 20 || text > length - 20) {
    malformed("The GLB announces " + std::to_string(length) + " bytes but has " + std::to_string(size) + ".");
  }
  size_t after = 20 + text;
  if (length - after >= 8 && orb_read_u32(bytes + after + 4, 0) == 0x004e4942) {
    size_t binary = orb_read_u32(bytes + after, 0);
    if (binary > length - after - 8) {
      malformed("The binary chunk of the GLB is longer than the file.");
    }
    *chunk = Bytes{bytes + after + 8, binary};
    after += 8 + binary;
  }
  *rest = length - after;
  return Bytes{bytes + 20, text};
}

/* Names the parts of the document in the error record. */
void note(orb_context *ctx, const Culprits &culprits) {
  orb_error *error = orb_context_error_edit(ctx);
  error->element_total = static_cast<int64_t>(culprits.total());
  for (const Culprit &part : culprits.kept()) {
    orb_error_element *out = &error->elements[error->element_count++];
    if (part.index == NOWHERE) {
      std::snprintf(out->where, sizeof out->where, "%s", part.list.c_str());
    } else {
      std::snprintf(out->where, sizeof out->where, "%s[%zu]", part.list.c_str(), part.index);
    }
    orb_utf8_copy(out->name, sizeof out->name, part.name.c_str());
  }
}

}  // namespace

Document::Document(orb_context *ctx, const unsigned char *bytes, size_t size, bool binary)
    : reserve_(Charged<char>(ctx)), root_(nullptr, cJSON_Delete) {
  Bytes text{bytes, size};
  if (binary) {
    text = split_glb(bytes, size, &chunk_, &rest_);
  }
  size_t values = count_values(text.at, text.size);
  if (values > VALUES_MAX) {
    throw Fault{ORB_E_TOO_LARGE, "The JSON of the glTF file has too many values."};
  }
  /* The parser's memory is not charged to the context; a block of that size, never touched, stands for it. A text may
   * be there three times and a half: as parsed, as a data: URI and, decoded, as a buffer and as an image. */
  reserve_.reserve(4 * text.size + VALUE_BYTES * values);
  const char *end = nullptr;
  root_.reset(cJSON_ParseWithLengthOpts(reinterpret_cast<const char *>(text.at), text.size, &end, 0));
  if (!root_ && orb_json_begins(reinterpret_cast<const char *>(text.at), text.size)) {
    throw std::bad_alloc();
  }
  if (!root_) {
    int64_t at = end ? reinterpret_cast<const unsigned char *>(end) - bytes : static_cast<int64_t>(size);
    (void)orb_build_malformed(ctx, 0, at, "The JSON of the glTF file is not valid.");
    throw Passed{ORB_E_MALFORMED_MESH};
  }
  check_members(root_.get());
  keep_digits(root_.get(), text);
}

orb_status status_of_exception(orb_context *ctx, size_t size) {
  orb_status status = ORB_E_INTERNAL;
  try {
    throw;
  } catch (const Passed &passed) {
    status = passed.status;
  } catch (const Fault &fault) {
    status = fault.status == ORB_E_MALFORMED_MESH
                 ? orb_build_malformed(ctx, 0, static_cast<int64_t>(size), "%s", fault.detail.c_str())
                 : orb_fail(ctx, fault.status, "%s", fault.detail.c_str());
    note(ctx, fault.culprits);
  } catch (const std::bad_alloc &) {
    status = orb_fail(ctx, ORB_E_NO_MEMORY, "The machine is out of memory for the glTF file.");
  } catch (const std::exception &error) {
    status = orb_build_malformed(ctx, 0, static_cast<int64_t>(size), "The glTF file is not valid: %s", error.what());
  }
  return status;
}

}  // namespace gltf
