/* Writes a scene as GLB: the JSON as text, its members in alphabetical order, then the binary chunk.
 *
 * All memory comes from the context, so that the budget counts it and a failed allocation is an error like any other.
 * (The JSON library of tinygltf, which could write this too, ends the process when an allocation fails.) */
#include "format/gltf_write.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "orbmorph/utf8.h"

enum {
  GLB_HEADER = 12,
  CHUNK_HEADER = 8,
  GLB_MAGIC = 0x46546c67,
  CHUNK_JSON = 0x4e4f534a,
  CHUNK_BINARY = 0x004e4942,
  MODE_TRIANGLES = 4,
  FILTER_LINEAR = 9729,
  FILTER_LINEAR_MIPMAP_LINEAR = 9987,
  WRAP_REPEAT = 10497,
};

/* The functions below append text until one fails; the first failure stays. */
typedef struct writer {
  orb_context *ctx;
  orb_buffer *out;
  orb_status status;
} writer;

static void put(writer *w, const void *bytes, size_t size) {
  if (w->status == ORB_OK) {
    w->status = orb_buffer_append(w->ctx, w->out, bytes, size);
  }
}

static void text(writer *w, const char *literal) {
  put(w, literal, strlen(literal));
}

/* before: the text in front of the value, with its comma or bracket and its key. */
static void integer(writer *w, const char *before, size_t value) {
  char digits[24];
  text(w, before);
  put(w, digits, (size_t)snprintf(digits, sizeof digits, "%zu", value));
}

/* As few digits as read back as the same number; with a point in every locale. */
static void number(writer *w, const char *before, double value) {
  char digits[40];
  int length = 0;
  for (int precision = 6; precision <= 17; precision++) {
    length = snprintf(digits, sizeof digits, "%.*g", precision, value);
    if (strtod(digits, NULL) == value) {
      break;
    }
  }
  text(w, before);
  for (int i = 0; i < length; i++) {
    put(w, strchr("+-0123456789e", digits[i]) ? &digits[i] : ".", 1);
  }
}

static void numbers(writer *w, const char *before, const double *values, int count) {
  text(w, before);
  for (int i = 0; i < count; i++) {
    number(w, i ? "," : "[", values[i]);
  }
  text(w, "]");
}

static void quoted(writer *w, const char *before, const char *string) {
  text(w, before);
  text(w, "\"");
  for (const unsigned char *p = (const unsigned char *)string; *p;) {
    size_t length = orb_utf8_length(p, 4);
    char escape[8];
    if (length == 0) {
      text(w, "\xef\xbf\xbd");
    } else if (*p == '"' || *p == '\\') {
      put(w, (char[]){'\\', (char)*p}, 2);
    } else if (*p < 0x20) {
      put(w, escape, (size_t)snprintf(escape, sizeof escape, "\\u%04x", *p));
    } else {
      put(w, p, length);
    }
    p += length ? length : 1;
  }
  text(w, "\"");
}

