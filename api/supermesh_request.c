/* The request for a supermesh: reads it, checks it against the meshes, and writes its canonical text. The canonical
 * text contains every member, even those that are default or that the method does not use, so all of them are part of
 * the id. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/options.h"
#include "api/supermesh_request.h"
#include "api/transfer_codec.h"

static const char *const aligns[] = {"pin", "rbf", "rotate", "auto", NULL};
static const char *const presets[] = {"default", "fast", "quality", NULL};
#define WORD(id, function, name, heeds) name,
static const char *const remeshes[] = {ORB_REMESH_METHODS(WORD) NULL};
#undef WORD
static const char *const animations[] = {"pingpong", "none", NULL};
static const char *const fits[] = {"none", "rigid", "similarity", "auto", NULL};
static const char *const holes[] = {"reopen", "filled", NULL};
static const char *const paths[] = {"linear", "rigid", NULL};

#define ALIGN(field) offsetof(orb_align_options, field)
static const api_option align_method[] = {{"method", API_OPTION_NAME, ALIGN(method), 0, 0, aligns}};
static const api_option align_table[] = {
    {"preset", API_OPTION_NAME, ALIGN(preset), 0, 0, presets},
    {"steps", API_OPTION_INT32, ALIGN(rbf_steps), 1, 10000, NULL},
    {"one_way", API_OPTION_BOOL, ALIGN(one_way), 0, 0, NULL},
    {"radius", API_OPTION_NUMBER, ALIGN(rbf_radius), 0, 2, NULL},
};
#define REMESH(field) offsetof(orb_remesh_options, field)
static const api_option remesh_table[] = {
    {"method", API_OPTION_NAME, REMESH(method), 0, 0, remeshes},
    {"tolerance", API_OPTION_NUMBER, REMESH(tolerance), 1e-9, 1, NULL},
    {"max_triangles", API_OPTION_INT64, REMESH(max_triangles), 0, 1e8, NULL},
};
#define ASSET(field) offsetof(orb_asset_options, field)
static const api_option asset_table[] = {
    {"normals", API_OPTION_BOOL, ASSET(normals), 0, 0, NULL},
    {"animation", API_OPTION_NAME, ASSET(animation), 0, 0, animations},
    {"fit", API_OPTION_NAME, ASSET(fit), 0, 0, fits},
    {"path", API_OPTION_NAME, ASSET(path), 0, 0, paths},
    {"path_steps", API_OPTION_INT32, ASSET(path_steps), 1, 16, NULL},
    {"colors", API_OPTION_BOOL, ASSET(colors), 0, 0, NULL},
    {"holes", API_OPTION_NAME, ASSET(holes), 0, 0, holes},
};
#define COUNT(table) (sizeof(table) / sizeof(table)[0])

static int read_shape(const cJSON *value, int32_t index, api_supermesh_request *out, api_problem *problem) {
  static const char *const known[] = {"mesh", "name", NULL};
  struct api_shape_spec *shape = &out->shapes[index];
  if (!cJSON_IsObject(value)) {
    return api_refuse(problem, "invalid-request", "Each entry of \"shapes\" must be an object with \"mesh\".");
  }
  if (!api_members_known(value, "a shape", known, problem)) {
    return 0;
  }
  const cJSON *mesh = cJSON_GetObjectItemCaseSensitive(value, "mesh");
  const cJSON *name = cJSON_GetObjectItemCaseSensitive(value, "name");
  if (!cJSON_IsString(mesh)) {
    return api_refuse(problem, "invalid-request", "\"mesh\" of shape %d must be the id of an uploaded mesh.", index);
  }
  if (!api_id_valid(mesh->valuestring, strlen(mesh->valuestring))) {
    return api_refuse(problem, "not-found", "\"mesh\" of shape %d is not the id of a mesh. Upload the mesh first.",
                      index);
  }
  memcpy(shape->mesh, mesh->valuestring, API_ID_SIZE);
  if (name && (!cJSON_IsString(name) || strlen(name->valuestring) >= ORB_NAME_MAX)) {
    return api_refuse(problem, "invalid-request", "\"name\" of shape %d must be a string of at most 127 bytes.", index);
  }
  snprintf(shape->name, sizeof shape->name, "%s", name ? name->valuestring : "");
  return 1;
}

static int read_shapes(const cJSON *list, api_supermesh_request *out, api_problem *problem) {
  int count = cJSON_GetArraySize(list);
  if (!cJSON_IsArray(list) || count < 2 || count > API_SHAPES_MAX) {
    return api_refuse(problem, "invalid-request", "\"shapes\" must be an array of 2 to %d shapes.", API_SHAPES_MAX);
  }
  for (const cJSON *item = list->child; item; item = item->next, out->shape_count++) {
    if (!read_shape(item, out->shape_count, out, problem)) {
      return 0;
    }
  }
  return 1;
}

static int read_start(const cJSON *start, api_supermesh_request *out, api_problem *problem) {
  const orb_align_method method = out->merge.align.method;
  if (!start) {
    return 1;
  }
  if (!cJSON_IsString(start) || !api_id_valid(start->valuestring, strlen(start->valuestring))) {
    return api_refuse(problem, "invalid-request",
                      "\"align.start\" must be what the member \"alignment\" of a supermesh has.");
  }
  if (out->landmarks.count == 0 || (method != ORB_ALIGN_PIN && method != ORB_ALIGN_AUTO)) {
    return api_refuse(problem, "invalid-request",
                      "Only the methods pin and auto begin with another alignment, and only with landmarks. Add some, "
                      "or leave \"align.start\" out.");
  }
  memcpy(out->start, start->valuestring, sizeof out->start);
  return 1;
}

static int read_align(cJSON *align, api_supermesh_request *out, api_problem *problem) {
  static const char *const known[] = {"method", "options", "start", NULL};
  out->merge.align.method = out->landmarks.count ? ORB_ALIGN_PIN : ORB_ALIGN_AUTO;
  if (align) {
    if (!cJSON_IsObject(align)) {
      return api_refuse(problem, "invalid-request", "\"align\" must be a JSON object.");
    }
    if (!api_members_known(align, "\"align\"", known, problem)) {
      return 0;
    }
    const cJSON *method = cJSON_GetObjectItemCaseSensitive(align, "method");
    const cJSON *options = cJSON_GetObjectItemCaseSensitive(align, "options");
    if (method) {
      cJSON one = *method, only = {.child = &one, .type = cJSON_Object};
      one.next = NULL;
      if (!api_options_read(&only, "\"align\"", align_method, 1, &out->merge.align, problem)) {
        return 0;
      }
    }
    if (options &&
        !api_options_read(options, "\"align.options\"", align_table, COUNT(align_table), &out->merge.align, problem)) {
      return 0;
    }
  }
  orb_align_method method = out->merge.align.method;
  if (out->landmarks.count == 0 && (method == ORB_ALIGN_PIN || method == ORB_ALIGN_RBF)) {
    return api_refuse(problem, "bad-landmarks",
                      "The alignment method \"%s\" requires landmarks. Add some, or choose auto or rotate.",
                      aligns[method]);
  }
  return read_start(align ? cJSON_GetObjectItemCaseSensitive(align, "start") : NULL, out, problem);
}

/* "template": which meshes and nodes of the first shape's document the closed surface consists of. */
static int read_parts(const cJSON *value, struct api_parts_spec *out, api_problem *problem) {
  static const char *const known[] = {"meshes", "nodes", NULL};
  if (!cJSON_IsObject(value)) {
    return api_refuse(problem, "invalid-request", "\"template\" must be an object with \"meshes\" or \"nodes\".");
  }
  if (!api_members_known(value, "\"template\"", known, problem)) {
    return 0;
  }
  const cJSON *meshes = cJSON_GetObjectItemCaseSensitive(value, "meshes");
  const cJSON *nodes = cJSON_GetObjectItemCaseSensitive(value, "nodes");
  if ((meshes && (!cJSON_IsArray(meshes) || cJSON_GetArraySize(meshes) > API_PARTS_MAX)) ||
      (nodes && (!cJSON_IsArray(nodes) || cJSON_GetArraySize(nodes) > API_PARTS_MAX))) {
    return api_refuse(problem, "invalid-request",
                      "\"meshes\" and \"nodes\" of \"template\" must be arrays of at most %d entries.", API_PARTS_MAX);
  }
  for (const cJSON *item = meshes ? meshes->child : NULL; item; item = item->next) {
    if (!cJSON_IsNumber(item) || item->valuedouble != (double)item->valueint || item->valueint < 0) {
      return api_refuse(problem, "invalid-request", "\"meshes\" of \"template\" must hold numbers of meshes, from 0.");
    }
    out->meshes[out->mesh_count++] = item->valueint;
  }
  for (const cJSON *item = nodes ? nodes->child : NULL; item; item = item->next) {
    if (!cJSON_IsString(item) || !*item->valuestring || strlen(item->valuestring) >= ORB_NAME_MAX) {
      return api_refuse(problem, "invalid-request",
                        "\"nodes\" of \"template\" must hold names of nodes, of at most 127 bytes.");
    }
    snprintf(out->nodes[out->node_count++], ORB_NAME_MAX, "%s", item->valuestring);
  }
  return 1;
}

