#include "format/ply_header.h"

#include <string.h>

#include "base/check.h"

static const struct {
  const char *name;
  ply_type type;
} TYPES[] = {{"char", PLY_I8},   {"uchar", PLY_U8},   {"short", PLY_I16},   {"ushort", PLY_U16},
             {"int", PLY_I32},   {"uint", PLY_U32},   {"float", PLY_F32},   {"double", PLY_F64},
             {"int8", PLY_I8},   {"uint8", PLY_U8},   {"int16", PLY_I16},   {"uint16", PLY_U16},
             {"int32", PLY_I32}, {"uint32", PLY_U32}, {"float32", PLY_F32}, {"float64", PLY_F64}};

static const struct {
  const char *name;
  ply_role role;
} ROLES[] = {{"x", PLY_X},
             {"y", PLY_Y},
             {"z", PLY_Z},
             {"nx", PLY_NX},
             {"ny", PLY_NY},
             {"nz", PLY_NZ},
             {"red", PLY_RED},
             {"green", PLY_GREEN},
             {"blue", PLY_BLUE},
             {"alpha", PLY_ALPHA},
             {"r", PLY_RED},
             {"g", PLY_GREEN},
             {"b", PLY_BLUE},
             {"a", PLY_ALPHA},
             {"diffuse_red", PLY_RED},
             {"diffuse_green", PLY_GREEN},
             {"diffuse_blue", PLY_BLUE},
             {"s", PLY_S},
             {"t", PLY_T},
             {"u", PLY_S},
             {"v", PLY_T},
             {"texture_u", PLY_S},
             {"texture_v", PLY_T},
             {"vertex_indices", PLY_INDICES},
             {"vertex_index", PLY_INDICES}};

int orb_ply_type_size(ply_type type) {
  static const int sizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[type];
}

static orb_status malformed(orb_context *ctx, const orb_text *text, const char *what) {
  return orb_build_malformed(ctx, 1, text->line, "%s", what);
}

/* Takes the next word of this line; returns its length, 0 at the end of the line. A '#' is an ordinary letter here. */
static size_t take_word(orb_text *text, const unsigned char **word) {
  while (text->at < text->end && orb_is_blank(*text->at)) {
    text->at++;
  }
  *word = text->at;
  while ((text->at < text->end) && (*text->at > ' ')) {
    text->at++;
  }
  return (size_t)(text->at - *word);
}

static int is_word(const unsigned char *word, size_t length, const char *name) {
  return strlen(name) == length && memcmp(word, name, length) == 0;
}

static ply_type take_type(orb_text *text) {
  const unsigned char *word;
  size_t length = take_word(text, &word);
  for (size_t i = 0; i < sizeof TYPES / sizeof *TYPES; i++) {
    if (is_word(word, length, TYPES[i].name)) {
      return TYPES[i].type;
    }
  }
  return PLY_NONE;
}

static orb_status read_format(orb_context *ctx, orb_text *text, ply_header *header) {
  const unsigned char *word;
  size_t length = take_word(text, &word);
  if (is_word(word, length, "ascii")) {
    header->encoding = PLY_ASCII;
  } else if (is_word(word, length, "binary_little_endian")) {
    header->encoding = PLY_LITTLE;
  } else if (is_word(word, length, "binary_big_endian")) {
    header->encoding = PLY_BIG;
  } else {
    return malformed(ctx, text, "The PLY format is not ascii, binary_little_endian or binary_big_endian.");
  }
  length = take_word(text, &word);
  return is_word(word, length, "1.0") ? ORB_OK : malformed(ctx, text, "The PLY version is not 1.0.");
}

static orb_status read_element(orb_context *ctx, orb_text *text, ply_header *header) {
  const unsigned char *word;
  size_t length = take_word(text, &word);
  if (header->elements == PLY_ELEMENTS_MAX) {
    return malformed(ctx, text, "The PLY header has too many elements.");
  }
  ply_element *element = &header->element[header->elements++];
  *element = (ply_element){.first = header->properties};
  element->kind = is_word(word, length, "vertex")      ? PLY_VERTICES
                  : is_word(word, length, "face")      ? PLY_FACES
                  : is_word(word, length, "tristrips") ? PLY_STRIPS
                                                       : PLY_SKIP;
  if (!orb_text_blanks(text) || !orb_text_integer(text, &element->count) || element->count < 0) {
    return malformed(ctx, text, "A PLY element lacks its count.");
  }
  return ORB_OK;
}

