#include "api/problem.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"

static const struct entry {
  const char *name;
  int status;
  const char *title;
} table[] = {
    {"bad-request", 400, "The request is malformed"},
    {"bad-query", 400, "A query parameter is not valid"},
    {"bad-header", 400, "A header is not valid"},
    {"malformed-json", 400, "The body is not valid JSON"},
    {"malformed-mesh", 400, "The mesh file is malformed"},
    {"malformed-encoding", 400, "The compressed body is malformed"},
    {"unauthorized", 401, "A valid token is required"},
    {"forbidden", 403, "The token does not allow this"},
    {"bad-signature", 403, "The signature is not valid"},
    {"expired-signature", 403, "The signature has expired"},
    {"foreign-host", 403, "The request addresses the daemon by a name that is not its own"},
    {"foreign-origin", 403, "A page of another site sent the request"},
    {"forbidden-address", 403, "The daemon may not connect to this address"},
    {"not-found", 404, "Nothing is here"},
    {"method-not-allowed", 405, "This path does not accept the method"},
    {"in-use", 409, "Unfinished jobs use this mesh"},
    {"job-ended", 409, "The job has already ended"},
    {"length-required", 411, "The length of the body is required"},
    {"precondition-failed", 412, "The resource differs from what the request expects"},
    {"too-large", 413, "The input is too large"},
    {"uri-too-long", 414, "The target of the request is too long"},
    {"unknown-format", 415, "The mesh format is not recognised"},
    {"unsupported-media-type", 415, "The media type is not supported"},
    {"unsupported-encoding", 415, "The content encoding is not supported"},
    {"range-not-satisfiable", 416, "The range lies outside the file"},
    {"not-closed", 422, "The mesh is not closed"},
    {"not-manifold", 422, "The mesh is not manifold"},
    {"not-orientable", 422, "The mesh cannot be oriented"},
    {"not-connected", 422, "The mesh is not connected"},
    {"not-genus-zero", 422, "The mesh has handles"},
    {"degenerate", 422, "The mesh has too few triangles or is too small"},
    {"not-finite", 422, "A coordinate is not finite or too large"},
    {"bad-landmarks", 422, "The landmarks are invalid or contradict each other"},
    {"bad-option", 422, "An option is not valid"},
    {"unknown-member", 422, "A member of the request is unknown"},
    {"invalid-request", 422, "A member of the request is not valid"},
    {"unsupported-method", 422, "The method is not available in this build"},
    {"cancelled", 409, "The job was cancelled"},
    {"too-many-requests", 429, "Too many requests came at once"},
    {"queue-full", 429, "The queue is full"},
    {"quota-exceeded", 429, "The quota is used up"},
    {"headers-too-large", 431, "The headers are too long"},
    {"internal", 500, "The daemon failed at this"},
    {"not-certified", 500, "The result could not be certified"},
    {"corrupt", 500, "Stored data is corrupt"},
    {"crashed", 500, "The job crashed the daemon repeatedly"},
    {"job-crashed", 500, "The process that did this work died"},
    {"fetch-failed", 502, "The file could not be fetched"},
    {"timeout", 503, "The work took longer than its time limit"},
    {"not-ready", 503, "The result is not ready"},
    {"no-memory", 503, "The daemon has no memory left"},
    {"unavailable", 503, "The daemon cannot answer this now"},
    {"read-only", 507, "The data folder is read-only"},
    {"storage-full", 507, "The disk is full"},
};
enum { COUNT = sizeof table / sizeof table[0] };

static const struct entry *find(const char *name) {
  for (size_t i = 0; i < COUNT; i++) {
    if (strcmp(table[i].name, name) == 0) {
      return &table[i];
    }
  }
  return find("internal");
}

const char *api_problem_name(const char *name) {
  return find(name)->name;
}

int api_problem_status(const char *name) {
  return find(name)->status;
}

void api_problem_free(api_problem *problem) {
  api_text_free(&problem->facts);
  memset(problem, 0, sizeof *problem);
}

int api_refuse(api_problem *problem, const char *name, const char *format, ...) {
  api_problem_free(problem);
  problem->name = find(name)->name;
  va_list args;
  va_start(args, format);
  vsnprintf(problem->detail, sizeof problem->detail, format, args);
  va_end(args);
  return 0;
}