static void write_parts(const struct api_parts_spec *parts, api_text *out) {
  api_json_open(out, '{');
  api_json_key(out, "meshes");
  api_json_open(out, '[');
  for (int32_t i = 0; i < parts->mesh_count; i++) {
    api_json_integer(out, parts->meshes[i]);
  }
  api_json_close(out, ']');
  api_json_key(out, "nodes");
  api_json_open(out, '[');
  for (int32_t i = 0; i < parts->node_count; i++) {
    api_json_string(out, parts->nodes[i]);
  }
  api_json_close(out, ']');
  api_json_close(out, '}');
}

void api_supermesh_request_parts(const api_supermesh_request *request, const char *names[API_PARTS_MAX],
                                 orb_document_parts *out) {
  for (int32_t i = 0; i < request->parts.node_count; i++) {
    names[i] = request->parts.nodes[i];
  }
  *out = (orb_document_parts){request->parts.meshes, names, request->parts.mesh_count, request->parts.node_count};
}

/* Fewer triangles than a tetrahedron has close no surface. */
static int check_budget(const api_supermesh_request *request, api_problem *problem) {
  const int64_t most = request->merge.remesh.max_triangles;
  if (most == 0 || most >= 4) {
    return 1;
  }
  api_refuse(problem, "bad-option",
             "\"max_triangles\" in \"remesh\" must be at least 4, as many as a tetrahedron has, or 0 for no limit.");
  api_json_member_string(&problem->facts, "member", "max_triangles");
  return 0;
}

