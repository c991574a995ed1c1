#include "api/mesh_codec.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

#include "api/json.h"

static const struct {
  const char *name;
  unsigned flag;
} kinds[] = {{"none", ORB_REPAIR_NONE},
             {"safe", ORB_REPAIR_SAFE},
             {"fill_holes", ORB_REPAIR_FILL_HOLES},
             {"largest_component", ORB_REPAIR_LARGEST_COMPONENT}};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

int api_repair_parse(const char *list, unsigned *flags, char canonical[API_REPAIR_TEXT], api_problem *problem) {
  unsigned all = 0;
  int none = 0;
  for (const char *at = list;; at++) {
    size_t n = strcspn(at, ","), k = 0;
    while (k < KINDS && !(strlen(kinds[k].name) == n && strncmp(kinds[k].name, at, n) == 0)) {
      k++;
    }
    if (k == KINDS) {
      return api_refuse(problem, "bad-query",
                        "There is no repair \"%.*s\". Use none, safe, fill_holes or largest_component.",
                        (int)(n < 60 ? n : 60), at);
    }
    none |= k == 0;
    all |= kinds[k].flag;
    at += n;
    if (!*at) {
      break;
    }
  }
  if (none && all) {
    return api_refuse(problem, "bad-query", "The repair \"none\" excludes all others. Remove it or the others.");
  }
  all |= all ? ORB_REPAIR_SAFE : 0;
  *flags = all;
  snprintf(canonical, API_REPAIR_TEXT, "%s%s%s", all ? "safe" : "none",
           all & ORB_REPAIR_FILL_HOLES ? ",fill_holes" : "",
           all & ORB_REPAIR_LARGEST_COMPONENT ? ",largest_component" : "");
  return 1;
}

int api_upload_read(const char *name, const char *repair, const char *format, api_upload *out, api_problem *problem) {
  memset(out, 0, sizeof *out);
  if (name && (!*name || strlen(name) >= sizeof out->name || !api_utf8_valid(name, strlen(name)))) {
    return api_refuse(problem, "bad-query", "\"name\" must be UTF-8 of 1 to 127 bytes.");
  }
  snprintf(out->name, sizeof out->name, "%s", name ? name : "mesh");
  for (const unsigned char *c = (const unsigned char *)out->name; *c; c++) {
    if (*c < 0x20 || *c == 0x7f) {
      return api_refuse(problem, "bad-query", "\"name\" must not contain control characters.");
    }
  }
  if (format) {
    out->hint = orb_format_of_name(format);
    if (out->hint == ORB_FORMAT_AUTO) {
      return api_refuse(problem, "bad-query", "\"format\" must be obj, off, ply, stl, gltf or glb, or be omitted.");
    }
  }
  return api_repair_parse(repair ? repair : "safe", &out->flags, out->repair, problem);
}

static void write_vector(api_text *out, const char *name, const double v[3]) {
  api_json_key(out, name);
  api_json_open(out, '[');
  for (int k = 0; k < 3; k++) {
    api_json_number(out, v[k]);
  }
  api_json_close(out, ']');
}

static void write_topology(const orb_topology *topology, api_text *out) {
  api_json_key(out, "topology");
  api_json_open(out, '{');
  api_json_member_integer(out, "components", topology->components);
  api_json_member_number(out, "genus", topology->genus);
  api_json_member_integer(out, "boundary_loops", topology->boundary_loops);
  api_json_member_integer(out, "nonmanifold_edges", topology->nonmanifold_edges);
  api_json_member_integer(out, "nonmanifold_vertices", topology->nonmanifold_vertices);
  api_json_close(out, '}');
}

static void write_lists(const orb_mesh *mesh, api_text *out) {
  api_json_key(out, "repairs");
  api_json_open(out, '[');
  for (int32_t i = 0; i < mesh->repair_count; i++) {
    api_json_open(out, '{');
    api_json_member_string(out, "kind", mesh->repairs[i].kind);
    api_json_member_integer(out, "count", mesh->repairs[i].count);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
  api_json_key(out, "attributes");
  api_json_open(out, '[');
  if (mesh->normals) {
    api_json_string(out, "normal");
  }
  if (mesh->texcoords) {
    api_json_string(out, "texcoord");
  }
  if (mesh->colors) {
    api_json_string(out, "color");
  }
  api_json_close(out, ']');
}

void api_mesh_write(const api_mesh_facts *facts, api_text *out) {
  const orb_mesh *mesh = facts->mesh;
  api_json_open(out, '{');
  api_json_member_string(out, "id", facts->id);
  api_json_key(out, "url");
  api_text_printf(out, "\"/v1/meshes/%s\"", facts->id);
  api_json_member_string(out, "name", facts->name);
  api_json_member_string(out, "format", facts->format);
  api_json_member_integer(out, "bytes", facts->bytes);
  api_json_member_integer(out, "vertices", mesh->vertex_count);
  api_json_member_integer(out, "triangles", mesh->triangle_count);
  api_json_member_integer(out, "file_vertices", mesh->file_vertex_count);
  api_json_member_integer(out, "file_triangles", mesh->file_triangle_count);
  write_topology(&facts->topology, out);
  api_json_member_number(out, "area", facts->extent.area);
  api_json_member_number(out, "volume", facts->extent.volume);
  api_json_key(out, "bounds");
  api_json_open(out, '{');
  write_vector(out, "min", facts->extent.min);
  write_vector(out, "max", facts->extent.max);
  api_json_close(out, '}');
  api_json_member_string(out, "repair", facts->repair);
  write_lists(mesh, out);
  api_json_member_instant(out, "created", facts->created);
  api_json_close(out, '}');
}

static int get_text(const cJSON *object, const char *name, char *out, size_t size) {
  const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, name);
  return cJSON_IsString(value) && snprintf(out, size, "%s", value->valuestring) < (int)size;
}

static int get_count(const cJSON *object, const char *name, int64_t *out) {
  const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, name);
  int fine = cJSON_IsNumber(value) && value->valuedouble >= 0 && value->valuedouble <= 0x1p53;
  *out = fine ? (int64_t)value->valuedouble : -1;
  return fine;
}

int api_mesh_summarise(const char *json, api_mesh_summary *out) {
  cJSON *object = cJSON_Parse(json);
  int fine = get_text(object, "name", out->name, sizeof out->name) &&
             get_text(object, "format", out->format, sizeof out->format) &&
             get_text(object, "repair", out->repair, sizeof out->repair) &&
             get_count(object, "vertices", &out->vertices) && get_count(object, "triangles", &out->triangles) &&
             get_count(object, "file_vertices", &out->file_vertices) &&
             get_count(object, "file_triangles", &out->file_triangles);
  cJSON_Delete(object);
  return fine;
}