static void pairs(api_text *out, const char *name, const orb_error *error) {
  api_json_key(out, name);
  api_json_open(out, '[');
  for (int32_t i = 0; i < error->edge_count; i++) {
    api_json_open(out, '[');
    api_json_integer(out, error->edges[i][0]);
    api_json_integer(out, error->edges[i][1]);
    api_json_close(out, ']');
  }
  api_json_close(out, ']');
}

static void integers(api_text *out, const char *name, const int32_t *values, int32_t count) {
  api_json_key(out, name);
  api_json_open(out, '[');
  for (int32_t i = 0; i < count; i++) {
    api_json_integer(out, values[i]);
  }
  api_json_close(out, ']');
}

static void loops(const orb_error *error, api_text *out) {
  api_json_key(out, "loops");
  api_json_open(out, '[');
  for (int32_t i = 0; i < error->loop_count; i++) {
    api_json_open(out, '[');
    for (int32_t k = error->loop_start[i]; k < error->loop_start[i + 1]; k++) {
      api_json_integer(out, error->loop_vertices[k]);
    }
    api_json_close(out, ']');
  }
  api_json_close(out, ']');
  api_json_key(out, "loop_lengths_relative");
  api_json_open(out, '[');
  for (int32_t i = 0; i < error->loop_count; i++) {
    api_json_number(out, error->loop_length_relative[i]);
  }
  api_json_close(out, ']');
  if (error->genus > error->loop_count) {
    api_json_member_integer(out, "loops_left_out", error->genus - error->loop_count);
  }
}

static void topology_facts(const orb_error *error, api_text *out) {
  int open = error->status == ORB_E_NOT_CLOSED;
  if (error->boundary_loops >= 0) {
    api_json_member_integer(out, "boundary_loops", error->boundary_loops);
  }
  if (error->genus >= 0) {
    api_json_member_integer(out, "genus", error->genus);
  }
  if (error->status == ORB_E_NOT_GENUS_ZERO) {
    loops(error, out);
  }
  if (error->edge_total > 0 || open) {
    api_json_member_integer(out, open ? "boundary_edge_count" : "edge_count", error->edge_total);
    pairs(out, open ? "boundary_edges" : "edges", error);
  }
  if (error->vertex_total > 0) {
    api_json_member_integer(out, "vertex_count", error->vertex_total);
    integers(out, "vertices", error->vertices, error->vertex_count);
  }
  if (error->component_total > 0) {
    api_json_member_integer(out, "component_count", error->component_total);
    api_json_key(out, "components");
    api_json_open(out, '[');
    for (int32_t i = 0; i < error->component_count; i++) {
      api_json_integer(out, error->components[i]);
    }
    api_json_close(out, ']');
    api_json_key(out, "parts");
    api_json_open(out, '[');
    for (int32_t i = 0; i < error->component_count; i++) {
      api_json_open(out, '{');
      api_json_member_integer(out, "part", i);
      api_json_member_integer(out, "triangles", error->components[i]);
      if (error->component_names[i][0]) {
        api_json_member_string(out, "name", error->component_names[i]);
      }
      if (error->component_nodes[i][0]) {
        api_json_member_string(out, "node", error->component_nodes[i]);
      }
      api_json_close(out, '}');
    }
    api_json_close(out, ']');
  }
}