static void write_accessors(writer *w, const orb_gltf_scene *scene) {
  static const char *const shapes[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  text(w, "{\"accessors\":");
  for (int32_t i = 0; i < scene->accessor_count; i++) {
    const orb_gltf_accessor *a = &scene->accessors[i];
    ORB_ASSERT(a->components >= 1 && a->components <= 4);
    integer(w, i ? ",{\"bufferView\":" : "[{\"bufferView\":", (size_t)i);
    integer(w, ",\"componentType\":", (size_t)a->component_type);
    integer(w, ",\"count\":", (size_t)a->count);
    if (a->bounded) {
      numbers(w, ",\"max\":", a->max, a->components);
      numbers(w, ",\"min\":", a->min, a->components);
    }
    quoted(w, ",\"type\":", shapes[a->components - 1]);
    text(w, "}");
  }
  text(w, "]");
}

static void write_animation(writer *w, const orb_gltf_scene *scene) {
  if (scene->times >= 0) {
    text(w,
         ",\"animations\":[{\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"weights\"}}],"
         "\"name\":\"morph\",\"samplers\":[{");
    integer(w, "\"input\":", (size_t)scene->times);
    integer(w, ",\"interpolation\":\"LINEAR\",\"output\":", (size_t)scene->weights);
    text(w, "}]}]");
  }
}

static void write_view(writer *w, const char *before, size_t offset, size_t length, int32_t target) {
  integer(w, before, length);
  if (offset) {
    integer(w, ",\"byteOffset\":", offset);
  }
  if (target) {
    integer(w, ",\"target\":", (size_t)target);
  }
  text(w, "}");
}

/* The views of the accessors, then those of the images. */
static void write_views(writer *w, const orb_gltf_scene *scene, size_t binary_size) {
  const char *before = ",\"bufferViews\":[{\"buffer\":0,\"byteLength\":", *next = ",{\"buffer\":0,\"byteLength\":";
  for (int32_t i = 0; i < scene->accessor_count; i++, before = next) {
    write_view(w, before, scene->accessors[i].offset, scene->accessors[i].length, scene->accessors[i].target);
  }
  for (int32_t i = 0; i < scene->image_count; i++) {
    write_view(w, next, scene->images[i].offset, scene->images[i].length, 0);
  }
  integer(w, "],\"buffers\":[{\"byteLength\":", binary_size);
  text(w, "}]");
}

static void write_images(writer *w, const orb_gltf_scene *scene) {
  for (int32_t i = 0; i < scene->image_count; i++) {
    integer(w, i ? ",{\"bufferView\":" : ",\"images\":[{\"bufferView\":", (size_t)scene->accessor_count + (size_t)i);
    quoted(w, ",\"mimeType\":", scene->images[i].mime);
    text(w, i + 1 < scene->image_count ? "}" : "}]");
  }
}

static size_t or_else(int32_t value, size_t fallback) {
  return value ? (size_t)value : fallback;
}

/* The members of a sampler, with glTF's usual values where the material gives none. */
static void sampler_of(const orb_material *m, size_t out[4]) {
  out[0] = or_else(m->mag_filter, FILTER_LINEAR);
  out[1] = or_else(m->min_filter, FILTER_LINEAR_MIPMAP_LINEAR);
  out[2] = or_else(m->wrap_s, WRAP_REPEAT);
  out[3] = or_else(m->wrap_t, WRAP_REPEAT);
}

/* Each pair of image and sampler becomes one texture: firsts[texture] is the first material that uses it. Returns the
 * number of the material's texture, −1 where it has no image. O(materials). */
static int32_t find_texture(const orb_gltf_scene *scene, int32_t material, int32_t *firsts, int32_t *count) {
  const orb_material *m = &scene->materials[material];
  size_t wanted[4], sampler[4];
  if (m->image < 0) {
    return -1;
  }
  sampler_of(m, wanted);
  for (int32_t t = 0; t < *count; t++) {
    sampler_of(&scene->materials[firsts[t]], sampler);
    if (scene->materials[firsts[t]].image == m->image && memcmp(sampler, wanted, sizeof wanted) == 0) {
      return t;
    }
  }
  firsts[*count] = material;
  return (*count)++;
}

static void write_samplers(writer *w, const orb_gltf_scene *scene, const int32_t *firsts, int32_t count) {
  for (int32_t t = 0; t < count; t++) {
    size_t sampler[4];
    sampler_of(&scene->materials[firsts[t]], sampler);
    integer(w, t ? ",{\"magFilter\":" : ",\"samplers\":[{\"magFilter\":", sampler[0]);
    integer(w, ",\"minFilter\":", sampler[1]);
    integer(w, ",\"wrapS\":", sampler[2]);
    integer(w, ",\"wrapT\":", sampler[3]);
    text(w, t + 1 < count ? "}" : "}]");
  }
}

static void write_textures(writer *w, const orb_gltf_scene *scene, const int32_t *firsts, int32_t count) {
  for (int32_t t = 0; t < count; t++) {
    integer(w, t ? ",{\"sampler\":" : ",\"textures\":[{\"sampler\":", (size_t)t);
    integer(w, ",\"source\":", (size_t)scene->materials[firsts[t]].image);
    text(w, t + 1 < count ? "}" : "}]");
  }
}

static void write_materials(writer *w, const orb_gltf_scene *scene, int32_t *firsts, int32_t *count) {
  text(w, ",\"materials\":");
  for (int32_t i = 0; i < scene->material_count; i++) {
    const orb_material *m = &scene->materials[i];
    text(w, i ? ",{" : "[{");
    if (m->name[0]) {
      quoted(w, "\"name\":", m->name);
    }
    text(w, m->name[0] ? ",\"pbrMetallicRoughness\":{" : "\"pbrMetallicRoughness\":{");
    numbers(w, "\"baseColorFactor\":",
            (double[]){(double)m->base_color[0], (double)m->base_color[1], (double)m->base_color[2],
                       (double)m->base_color[3]},
            4);
    int32_t texture = find_texture(scene, i, firsts, count);
    if (texture >= 0) {
      integer(w, ",\"baseColorTexture\":{\"index\":", (size_t)texture);
      text(w, "}");
    }
    number(w, ",\"metallicFactor\":", (double)m->metallic);
    number(w, ",\"roughnessFactor\":", (double)m->roughness);
    text(w, "}}");
  }
  text(w, "]");
}

static void write_attributes(writer *w, const char *before, const orb_gltf_attributes *from) {
  text(w, before);
  if (from->color >= 0) {
    integer(w, "\"COLOR_0\":", (size_t)from->color);
    text(w, ",");
  }
  if (from->normal >= 0) {
    integer(w, "\"NORMAL\":", (size_t)from->normal);
    text(w, ",");
  }
  ORB_ASSERT(from->position >= 0);
  integer(w, "\"POSITION\":", (size_t)from->position);
  if (from->texcoord >= 0) {
    integer(w, ",\"TEXCOORD_0\":", (size_t)from->texcoord);
  }
  text(w, "}");
}

static void write_primitives(writer *w, const orb_gltf_scene *scene) {
  text(w, "\"primitives\":");
  for (int32_t i = 0; i < scene->primitive_count; i++) {
    const orb_gltf_primitive *p = &scene->primitives[i];
    write_attributes(w, i ? ",{\"attributes\":{" : "[{\"attributes\":{", &p->base);
    integer(w, ",\"indices\":", (size_t)p->indices);
    integer(w, ",\"material\":", (size_t)p->material);
    integer(w, ",\"mode\":", MODE_TRIANGLES);
    for (int32_t k = 0; k < scene->target_count; k++) {
      write_attributes(w, k ? ",{" : ",\"targets\":[{", &p->targets[k]);
    }
    text(w, scene->target_count > 0 ? "]}" : "}");
  }
  text(w, "]");
}

static void write_extras(writer *w, const orb_gltf_scene *scene) {
  text(w, "\"extras\":{");
  for (int32_t i = 0; i < scene->extra_count; i++) {
    const orb_gltf_extra *extra = &scene->extras[i];
    quoted(w, "", extra->name);
    if (extra->text) {
      quoted(w, ":", extra->text);
    } else {
      number(w, ":", extra->number);
    }
    text(w, ",");
  }
  text(w, "\"targetNames\":[");
  for (int32_t k = 0; k < scene->target_count; k++) {
    quoted(w, k ? "," : "", scene->target_names[k]);
  }
  text(w, "]}");
}

static void write_mesh(writer *w, const orb_gltf_scene *scene) {
  text(w, ",\"meshes\":[{");
  write_extras(w, scene);
  if (scene->name[0]) {
    quoted(w, ",\"name\":", scene->name);
  }
  text(w, ",");
  write_primitives(w, scene);
  for (int32_t k = 0; k < scene->target_count; k++) {
    text(w, k ? ",0" : ",\"weights\":[0");
  }
  text(w, scene->target_count > 0 ? "]}],\"nodes\":[{\"mesh\":0" : "}],\"nodes\":[{\"mesh\":0");
  if (scene->name[0]) {
    quoted(w, ",\"name\":", scene->name);
  }
  text(w, "}]");
}

/* firsts: room for material_count numbers. */
static void write_document(writer *w, const orb_gltf_scene *scene, size_t binary_size, int32_t *firsts) {
  int32_t textures = 0;
  write_accessors(w, scene);
  write_animation(w, scene);
  quoted(w, ",\"asset\":{\"generator\":", ORB_ENGINE);
  text(w, ",\"version\":\"2.0\"}");
  write_views(w, scene, binary_size);
  write_images(w, scene);
  write_materials(w, scene, firsts, &textures);
  write_mesh(w, scene);
  write_samplers(w, scene, firsts, textures);
  text(w, ",\"scene\":0,\"scenes\":[{\"nodes\":[0]}]");
  write_textures(w, scene, firsts, textures);
  text(w, "}");
}

static void put_u32(writer *w, size_t value) {
  unsigned char bytes[4];
  for (int i = 0; i < 4; i++) {
    bytes[i] = (unsigned char)(value >> 8 * i);
  }
  put(w, bytes, sizeof bytes);
}

static size_t padded(size_t size) {
  return (size + 3) & ~(size_t)3;
}

static void put_chunk(writer *w, size_t kind, const orb_buffer *content, const char *padding) {
  put_u32(w, padded(content->size));
  put_u32(w, kind);
  put(w, content->data, content->size);
  put(w, padding, padded(content->size) - content->size);
}

orb_status orb_gltf_write(orb_context *ctx, const orb_gltf_scene *scene, const orb_buffer *binary, orb_buffer *out) {
  ORB_ASSERT(scene->accessor_count > 0 && scene->primitive_count > 0 && scene->material_count > 0);
  if (binary->size > UINT32_MAX - ((size_t)64 << 20)) {
    return orb_fail(ctx, ORB_E_TOO_LARGE,
                    "The asset would be larger than a GLB can be (4 GiB); ask for fewer triangles.");
  }
  int32_t *firsts = ORB_NEW(ctx, int32_t, scene->material_count);
  if (!firsts) {
    return ORB_E_NO_MEMORY;
  }
  orb_buffer json = {0};
  writer w = {.ctx = ctx, .out = &json};
  write_document(&w, scene, binary->size, firsts);
  w.out = out;
  put_u32(&w, GLB_MAGIC);
  put_u32(&w, 2);
  put_u32(&w, GLB_HEADER + 2 * CHUNK_HEADER + padded(json.size) + padded(binary->size));
  put_chunk(&w, CHUNK_JSON, &json, "   ");
  put_chunk(&w, CHUNK_BINARY, binary, "\0\0\0");
  orb_buffer_free(ctx, &json);
  orb_free(ctx, firsts);
  return w.status;
}
