/* Writes a scene as GLB: the JSON as text, its members in alphabetical order, then the binary chunk.
 *
 * All memory comes from the context, so that the budget counts it and a failed allocation is an error like any other.
 * (The JSON library of tinygltf, which could write this too, ends the process when an allocation fails.) */
#include "format/gltf_write.h"

#include "base/check.h"
#include "base/error.h"
#include "format/glb_text.h"
#include "format/gltf_write_material.h"

enum {
  GLB_HEADER = 12,
  CHUNK_HEADER = 8,
  GLB_MAGIC = 0x46546c67,
  CHUNK_JSON = 0x4e4f534a,
  CHUNK_BINARY = 0x004e4942,
  MODE_TRIANGLES = 4,
};

static void write_accessors(orb_glb_writer *w, const orb_gltf_scene *scene) {
  static const char *const shapes[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  orb_glb_text(w, "{\"accessors\":");
  for (int32_t i = 0; i < scene->accessor_count; i++) {
    const orb_gltf_accessor *a = &scene->accessors[i];
    ORB_ASSERT(a->components >= 1 && a->components <= 4);
    orb_glb_integer(w, i ? ",{\"bufferView\":" : "[{\"bufferView\":", (size_t)i);
    orb_glb_integer(w, ",\"componentType\":", (size_t)a->component_type);
    orb_glb_integer(w, ",\"count\":", (size_t)a->count);
    if (a->bounded) {
      orb_glb_numbers(w, ",\"max\":", a->max, a->components);
      orb_glb_numbers(w, ",\"min\":", a->min, a->components);
    }
    orb_glb_quoted(w, ",\"type\":", shapes[a->components - 1]);
    orb_glb_text(w, "}");
  }
  orb_glb_text(w, "]");
}

static void write_animation(orb_glb_writer *w, const orb_gltf_scene *scene) {
  if (scene->times >= 0) {
    orb_glb_text(w,
                 ",\"animations\":[{\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"weights\"}}],"
                 "\"name\":\"morph\",\"samplers\":[{");
    orb_glb_integer(w, "\"input\":", (size_t)scene->times);
    orb_glb_integer(w, ",\"interpolation\":\"LINEAR\",\"output\":", (size_t)scene->weights);
    orb_glb_text(w, "}]}]");
  }
}

static void write_view(orb_glb_writer *w, const char *before, size_t offset, size_t length, int32_t target) {
  orb_glb_integer(w, before, length);
  if (offset) {
    orb_glb_integer(w, ",\"byteOffset\":", offset);
  }
  if (target) {
    orb_glb_integer(w, ",\"target\":", (size_t)target);
  }
  orb_glb_text(w, "}");
}

/* The views of the accessors, then those of the images. */
static void write_views(orb_glb_writer *w, const orb_gltf_scene *scene, size_t binary_size) {
  const char *before = ",\"bufferViews\":[{\"buffer\":0,\"byteLength\":", *next = ",{\"buffer\":0,\"byteLength\":";
  for (int32_t i = 0; i < scene->accessor_count; i++, before = next) {
    write_view(w, before, scene->accessors[i].offset, scene->accessors[i].length, scene->accessors[i].target);
  }
  for (int32_t i = 0; i < scene->image_count; i++) {
    write_view(w, next, scene->images[i].offset, scene->images[i].length, 0);
  }
  orb_glb_integer(w, "],\"buffers\":[{\"byteLength\":", binary_size);
  orb_glb_text(w, "}]");
}

static void write_images(orb_glb_writer *w, const orb_gltf_scene *scene) {
  for (int32_t i = 0; i < scene->image_count; i++) {
    orb_glb_integer(
        w, i ? ",{\"bufferView\":" : ",\"images\":[{\"bufferView\":", (size_t)scene->accessor_count + (size_t)i);
    orb_glb_quoted(w, ",\"mimeType\":", scene->images[i].mime);
    orb_glb_text(w, i + 1 < scene->image_count ? "}" : "}]");
  }
}

static void write_attributes(orb_glb_writer *w, const char *before, const orb_gltf_attributes *from) {
  orb_glb_text(w, before);
  if (from->color >= 0) {
    orb_glb_integer(w, "\"COLOR_0\":", (size_t)from->color);
    orb_glb_text(w, ",");
  }
  if (from->normal >= 0) {
    orb_glb_integer(w, "\"NORMAL\":", (size_t)from->normal);
    orb_glb_text(w, ",");
  }
  ORB_ASSERT(from->position >= 0);
  orb_glb_integer(w, "\"POSITION\":", (size_t)from->position);
  if (from->tangent >= 0) {
    orb_glb_integer(w, ",\"TANGENT\":", (size_t)from->tangent);
  }
  if (from->texcoord >= 0) {
    orb_glb_integer(w, ",\"TEXCOORD_0\":", (size_t)from->texcoord);
  }
  orb_glb_text(w, "}");
}

static void write_primitives(orb_glb_writer *w, const orb_gltf_scene *scene) {
  orb_glb_text(w, "\"primitives\":");
  for (int32_t i = 0; i < scene->primitive_count; i++) {
    const orb_gltf_primitive *p = &scene->primitives[i];
    write_attributes(w, i ? ",{\"attributes\":{" : "[{\"attributes\":{", &p->base);
    orb_glb_integer(w, ",\"indices\":", (size_t)p->indices);
    orb_glb_integer(w, ",\"material\":", (size_t)p->material);
    orb_glb_integer(w, ",\"mode\":", MODE_TRIANGLES);
    for (int32_t k = 0; k < scene->target_count; k++) {
      write_attributes(w, k ? ",{" : ",\"targets\":[{", &p->targets[k]);
    }
    orb_glb_text(w, scene->target_count > 0 ? "]}" : "}");
  }
  orb_glb_text(w, "]");
}

static void write_extras(orb_glb_writer *w, const orb_gltf_scene *scene) {
  orb_glb_text(w, "\"extras\":{");
  for (int32_t i = 0; i < scene->extra_count; i++) {
    const orb_gltf_extra *extra = &scene->extras[i];
    orb_glb_quoted(w, "", extra->name);
    if (extra->text) {
      orb_glb_quoted(w, ":", extra->text);
    } else {
      orb_glb_number(w, ":", extra->number);
    }
    orb_glb_text(w, ",");
  }
  orb_glb_text(w, "\"targetNames\":[");
  for (int32_t k = 0; k < scene->target_count; k++) {
    orb_glb_quoted(w, k ? "," : "", scene->target_names[k]);
  }
  orb_glb_text(w, "]}");
}

static void write_mesh(orb_glb_writer *w, const orb_gltf_scene *scene) {
  orb_glb_text(w, ",\"meshes\":[{");
  write_extras(w, scene);
  if (scene->name[0]) {
    orb_glb_quoted(w, ",\"name\":", scene->name);
  }
  orb_glb_text(w, ",");
  write_primitives(w, scene);
  for (int32_t k = 0; k < scene->target_count; k++) {
    orb_glb_text(w, k ? ",0" : ",\"weights\":[0");
  }
  orb_glb_text(w, scene->target_count > 0 ? "]}],\"nodes\":[{\"mesh\":0" : "}],\"nodes\":[{\"mesh\":0");
  if (scene->name[0]) {
    orb_glb_quoted(w, ",\"name\":", scene->name);
  }
  orb_glb_text(w, "}]");
}

static void write_document(orb_glb_writer *w, const orb_gltf_scene *scene, size_t binary_size,
                           const orb_gltf_textures *textures) {
  write_accessors(w, scene);
  write_animation(w, scene);
  orb_glb_quoted(w, ",\"asset\":{\"generator\":", ORB_ENGINE);
  orb_glb_text(w, ",\"version\":\"2.0\"}");
  write_views(w, scene, binary_size);
  orb_gltf_write_extensions(w, scene);
  write_images(w, scene);
  orb_gltf_write_materials(w, scene, textures);
  write_mesh(w, scene);
  orb_gltf_write_samplers(w, textures);
  orb_glb_text(w, ",\"scene\":0,\"scenes\":[{\"nodes\":[0]}]");
  orb_gltf_write_textures(w, textures);
  orb_glb_text(w, "}");
}

static void put_u32(orb_glb_writer *w, size_t value) {
  unsigned char bytes[4];
  for (int i = 0; i < 4; i++) {
    bytes[i] = (unsigned char)(value >> 8 * i);
  }
  orb_glb_put(w, bytes, sizeof bytes);
}

static size_t padded(size_t size) {
  return (size + 3) & ~(size_t)3;
}

orb_status orb_glb_head(orb_context *ctx, const orb_buffer *json, size_t binary_size, orb_buffer *out) {
  if (binary_size + json->size > UINT32_MAX - ((size_t)64 << 20)) {
    return orb_fail(ctx, ORB_E_TOO_LARGE,
                    "The asset would be larger than a GLB can be (4 GiB); ask for fewer triangles.");
  }
  orb_glb_writer w = {.ctx = ctx, .out = out};
  put_u32(&w, GLB_MAGIC);
  put_u32(&w, 2);
  put_u32(&w, GLB_HEADER + 2 * CHUNK_HEADER + padded(json->size) + padded(binary_size));
  put_u32(&w, padded(json->size));
  put_u32(&w, CHUNK_JSON);
  orb_glb_put(&w, json->data, json->size);
  orb_glb_put(&w, "   ", padded(json->size) - json->size);
  put_u32(&w, padded(binary_size));
  put_u32(&w, CHUNK_BINARY);
  return w.status;
}

orb_status orb_gltf_write(orb_context *ctx, const orb_gltf_scene *scene, const orb_buffer *binary, orb_buffer *out) {
  ORB_ASSERT(scene->accessor_count > 0 && scene->primitive_count > 0 && scene->material_count > 0);
  orb_gltf_textures textures;
  ORB_TRY(orb_gltf_textures_collect(ctx, scene, &textures));
  orb_buffer json = {0};
  orb_glb_writer w = {.ctx = ctx, .out = &json};
  write_document(&w, scene, binary->size, &textures);
  if (w.status == ORB_OK) {
    w.status = orb_glb_head(ctx, &json, binary->size, out);
  }
  w.out = out;
  orb_glb_put(&w, binary->data, binary->size);
  orb_glb_put(&w, "\0\0\0", padded(binary->size) - binary->size);
  orb_buffer_free(ctx, &json);
  orb_gltf_textures_free(ctx, &textures);
  return w.status;
}
