#include "profile/emit.h"

#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/error.h"
#include "profile/codec.h"

enum { GLB_HEADER = 12, CHUNK_HEADER = 8, MAGIC = 0x46546c67, JSON = 0x4e4f534a, BINARY = 0x004e4942 };

static orb_status no_memory(orb_context *ctx) {
  return orb_fail(ctx, ORB_E_NO_MEMORY, "There is not enough memory to write the asset.");
}

static size_t padded(size_t size) {
  return (size + 3) & ~(size_t)3;
}

static orb_status append_zeros(orb_context *ctx, orb_buffer *out) {
  static const unsigned char zeros[4];
  return orb_buffer_append(ctx, out, zeros, padded(out->size) - out->size);
}

/* Sets a number of an object in place, or adds it. */
static int set_number(cJSON *object, const char *name, double value) {
  cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
  if (item) {
    cJSON_SetNumberValue(item, value);
    return 1;
  }
  return cJSON_AddNumberToObject(object, name, value) != NULL;
}

/* 0 is the default. */
static int set_offset(cJSON *object, size_t offset) {
  if (offset == 0) {
    cJSON_DeleteItemFromObjectCaseSensitive(object, "byteOffset");
    return 1;
  }
  return set_number(object, "byteOffset", (double)offset);
}

static int set_numbers(cJSON *object, const char *name, const double *values, int count) {
  cJSON *array = cJSON_CreateDoubleArray(values, count);
  int held = array && (cJSON_HasObjectItem(object, name) ? cJSON_ReplaceItemInObjectCaseSensitive(object, name, array)
                                                         : cJSON_AddItemToObject(object, name, array));
  if (!held) {
    cJSON_Delete(array);
  }
  return held;
}

/* Describes a stream in place of the accessor's floats. */
static int describe(cJSON *accessor, const orb_stream *stream) {
  int fine = set_number(accessor, "componentType", stream->component_type);
  if (stream->normalized && !cJSON_HasObjectItem(accessor, "normalized")) {
    fine = fine && cJSON_AddTrueToObject(accessor, "normalized");
  }
  if (stream->bounded) {
    fine = fine && set_numbers(accessor, "max", stream->max, stream->components) &&
           set_numbers(accessor, "min", stream->min, stream->components);
  }
  return fine;
}

static int32_t packed_size(const orb_stream *stream) {
  int32_t type = stream->component_type;
  return stream->components * (type < 5122 ? 1 : type < 5125 ? 2 : 4);
}

/* The extension that says where the compressed bytes are. */
static int add_compression(cJSON *view, const orb_stream *stream, size_t offset, size_t length) {
  static const char *const filters[] = {NULL, "OCTAHEDRAL", "EXPONENTIAL"};
  cJSON *extensions = cJSON_AddObjectToObject(view, "extensions");
  cJSON *own = cJSON_AddObjectToObject(extensions, "EXT_meshopt_compression");
  int fine = own && set_number(own, "buffer", 0) && set_offset(own, offset) &&
             set_number(own, "byteLength", (double)length) && set_number(own, "byteStride", stream->stride) &&
             set_number(own, "count", stream->count) &&
             cJSON_AddStringToObject(own, "mode", stream->triangles ? "TRIANGLES" : "ATTRIBUTES");
  return fine && (!stream->filter || cJSON_AddStringToObject(own, "filter", filters[stream->filter]));
}

typedef struct emitter {
  orb_context *ctx;
  const orb_source *source;
  const orb_stream *streams;
  int compress;
  orb_buffer binary;
  size_t fallback; /* bytes of the buffer that only decoders fill */
} emitter;

static orb_status emit_stream(emitter *self, cJSON *view, const orb_stream *stream) {
  size_t size = (size_t)stream->count * (size_t)stream->stride, offset = self->binary.size;
  int fine = 1;
  if (self->compress) {
    ORB_TRY(orb_codec_compress(self->ctx, stream, &self->binary));
    fine = add_compression(view, stream, offset, self->binary.size - offset) && set_number(view, "buffer", 1);
    offset = self->fallback;
    self->fallback = padded(self->fallback + size);
  } else {
    ORB_TRY(orb_buffer_append(self->ctx, &self->binary, stream->bytes, size));
  }
  fine = fine && set_number(view, "byteLength", (double)size) && set_offset(view, offset);
  if (stream->stride != packed_size(stream)) {
    fine = fine && set_number(view, "byteStride", stream->stride);
  }
  return fine ? ORB_OK : no_memory(self->ctx);
}

static orb_status emit_views(emitter *self) {
  cJSON *view, *views = cJSON_GetObjectItemCaseSensitive(self->source->document, "bufferViews");
  int32_t v = 0;
  cJSON_ArrayForEach(view, views) {
    const orb_source_view *from = &self->source->views[v++];
    ORB_TRY(orb_context_check(self->ctx));
    ORB_TRY(append_zeros(self->ctx, &self->binary));
    if (from->accessor >= 0 && self->streams[from->accessor].bytes) {
      ORB_TRY(emit_stream(self, view, &self->streams[from->accessor]));
    } else if (!set_offset(view, self->binary.size)) {
      return no_memory(self->ctx);
    } else {
      ORB_TRY(orb_buffer_append(self->ctx, &self->binary, from->bytes, from->size));
    }
  }
  return ORB_OK;
}