static orb_status read_property(orb_context *ctx, orb_text *text, ply_header *header) {
  const unsigned char *word;
  if (header->elements == 0) {
    return malformed(ctx, text, "A PLY property comes before the first element.");
  }
  if (header->properties == PLY_PROPERTIES_MAX) {
    return malformed(ctx, text, "The PLY header has too many properties.");
  }
  ply_element *element = &header->element[header->elements - 1];
  ply_property *property = &header->property[header->properties++];
  *property = (ply_property){0};
  element->properties++;
  orb_text before = *text;
  size_t length = take_word(text, &word);
  if (is_word(word, length, "list")) {
    property->count_type = take_type(text);
    if (property->count_type == PLY_NONE || property->count_type >= PLY_F32) {
      return malformed(ctx, text, "A PLY list has no integer type for its length.");
    }
  } else {
    *text = before;
  }
  property->type = take_type(text);
  if (property->type == PLY_NONE) {
    return malformed(ctx, text, "A PLY property has an unknown type.");
  }
  length = take_word(text, &word);
  if (length == 0) {
    return malformed(ctx, text, "A PLY property lacks its name.");
  }
  for (size_t i = 0; i < sizeof ROLES / sizeof *ROLES; i++) {
    int is_list = property->count_type != PLY_NONE;
    if (is_word(word, length, ROLES[i].name) && is_list == (ROLES[i].role == PLY_INDICES) &&
        !(element->roles & 1u << ROLES[i].role)) {
      property->role = ROLES[i].role;
      element->roles |= 1u << property->role;
    }
  }
  return ORB_OK;
}

static orb_status check_header(orb_context *ctx, const orb_text *text, ply_header *header) {
  const unsigned place = 1u << PLY_X | 1u << PLY_Y | 1u << PLY_Z;
  int vertices = 0, faces = 0;
  for (int i = 0; i < header->elements; i++) {
    ply_element *element = &header->element[i];
    if (element->kind == PLY_VERTICES) {
      if ((element->roles & place) != place) {
        return malformed(ctx, text, "The PLY vertices lack x, y or z.");
      }
      vertices++;
    } else if (element->kind == PLY_FACES || element->kind == PLY_STRIPS) {
      if (element->count > 0 && !(element->roles & 1u << PLY_INDICES)) {
        return malformed(ctx, text, "The PLY faces lack the list vertex_indices.");
      }
      faces += element->count > 0;
    }
  }
  if (vertices != 1) {
    return malformed(ctx, text, "The PLY header must have one element vertex.");
  }
  if (faces == 0) {
    return malformed(ctx, text, "The PLY file holds no faces; send a surface of polygons.");
  }
  return ORB_OK;
}

orb_status orb_ply_header(orb_context *ctx, orb_text *text, ply_header *header) {
  const unsigned char *word;
  *header = (ply_header){0};
  int has_format = 0;
  for (int first = 1;; first = 0) {
    size_t length = take_word(text, &word);
    orb_status status = ORB_OK;
    if (first) {
      status = is_word(word, length, "ply") ? ORB_OK : malformed(ctx, text, "The file does not begin with \"ply\".");
    } else if (is_word(word, length, "end_header")) {
      break;
    } else if (is_word(word, length, "format")) {
      status = read_format(ctx, text, header);
      has_format = 1;
    } else if (is_word(word, length, "element")) {
      status = read_element(ctx, text, header);
    } else if (is_word(word, length, "property")) {
      status = read_property(ctx, text, header);
    } else if (is_word(word, length, "comment")) {
      length = take_word(text, &word);
      header->names_texture |= is_word(word, length, "TextureFile");
    } else if (length > 0 && !is_word(word, length, "obj_info")) {
      status = malformed(ctx, text, "The PLY header has an unknown line.");
    }
    ORB_TRY(status);
    orb_text_skip_line(text);
    if (text->at >= text->end) {
      return malformed(ctx, text, "The file ends within the PLY header.");
    }
  }
  if (!has_format) {
    return malformed(ctx, text, "The PLY header lacks its format.");
  }
  ORB_TRY(check_header(ctx, text, header));
  orb_text_skip_line(text);
  return ORB_OK;
}