static int check_built(const api_supermesh_request *request, api_problem *problem) {
  if (orb_remesh_available(request->merge.remesh.method)) {
    return 1;
  }
  const char *name = remeshes[request->merge.remesh.method];
  api_refuse(problem, "unsupported-method", "This build does not include the remesh method \"%s\". Use adaptive.",
             name);
  api_json_member_string(&problem->facts, "method", name);
  return 0;
}

int api_supermesh_request_read(const cJSON *body, api_supermesh_request *out, api_problem *problem) {
  static const char *const known[] = {"shapes", "landmarks", "embedding", "align", "remesh",
                                      "asset",  "template",  "transfer",  NULL};
  memset(out, 0, sizeof *out);
  orb_merge_defaults(&out->merge);
  orb_embed_defaults(&out->embedding);
  if (!cJSON_IsObject(body)) {
    return api_refuse(problem, "invalid-request", "The request must be a JSON object.");
  }
  if (!api_members_known(body, "the request", known, problem) ||
      !read_shapes(cJSON_GetObjectItemCaseSensitive(body, "shapes"), out, problem)) {
    return 0;
  }
  const cJSON *landmarks = cJSON_GetObjectItemCaseSensitive(body, "landmarks");
  const cJSON *embedding = cJSON_GetObjectItemCaseSensitive(body, "embedding");
  const cJSON *remesh = cJSON_GetObjectItemCaseSensitive(body, "remesh");
  const cJSON *asset = cJSON_GetObjectItemCaseSensitive(body, "asset");
  const cJSON *parts = cJSON_GetObjectItemCaseSensitive(body, "template");
  const cJSON *transfer = cJSON_GetObjectItemCaseSensitive(body, "transfer");
  if (landmarks && cJSON_IsObject(landmarks)) {
    return api_refuse(problem, "bad-landmarks", "\"landmarks\" must be an array, \"auto\" or {\"id\": ID}.");
  }
  if (landmarks && !api_landmarks_read(landmarks, out->shape_count, &out->landmarks, problem)) {
    return 0;
  }
  return (!embedding || api_embedding_options_read(embedding, "\"embedding\"", 0, &out->embedding, problem)) &&
         read_align(cJSON_GetObjectItemCaseSensitive(body, "align"), out, problem) &&
         (!remesh ||
          api_options_read(remesh, "\"remesh\"", remesh_table, COUNT(remesh_table), &out->merge.remesh, problem)) &&
         check_built(out, problem) && check_budget(out, problem) &&
         (!transfer || api_transfer_read(transfer, out->shape_count, out->carries, &out->carry_count, problem)) &&
         (!parts || read_parts(parts, &out->parts, problem)) &&
         (!asset || api_options_read(asset, "\"asset\"", asset_table, COUNT(asset_table), &out->merge.asset, problem));
}

void api_supermesh_request_free(api_supermesh_request *request) {
  api_landmarks_free(&request->landmarks);
}