static orb_status emit_accessors(const emitter *self) {
  cJSON *accessor, *accessors = cJSON_GetObjectItemCaseSensitive(self->source->document, "accessors");
  int32_t a = 0;
  cJSON_ArrayForEach(accessor, accessors) {
    const orb_stream *stream = &self->streams[a++];
    if (stream->bytes && !describe(accessor, stream)) {
      return no_memory(self->ctx);
    }
  }
  return ORB_OK;
}

/* The node's scale and translation; the writer of the asset gives it none. */
static int place_node(cJSON *document, const orb_grid *grid) {
  cJSON *node = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(document, "nodes"), 0);
  double scale[3] = {grid->step, grid->step, grid->step};
  return node && set_numbers(node, "scale", scale, 3) && set_numbers(node, "translation", grid->origin, 3);
}

static int name_extension(cJSON *document, const char *list, const char *extension) {
  cJSON *array = cJSON_GetObjectItemCaseSensitive(document, list);
  array = array ? array : cJSON_AddArrayToObject(document, list);
  cJSON *name = cJSON_CreateString(extension);
  if (!array || !name || !cJSON_AddItemToArray(array, name)) {
    cJSON_Delete(name);
    return 0;
  }
  return 1;
}

static int describe_buffers(const emitter *self) {
  cJSON *document = self->source->document, *buffers = cJSON_GetObjectItemCaseSensitive(document, "buffers");
  int fine = set_number(cJSON_GetArrayItem(buffers, 0), "byteLength", (double)self->binary.size) &&
             name_extension(document, "extensionsUsed", "KHR_mesh_quantization") &&
             name_extension(document, "extensionsRequired", "KHR_mesh_quantization");
  if (!fine || !self->compress) {
    return fine;
  }
  cJSON *fallback = cJSON_CreateObject();
  if (!fallback || !cJSON_AddItemToArray(buffers, fallback)) {
    cJSON_Delete(fallback);
    return 0;
  }
  cJSON *extensions = cJSON_AddObjectToObject(fallback, "extensions");
  return set_number(fallback, "byteLength", (double)self->fallback) &&
         cJSON_AddTrueToObject(cJSON_AddObjectToObject(extensions, "EXT_meshopt_compression"), "fallback") &&
         name_extension(document, "extensionsUsed", "EXT_meshopt_compression") &&
         name_extension(document, "extensionsRequired", "EXT_meshopt_compression");
}

static void put_u32(unsigned char *to, size_t value) {
  for (int i = 0; i < 4; i++) {
    to[i] = (unsigned char)(value >> 8 * i);
  }
}

static orb_status put_chunk(orb_context *ctx, size_t kind, const void *bytes, size_t size, const char *padding,
                            orb_buffer *out) {
  unsigned char head[CHUNK_HEADER];
  put_u32(head, padded(size));
  put_u32(head + 4, kind);
  ORB_TRY(orb_buffer_append(ctx, out, head, sizeof head));
  ORB_TRY(orb_buffer_append(ctx, out, bytes, size));
  return orb_buffer_append(ctx, out, padding, padded(size) - size);
}

static orb_status put_file(const emitter *self, orb_buffer *out) {
  char *json = cJSON_PrintUnformatted(self->source->document);
  if (!json) {
    return no_memory(self->ctx);
  }
  unsigned char head[GLB_HEADER];
  size_t json_size = strlen(json);
  put_u32(head, MAGIC);
  put_u32(head + 4, 2);
  put_u32(head + 8, GLB_HEADER + 2 * CHUNK_HEADER + padded(json_size) + padded(self->binary.size));
  orb_status status = orb_buffer_append(self->ctx, out, head, sizeof head);
  status = status == ORB_OK ? put_chunk(self->ctx, JSON, json, json_size, "   ", out) : status;
  cJSON_free(json);
  return status == ORB_OK ? put_chunk(self->ctx, BINARY, self->binary.data, self->binary.size, "\0\0\0", out) : status;
}

orb_status orb_profile_emit(orb_context *ctx, orb_source *source, const orb_stream *streams, const orb_grid *grid,
                            orb_profile profile, orb_buffer *out) {
  emitter self = {.ctx = ctx, .source = source, .streams = streams, .compress = profile == ORB_PROFILE_MESHOPT};
  orb_status status;
  ORB_GO(status, emit_views(&self), done);
  ORB_GO(status, append_zeros(ctx, &self.binary), done);
  ORB_GO(status, emit_accessors(&self), done);
  if (!place_node(source->document, grid) || !describe_buffers(&self)) {
    status = no_memory(ctx);
    goto done;
  }
  status = put_file(&self, out);
done:
  orb_buffer_free(ctx, &self.binary);
  return status;
}
