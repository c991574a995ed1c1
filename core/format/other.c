#include "format/other.h"

#include <string.h>

#include "format/bytes.h"
#include "format/text.h"

#define EXPORT "; open it in Blender or the program that made it, and export it as glTF (.glb)"
#define CLOUD ", a cloud of points; make a surface of it, and send that"

/* The first bytes of files. The longer signatures come first where one begins another. */
static const struct {
  const char *signature;
  size_t length;
  const char *what;
} OTHERS[] = {
    {"Kaydara FBX Binary", 18, "an FBX file" EXPORT},
    {"; FBX", 5, "an FBX file" EXPORT},
    {"BLENDER", 7, "a Blender file; export the object as glTF (.glb)"},
    {"PXR-USDC", 8, "a USD file" EXPORT},
    {"#usda", 5, "a USD file" EXPORT},
    {"ISO-10303-21", 12, "a STEP file, which holds curved surfaces; export a triangle mesh, as STL or glTF"},
    {"#VRML", 5, "a VRML file" EXPORT},
    {"#X3D", 4, "an X3D file" EXPORT},
    {"# vtk DataFile", 14, "a VTK file; save the surface as PLY or STL"},
    {"# .PCD", 6, "a PCD file" CLOUD},
    {"LASF", 4, "a LAS file" CLOUD},
    {"3D Geometry File Format", 23, "a Rhino file; export a mesh, as OBJ or glTF"},
    {"\xff\xfe\xff\x0eS", 5, "a SketchUp file; export it as glTF (.glb)"},
    {"QC4DC4D", 7, "a Cinema 4D file; export the object as glTF (.glb)"},
    {"FOR4", 4, "a Maya scene; export the object as glTF or OBJ"},
    {"FOR8", 4, "a Maya scene; export the object as glTF or OBJ"},
    {"xof 0", 5, "a DirectX file" EXPORT},
    {"Ogawa", 5, "an Alembic file; export one frame as OBJ or glTF"},
    {"DRACO", 5, "a bare Draco file; send the GLB that contains it, or decode it to PLY"},
    {"//Maya ASCII", 12, "a Maya scene; export the object as glTF or OBJ"},
    {"\xd0\xcf\x11\xe0", 4, "a 3ds Max or Office file; export the object as glTF or OBJ"},
    {"PK\3\4", 4, "a ZIP archive without a 3MF model, or a cut one; unpack it, or export the model as STL or glTF"},
    {"\x1f\x8b", 2, "a gzip archive; unpack it"},
    {"7z\xbc\xaf", 4, "a 7z archive; unpack it"},
    {"Rar!", 4, "a RAR archive; unpack it"},
    {"\x89PNG", 4, "a PNG picture; send a triangle mesh"},
    {"\xff\xd8\xff", 3, "a JPEG picture; send a triangle mesh"},
    {"GIF8", 4, "a GIF picture; send a triangle mesh"},
    {"%PDF", 4, "a PDF document; send a triangle mesh"},
};

/* XML and HTML are named by a word near their beginning. */
static const struct {
  const char *word, *what;
} DOCUMENTS[] = {
    {"<COLLADA", "a Collada file" EXPORT},
    {"<X3D", "an X3D file" EXPORT},
    {"<amf", "an AMF file" EXPORT},
    {"<VTKFile", "a VTK file; save the surface as PLY or STL"},
    {"<html", "a web page, not the file behind it; download the mesh itself"},
    {"<HTML", "a web page, not the file behind it; download the mesh itself"},
    {"<svg", "an SVG drawing; send a triangle mesh"},
};

enum { SEARCHED = 2048 };

static int contains(const unsigned char *bytes, size_t size, const char *word) {
  size_t length = strlen(word);
  for (size_t i = 0; i + length <= size && i < SEARCHED; i++) {
    if (memcmp(bytes + i, word, length) == 0) {
      return 1;
    }
  }
  return 0;
}

/* 3DS: a chunk that is the whole file. */
static int is_3ds(const unsigned char *bytes, size_t size) {
  return size >= 6 && memcmp(bytes, "MM", 2) == 0 && orb_read_u32(bytes + 2, 0) == size;
}

/* A ZIP archive whose first file is a USD scene. */
static int is_usdz(const unsigned char *bytes, size_t size) {
  return size >= 30 && memcmp(bytes, "PK\3\4", 4) == 0 && contains(bytes + 30, size - 30, ".usd");
}

/* "0" on a line, then "SECTION". */
static int is_dxf(const unsigned char *bytes, size_t size) {
  return size >= 10 && bytes[0] == '0' && orb_is_eol(bytes[1]) &&
         contains(bytes + 1, size < 16 ? size - 1 : 15, "SECTION");
}

/* A list of objects or lists, from its bracket on. */
static int is_json_list(const unsigned char *bytes, size_t size) {
  size_t at = 1;
  while (at < size && bytes[at] <= ' ') {
    at++;
  }
  return at < size && bytes[0] == '[' && (bytes[at] == '{' || bytes[at] == '[');
}

const char *orb_format_other(const unsigned char *bytes, size_t size) {
  if (is_3ds(bytes, size)) {
    return "a 3DS file" EXPORT;
  }
  if (is_usdz(bytes, size)) {
    return "a USDZ file" EXPORT;
  }
  for (size_t i = 0; i < sizeof OTHERS / sizeof *OTHERS; i++) {
    if (size >= OTHERS[i].length && memcmp(bytes, OTHERS[i].signature, OTHERS[i].length) == 0) {
      return OTHERS[i].what;
    }
  }
  size_t at = 0;
  while (at < size && (bytes[at] <= ' ' || bytes[at] >= 0x80)) { /* blanks and a byte order mark */
    at++;
  }
  if (is_dxf(bytes + at, size - at)) {
    return "a DXF file" EXPORT;
  }
  if (is_json_list(bytes + at, size - at)) {
    return "a list in JSON, such as landmarks; send those as \"landmarks\" of a supermesh, or with --landmarks";
  }
  for (size_t i = 0; at < size && bytes[at] == '<' && i < sizeof DOCUMENTS / sizeof *DOCUMENTS; i++) {
    if (contains(bytes + at, size - at, DOCUMENTS[i].word)) {
      return DOCUMENTS[i].what;
    }
  }
  return NULL;
}