static void elements(const orb_error *error, api_text *out) {
  api_json_member_integer(out, "element_count", error->element_total);
  api_json_key(out, "elements");
  api_json_open(out, '[');
  for (int32_t i = 0; i < error->element_count; i++) {
    api_json_open(out, '{');
    api_json_member_string(out, "where", error->elements[i].where);
    if (error->elements[i].name[0]) {
      api_json_member_string(out, "name", error->elements[i].name);
    }
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

void api_problem_of_error(const orb_error *error, api_problem *problem) {
  api_refuse(problem, orb_status_name(error->status), "%s", error->detail);
  api_text *out = &problem->facts;
  if (error->line >= 0) {
    api_json_member_integer(out, "line", error->line);
  }
  if (error->offset >= 0) {
    api_json_member_integer(out, "offset", error->offset);
  }
  topology_facts(error, out);
  if (error->landmark_count > 0) {
    integers(out, "landmarks", error->landmarks, error->landmark_count);
  }
  if (error->shape >= 0) {
    api_json_member_integer(out, "shape", error->shape);
  }
  if (error->transfer >= 0) {
    api_json_member_integer(out, "transfer", error->transfer);
  }
  if (error->element_count > 0) {
    elements(error, out);
  }
}

/* The elements of an array, one after the other, from the bracket that opens it. 0: it has no more. */
static int next_element(const char **at, api_json_span *out) {
  out->at = api_json_blanks(*at + (**at == '[' || **at == ','));
  out->end = api_json_after(out->at);
  *at = api_json_blanks(out->end);
  return out->end > out->at;
}

static int is_name(api_json_span name, const char *wanted) {
  const size_t size = strlen(wanted);
  return name.end == name.at + size + 2 && memcmp(name.at + 1, wanted, size) == 0;
}

static void append(api_text *out, api_json_span text) {
  if (out->size && !strchr("[{:", out->data[out->size - 1])) {
    api_text_append(out, ",", 1);
  }
  api_text_append(out, text.at, (size_t)(text.end - text.at));
}

/* Appends the first loops and their lengths, of at most `most` bytes; returns how many. */
static int append_loops(api_json_span loops, api_json_span lengths, size_t most, api_text *out) {
  api_text kept = {0};
  int count = 0;
  api_json_span loop, length;
  api_json_key(out, "loops");
  api_json_open(out, '[');
  api_json_key(&kept, "loop_lengths_relative");
  api_json_open(&kept, '[');
  while (next_element(&loops.at, &loop) && next_element(&lengths.at, &length)) {
    const size_t bytes = (size_t)(loop.end - loop.at + length.end - length.at) + 2;
    if (bytes > most) {
      break;
    }
    most -= bytes;
    append(out, loop);
    append(&kept, length);
    count++;
  }
  api_json_close(out, ']');
  api_json_close(&kept, ']');
  append(out, (api_json_span){kept.data, kept.data + kept.size});
  out->failed |= kept.failed;
  api_text_free(&kept);
  return count;
}

/* Values would take thirty times the bytes of the text, so it is taken apart as it is. */
void api_problem_shorten(api_problem *problem, size_t most) {
  api_json_span name, value, loops = {0}, lengths = {0};
  double genus = 0;
  api_text out = {0};
  if (problem->facts.size <= most) {
    return;
  }
  for (const char *at = problem->facts.data; api_json_next_member(&at, &name, &value);) {
    if (is_name(name, "loops")) {
      loops = value;
    } else if (is_name(name, "loop_lengths_relative")) {
      lengths = value;
    } else if (!is_name(name, "loops_left_out")) {
      genus = is_name(name, "genus") ? strtod(value.at, NULL) : genus;
      append(&out, (api_json_span){name.at, value.end});
    }
  }
  if (!loops.at) {
    api_text_free(&out);
    return;
  }
  if (lengths.at && *loops.at == '[' && *lengths.at == '[') {
    const double left_out = genus - append_loops(loops, lengths, most, &out);
    if (left_out > 0) {
      api_json_member_number(&out, "loops_left_out", left_out);
    }
  } else {
    out.failed = 1;
  }
  out.failed |= problem->facts.failed;
  api_text_free(&problem->facts);
  problem->facts = out;
}

void api_problem_write(const api_problem *problem, api_text *out) {
  const struct entry *entry = find(problem->name);
  api_json_open(out, '{');
  api_json_key(out, "type");
  api_text_printf(out, "\"/problems/%s\"", entry->name);
  api_json_member_string(out, "title", entry->title);
  api_json_member_integer(out, "status", entry->status);
  api_json_member_string(out, "detail", problem->detail);
  if (problem->facts.size) {
    api_text_append(out, ",", 1);
    api_text_append(out, problem->facts.data, problem->facts.size);
  }
  out->failed |= problem->facts.failed;
  api_json_close(out, '}');
}
