#include "api/mesh_codec.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"

static const struct {
  const char *name;
  unsigned flag;
} kinds[] = {{"none", ORB_REPAIR_NONE},
             {"safe", ORB_REPAIR_SAFE},
             {"fill_holes", ORB_REPAIR_FILL_HOLES},
             {"largest_component", ORB_REPAIR_LARGEST_COMPONENT},
             {"close_handles", ORB_REPAIR_CLOSE_HANDLES},
             {"split_nonmanifold", ORB_REPAIR_SPLIT}};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

/* A float's rounding: no loop is shorter. */
static const double HANDLE_SIZE_LEAST = 1e-6;

/* Refuses the value of a query parameter; returns 0. */
API_PRINTF(3, 4) static int refuse(api_problem *problem, const char *parameter, const char *format, ...) {
  va_list args;
  va_start(args, format);
  char detail[512];
  vsnprintf(detail, sizeof detail, format, args);
  va_end(args);
  api_refuse(problem, "bad-query", "%s", detail);
  api_json_member_string(&problem->facts, "parameter", parameter);
  return 0;
}

static int read_handle_size(const char *text, size_t length, orb_repair_options *out, api_problem *problem) {
  char digits[40], *end = digits;
  double size = 0;
  if (length > 0 && length < sizeof digits && text[0] >= '.' && text[0] <= '9' && text[0] != '/') {
    memcpy(digits, text, length);
    digits[length] = 0;
    size = strtod(digits, &end);
  }
  if (end == digits || *end || !(size >= HANDLE_SIZE_LEAST && size <= ORB_HANDLE_SIZE_MOST)) {
    return refuse(problem, "handle_size",
                  "\"handle_size\" must be a number from 0.000001 to 10, such as 0.05: the length of a loop around "
                  "a handle relative to the diagonal.");
  }
  snprintf(digits, sizeof digits, "%.9g", size); /* as in the canonical list */
  out->handle_size = strtod(digits, NULL);
  return 1;
}

static int read_part(const char *text, orb_repair_options *out, api_problem *problem) {
  size_t length = strlen(text);
  int is_number = length < 10 && strspn(text, "0123456789") == length;
  out->repair |= ORB_REPAIR_PART;
  if (length == 0 || length >= sizeof out->part_name || !api_utf8_valid(text, length)) {
    return refuse(problem, "part", "\"part\" must be a number or a name of 1 to 127 bytes in UTF-8.");
  }
  for (const unsigned char *c = (const unsigned char *)text; *c; c++) {
    if (*c < 0x20 || *c == 0x7f) {
      return refuse(problem, "part", "\"part\" must not contain control characters.");
    }
  }
  out->part = is_number ? (int32_t)strtol(text, NULL, 10) : 0;
  snprintf(out->part_name, sizeof out->part_name, "%s", is_number ? "" : text);
  return 1;
}

static void write_canonical(const orb_repair_options *options, char canonical[API_REPAIR_TEXT]) {
  unsigned all = options->repair;
  char size[48] = "", part[16] = "";
  if (options->handle_size != ORB_HANDLE_SIZE) {
    snprintf(size, sizeof size, ":%.9g", options->handle_size);
  }
  snprintf(part, sizeof part, "%d", options->part);
  snprintf(canonical, API_REPAIR_TEXT, "%s%s%s%s%s%s%s%s", all ? "safe" : "none",
           all & ORB_REPAIR_FILL_HOLES ? ",fill_holes" : "",
           all & ORB_REPAIR_LARGEST_COMPONENT ? ",largest_component" : "",
           all & ORB_REPAIR_SPLIT ? ",split_nonmanifold" : "", all & ORB_REPAIR_CLOSE_HANDLES ? ",close_handles" : "",
           all & ORB_REPAIR_CLOSE_HANDLES ? size : "", all & ORB_REPAIR_PART ? ",part:" : "",
           !(all & ORB_REPAIR_PART) ? ""
           : options->part_name[0]  ? options->part_name
                                    : part);
}

/* Parses the list, in which "close_handles:SIZE" and, at the end, "part:NAME" stand for the parameters. */
static int read_list(const char *list, orb_repair_options *out, int *none, api_problem *problem) {
  static const char handles[] = "close_handles:", part[] = "part:";
  for (const char *at = list;; at++) {
    size_t n = strcspn(at, ","), k = 0;
    if (strncmp(at, part, strlen(part)) == 0) {
      return read_part(at + strlen(part), out, problem);
    }
    if (strncmp(at, handles, strlen(handles)) == 0) {
      if (!read_handle_size(at + strlen(handles), n - strlen(handles), out, problem)) {
        return 0;
      }
      out->repair |= ORB_REPAIR_CLOSE_HANDLES;
    } else {
      while (k < KINDS && !(strlen(kinds[k].name) == n && strncmp(kinds[k].name, at, n) == 0)) {
        k++;
      }
      if (k == KINDS) {
        return refuse(problem, "repair",
                      "There is no repair \"%.*s\". Use none, safe, fill_holes, largest_component, "
                      "split_nonmanifold or close_handles.",
                      (int)(n < 60 ? n : 60), at);
      }
      *none |= k == 0;
      out->repair |= kinds[k].flag;
    }
    at += n;
    if (!*at) {
      return 1;
    }
  }
}