int api_supermesh_request_resolve(api_supermesh_request *request, const api_mesh_summary *meshes,
                                  api_problem *problem) {
  for (int32_t s = 0; s < request->shape_count; s++) {
    if (!request->shapes[s].name[0]) {
      memcpy(request->shapes[s].name, meshes[s].name, ORB_NAME_MAX);
    }
  }
  for (int32_t l = 0; l < request->landmarks.count; l++) {
    for (int32_t s = 0; s < request->shape_count; s++) {
      const api_place *spot = &request->landmarks.spots[(size_t)l * (size_t)request->shape_count + (size_t)s];
      int vertex = spot->kind == API_PLACE_VERTEX;
      int64_t count = vertex ? meshes[s].file_vertices : meshes[s].file_triangles;
      if (spot->kind != API_PLACE_POINT && spot->index >= count) {
        api_refuse(problem, "bad-landmarks",
                   "Landmark %d (\"%.60s\"), shape %d (\"%.60s\"): %s %d is out of range; the file has %lld %s.", l,
                   request->landmarks.items[l].name, s, request->shapes[s].name, vertex ? "vertex" : "triangle",
                   spot->index, (long long)count, vertex ? "vertices" : "triangles");
        api_text_printf(&problem->facts, "\"landmarks\":[%d],\"shape\":%d,\"reason\":\"out-of-range\"", l, s);
        return 0;
      }
    }
  }
  return 1;
}

static void write_embedding_and_align(const api_supermesh_request *request, api_text *out) {
  api_json_key(out, "embedding");
  api_json_open(out, '{');
  api_embedding_options_members(&request->embedding, out);
  api_json_close(out, '}');
  api_json_key(out, "align");
  api_json_open(out, '{');
  api_json_member_string(out, "method", aligns[request->merge.align.method]);
  api_json_key(out, "options");
  api_options_write(out, align_table, COUNT(align_table), &request->merge.align, NULL);
  if (request->start[0]) {
    api_json_member_string(out, "start", request->start);
  }
  api_json_close(out, '}');
}

void api_supermesh_request_write(const api_supermesh_request *request, api_text *out) {
  api_json_open(out, '{');
  api_json_key(out, "shapes");
  api_json_open(out, '[');
  for (int32_t s = 0; s < request->shape_count; s++) {
    api_json_open(out, '{');
    api_json_member_string(out, "mesh", request->shapes[s].mesh);
    api_json_member_string(out, "name", request->shapes[s].name);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
  api_json_key(out, "landmarks");
  if (request->landmarks.count) {
    api_landmarks_write(&request->landmarks, out);
  } else {
    api_json_string(out, "auto");
  }
  write_embedding_and_align(request, out);
  api_json_key(out, "remesh");
  api_options_write(out, remesh_table, COUNT(remesh_table), &request->merge.remesh, NULL);
  api_json_key(out, "asset");
  api_options_write(out, asset_table, COUNT(asset_table), &request->merge.asset, NULL);
  if (request->parts.mesh_count + request->parts.node_count > 0) {
    api_json_key(out, "template");
    write_parts(&request->parts, out);
  }
  if (request->carry_count > 0) {
    api_json_key(out, "transfer");
    api_transfer_write(request->carries, request->carry_count, out);
  }
  api_json_close(out, '}');
}

/* Names of shapes and landmarks are not part of it, nor is how sure a caller is of a landmark. */
static void write_alignment(const api_supermesh_request *request, api_text *out) {
  const api_landmark_list *list = &request->landmarks;
  api_json_open(out, '{');
  api_json_key(out, "meshes");
  api_json_open(out, '[');
  for (int32_t s = 0; s < request->shape_count; s++) {
    api_json_string(out, request->shapes[s].mesh);
  }
  api_json_close(out, ']');
  api_json_key(out, "landmarks");
  api_json_open(out, '[');
  for (int32_t l = 0; l < list->count; l++) {
    api_json_open(out, '{');
    api_json_member_integer(out, "pass", list->items[l].pass);
    api_json_member_number(out, "radius", list->items[l].radius);
    api_landmark_weight_write(&list->items[l], out);
    api_json_key(out, "at");
    api_json_open(out, '[');
    for (int32_t s = 0; s < list->shape_count; s++) {
      api_place_write(out, &list->spots[(size_t)l * (size_t)list->shape_count + (size_t)s]);
    }
    api_json_close(out, ']');
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
  write_embedding_and_align(request, out);
  api_json_close(out, '}');
}

static int id_of(const char *kind, void (*write)(const api_supermesh_request *request, api_text *out),
                 const api_supermesh_request *request, char id[API_ID_SIZE]) {
  api_text text = {0};
  api_text_add(&text, kind);
  write(request, &text);
  int fine = !text.failed;
  if (fine) {
    api_id_of_text(text.data, text.size, id);
  }
  api_text_free(&text);
  return fine;
}

int api_alignment_id(const api_supermesh_request *request, char id[API_ID_SIZE]) {
  return id_of(ORB_ENGINE " alignment", write_alignment, request, id);
}

int api_supermesh_request_id(const api_supermesh_request *request, char id[API_ID_SIZE]) {
  return id_of(ORB_ENGINE " supermesh", api_supermesh_request_write, request, id);
}
