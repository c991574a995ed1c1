#include "api/embedding_codec.h"

#include <ctype.h>
#include <stddef.h>
#include <string.h>

#include "api/options.h"
#include "api/report_codec.h"

static const char *const methods[] = {"newton", "kernel-sampling", NULL};
static const char *const presets[] = {"default", "fast", "quality", NULL};

#define AT(field) offsetof(orb_embed_options, field)
static const api_option table[] = {
    {"preset", API_OPTION_NAME, AT(preset), 0, 0, presets},
    {"energy_weight", API_OPTION_NUMBER, AT(energy_weight), 0, 1000, NULL},
    {"area_exponent", API_OPTION_NUMBER, AT(area_exponent), 0, 100, NULL},
    {"aspect_exponent", API_OPTION_NUMBER, AT(aspect_exponent), 0, 100, NULL},
    {"step", API_OPTION_NUMBER, AT(step), 1e-6, 1, NULL},
    {"displacement_threshold", API_OPTION_NUMBER, AT(displacement_threshold), 1e-15, 1, NULL},
    {"max_iterations", API_OPTION_INT32, AT(max_iterations), 1, 1e6, NULL},
    {"first_optimization", API_OPTION_INT32, AT(first_optimization), 1, 1e8, NULL},
    {"growth", API_OPTION_NUMBER, AT(growth), 1.001, 100, NULL},
    {"qem_until", API_OPTION_INT32, AT(qem_until), 0, 1e8, NULL},
};
static const api_option method_option = {"method", API_OPTION_NAME, AT(method), 0, 0, methods};
enum { OPTIONS = sizeof table / sizeof table[0] };

int api_embedding_options_read(const cJSON *object, const char *where, int with_mesh, orb_embed_options *out,
                               api_problem *problem) {
  static const char *const known[] = {"method", "options", NULL};
  static const char *const known_mesh[] = {"mesh", "method", "options", NULL};
  orb_embed_defaults(out);
  if (!cJSON_IsObject(object)) {
    return api_refuse(problem, "invalid-request", "%c%s must be a JSON object.", toupper((unsigned char)where[0]),
                      where + 1);
  }
  if (!api_members_known(object, where, with_mesh ? known_mesh : known, problem)) {
    return 0;
  }
  cJSON *method = cJSON_GetObjectItemCaseSensitive(object, "method");
  if (method) {
    cJSON only = {.child = method, .type = cJSON_Object}, *next = method->next;
    method->next = NULL;
    int fine = api_options_read(&only, where, &method_option, 1, out, problem);
    method->next = next;
    if (!fine) {
      return 0;
    }
  }
  const cJSON *options = cJSON_GetObjectItemCaseSensitive(object, "options");
  return !options || api_options_read(options, "\"options\"", table, OPTIONS, out, problem);
}

int api_embedding_request_read(const cJSON *body, api_embedding_request *out, api_problem *problem) {
  memset(out, 0, sizeof *out);
  if (!api_embedding_options_read(body, "the request", 1, &out->options, problem)) {
    return 0;
  }
  const cJSON *mesh = cJSON_GetObjectItemCaseSensitive(body, "mesh");
  if (!cJSON_IsString(mesh)) {
    return api_refuse(problem, "invalid-request", "\"mesh\" must be the id of an uploaded mesh.");
  }
  if (!api_id_valid(mesh->valuestring, strlen(mesh->valuestring))) {
    return api_refuse(problem, "not-found",
                      "\"mesh\" is not the id of a mesh. Upload the mesh and use the \"id\" of the answer.");
  }
  memcpy(out->mesh, mesh->valuestring, API_ID_SIZE);
  return 1;
}

void api_embedding_options_members(const orb_embed_options *options, api_text *out) {
  orb_embed_options defaults;
  orb_embed_defaults(&defaults);
  api_json_member_string(out, "method", methods[options->method]);
  api_json_key(out, "options");
  api_options_write(out, table, OPTIONS, options, &defaults);
}

void api_embedding_request_write(const api_embedding_request *request, api_text *out) {
  api_json_open(out, '{');
  api_json_member_string(out, "mesh", request->mesh);
  api_embedding_options_members(&request->options, out);
  api_json_close(out, '}');
}

int api_embedding_request_id(const api_embedding_request *request, char id[API_ID_SIZE]) {
  api_text text = {0};
  api_text_add(&text, ORB_ENGINE " embedding");
  api_embedding_request_write(request, &text);
  int fine = !text.failed;
  if (fine) {
    api_id_of_text(text.data, text.size, id);
  }
  api_text_free(&text);
  return fine;
}

void api_embedding_write(const char *id, const api_embedding_request *request, const orb_embedding *embedding,
                         int64_t created, api_text *out) {
  const orb_embed_timings *t = &embedding->timings;
  api_json_open(out, '{');
  api_json_member_string(out, "id", id);
  api_json_key(out, "url");
  api_text_printf(out, "\"/v1/embeddings/%s\"", id);
  api_json_member_string(out, "mesh", request->mesh);
  api_embedding_options_members(&request->options, out);
  api_json_key(out, "certificate");
  api_certificate_write(out, &embedding->certificate);
  api_json_key(out, "distortion");
  api_distortion_write(out, &embedding->distortion);
  api_json_key(out, "timings_ms");
  api_json_open(out, '{');
  api_json_member_number(out, "check", 1e3 * t->check);
  api_json_member_number(out, "simplify", 1e3 * t->simplify);
  api_json_member_number(out, "embed", 1e3 * t->embed);
  api_json_member_number(out, "certify", 1e3 * t->certify);
  api_json_member_number(out, "total", 1e3 * t->total);
  api_json_close(out, '}');
  api_json_key(out, "sphere");
  api_text_printf(out, "\"/v1/embeddings/%s/sphere.ply\"", id);
  api_json_member_string(out, "engine", ORB_ENGINE);
  api_json_member_instant(out, "created", created);
  api_json_close(out, '}');
}