int api_repair_parse(const char *list, const char *handle_size, const char *part, orb_repair_options *out,
                     char canonical[API_REPAIR_TEXT], api_problem *problem) {
  int none = 0;
  *out = (orb_repair_options){.handle_size = ORB_HANDLE_SIZE};
  if (!read_list(list, out, &none, problem) || (part && !read_part(part, out, problem)) ||
      (handle_size && !read_handle_size(handle_size, strlen(handle_size), out, problem))) {
    return 0;
  }
  if (none && out->repair) {
    return refuse(problem, "repair", "The repair \"none\" excludes all others. Remove it or the others.");
  }
  if (handle_size && !(out->repair & ORB_REPAIR_CLOSE_HANDLES)) {
    return refuse(problem, "handle_size", "\"handle_size\" needs repair=close_handles. Add it or remove the size.");
  }
  if (out->repair & ORB_REPAIR_PART) { /* says which piece to keep */
    out->repair &= ~(unsigned)ORB_REPAIR_LARGEST_COMPONENT;
  }
  out->repair |= out->repair ? ORB_REPAIR_SAFE : 0;
  write_canonical(out, canonical);
  return 1;
}

int api_upload_read(const api_upload_query *query, api_upload *out, api_problem *problem) {
  const char *name = query->name;
  memset(out, 0, sizeof *out);
  if (name && (!*name || strlen(name) >= sizeof out->name || !api_utf8_valid(name, strlen(name)))) {
    return refuse(problem, "name", "\"name\" must be UTF-8 of 1 to 127 bytes.");
  }
  snprintf(out->name, sizeof out->name, "%s", name ? name : "mesh");
  for (const unsigned char *c = (const unsigned char *)out->name; *c; c++) {
    if (*c < 0x20 || *c == 0x7f) {
      return refuse(problem, "name", "\"name\" must not contain control characters.");
    }
  }
  if (query->format) {
    out->hint = orb_format_of_name(query->format);
    if (out->hint == ORB_FORMAT_AUTO) {
      return refuse(problem, "format", "\"format\" must be obj, off, ply, stl, 3mf, gltf or glb, or be omitted.");
    }
  }
  return api_repair_parse(query->repair ? query->repair : "safe", query->handle_size, query->part, &out->options,
                          out->repair, problem);
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

static void write_handle(const orb_mesh *mesh, const orb_handle *handle, api_text *out) {
  api_json_open(out, '{');
  api_json_member_string(out, "kind", "close_handles");
  api_json_member_integer(out, "count", 1);
  api_json_key(out, "loop");
  api_json_open(out, '[');
  for (int32_t i = 0; i < handle->count; i++) {
    api_json_integer(out, mesh->loop_vertices[handle->start + i]);
  }
  api_json_close(out, ']');
  api_json_member_number(out, "length_relative", handle->length_relative);
  api_json_member_string(out, "how", handle->filled ? "fill" : "cut");
  api_json_member_number(out, "area_relative", handle->area_relative);
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
  for (int32_t i = 0; i < mesh->handle_count; i++) {
    write_handle(mesh, &mesh->handles[i], out);
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

static int read_summary(const cJSON *object, api_mesh_summary *out) {
  return get_text(object, "name", out->name, sizeof out->name) &&
         get_text(object, "format", out->format, sizeof out->format) &&
         get_text(object, "repair", out->repair, sizeof out->repair) && get_count(object, "vertices", &out->vertices) &&
         get_count(object, "triangles", &out->triangles) && get_count(object, "file_vertices", &out->file_vertices) &&
         get_count(object, "file_triangles", &out->file_triangles);
}

/* A description may list loops of half a million values, so only its short members are read. */
int api_mesh_summarise(const char *json, api_mesh_summary *out) {
  enum { SHORT = 6 * ORB_NAME_MAX + API_REPAIR_TEXT };
  const char *at = api_json_blanks(json);
  api_json_span name, value;
  api_text few = {0};
  api_json_open(&few, '{');
  for (at += *at == '{'; api_json_next_member(&at, &name, &value);) {
    if (value.end - value.at <= SHORT &&
        (*value.at == '"' || *value.at == '-' || (*value.at >= '0' && *value.at <= '9'))) {
      api_text_append(&few, few.size > 1 ? "," : "", few.size > 1);
      api_text_append(&few, name.at, (size_t)(value.end - name.at));
    }
  }
  api_json_close(&few, '}');
  cJSON *object = few.failed ? NULL : cJSON_Parse(few.data);
  int fine = object && read_summary(object, out);
  cJSON_Delete(object);
  api_text_free(&few);
  return fine;
}
