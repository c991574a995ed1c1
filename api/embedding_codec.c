#include "api/embedding_codec.h"

#include <ctype.h>
#include <stddef.h>
#include <string.h>

#include "api/options.h"
#include "api/report_codec.h"

static const char *const methods[] = {"newton", "kernel-sampling", NULL};
static const char *const presets[] = {"default", "fast", "quality", NULL};

#define AT(field) offsetof(orb_embed_options, field)
static const orb_option table[] = {
    {"preset", ORB_OPTION_NAME, AT(preset), 0, 0, presets},
    {"energy_weight", ORB_OPTION_NUMBER, AT(energy_weight), 0, 1000, NULL},
    {"area_exponent", ORB_OPTION_NUMBER, AT(area_exponent), 0, 100, NULL},
    {"aspect_exponent", ORB_OPTION_NUMBER, AT(aspect_exponent), 0, 100, NULL},
    {"step", ORB_OPTION_NUMBER, AT(step), 1e-6, 1, NULL},
    {"displacement_threshold", ORB_OPTION_NUMBER, AT(displacement_threshold), 1e-15, 1, NULL},
    {"max_iterations", ORB_OPTION_INT32, AT(max_iterations), 1, 1e6, NULL},
    {"first_optimization", ORB_OPTION_INT32, AT(first_optimization), 1, 1e8, NULL},
    {"growth", ORB_OPTION_NUMBER, AT(growth), 1.001, 100, NULL},
    {"qem_until", ORB_OPTION_INT32, AT(qem_until), 0, 1e8, NULL},
};
static const orb_option method_option = {"method", ORB_OPTION_NAME, AT(method), 0, 0, methods};
enum { OPTIONS = sizeof table / sizeof table[0] };

int orb_embedding_options_read(const cJSON *object, const char *where, int with_mesh, orb_embed_options *out,
                               orb_problem *problem) {
  static const char *const known[] = {"method", "options", NULL};
  static const char *const known_mesh[] = {"mesh", "method", "options", NULL};
  orb_embed_defaults(out);
  if (!cJSON_IsObject(object)) {
    return orb_refuse(problem, "invalid-request", "%c%s must be a JSON object.", toupper((unsigned char)where[0]),
                      where + 1);
  }
  if (!orb_members_known(object, where, with_mesh ? known_mesh : known, problem)) {
    return 0;
  }
  cJSON *method = cJSON_GetObjectItemCaseSensitive(object, "method");
  if (method) {
    cJSON only = {.child = method, .type = cJSON_Object}, *next = method->next;
    method->next = NULL;
    int fine = orb_options_read(&only, where, &method_option, 1, out, problem);
    method->next = next;
    if (!fine) {
      return 0;
    }
  }
  const cJSON *options = cJSON_GetObjectItemCaseSensitive(object, "options");
  return !options || orb_options_read(options, "\"options\"", table, OPTIONS, out, problem);
}

int orb_embedding_request_read(const cJSON *body, orb_embedding_request *out, orb_problem *problem) {
  memset(out, 0, sizeof *out);
  if (!orb_embedding_options_read(body, "the request", 1, &out->options, problem)) {
    return 0;
  }
  const cJSON *mesh = cJSON_GetObjectItemCaseSensitive(body, "mesh");
  if (!cJSON_IsString(mesh)) {
    return orb_refuse(problem, "invalid-request", "\"mesh\" must be the id of an uploaded mesh.");
  }
  if (!orb_id_valid(mesh->valuestring, strlen(mesh->valuestring))) {
    return orb_refuse(problem, "not-found", "\"mesh\" is not the id of a mesh: upload it first, and use its \"id\".");
  }
  memcpy(out->mesh, mesh->valuestring, ORB_ID_SIZE);
  return 1;
}

void orb_embedding_options_members(const orb_embed_options *options, orb_text *out) {
  orb_embed_options defaults;
  orb_embed_defaults(&defaults);
  orb_json_member_string(out, "method", methods[options->method]);
  orb_json_key(out, "options");
  orb_options_write(out, table, OPTIONS, options, &defaults);
}

void orb_embedding_request_write(const orb_embedding_request *request, orb_text *out) {
  orb_json_open(out, '{');
  orb_json_member_string(out, "mesh", request->mesh);
  orb_embedding_options_members(&request->options, out);
  orb_json_close(out, '}');
}

int orb_embedding_request_id(const orb_embedding_request *request, char id[ORB_ID_SIZE]) {
  orb_text text = {0};
  orb_text_add(&text, ORB_ENGINE " embedding");
  orb_embedding_request_write(request, &text);
  int fine = !text.failed;
  if (fine) {
    orb_id_of_text(text.data, text.size, id);
  }
  orb_text_free(&text);
  return fine;
}

void orb_embedding_write(const char *id, const orb_embedding_request *request, const orb_embedding *embedding,
                         int64_t created, orb_text *out) {
  const orb_embed_timings *t = &embedding->timings;
  orb_json_open(out, '{');
  orb_json_member_string(out, "id", id);
  orb_json_key(out, "url");
  orb_text_printf(out, "\"/v1/embeddings/%s\"", id);
  orb_json_member_string(out, "mesh", request->mesh);
  orb_embedding_options_members(&request->options, out);
  orb_json_key(out, "certificate");
  orb_certificate_write(out, &embedding->certificate);
  orb_json_key(out, "distortion");
  orb_distortion_write(out, &embedding->distortion);
  orb_json_key(out, "timings_ms");
  orb_json_open(out, '{');
  orb_json_member_number(out, "check", 1e3 * t->check);
  orb_json_member_number(out, "simplify", 1e3 * t->simplify);
  orb_json_member_number(out, "embed", 1e3 * t->embed);
  orb_json_member_number(out, "certify", 1e3 * t->certify);
  orb_json_member_number(out, "total", 1e3 * t->total);
  orb_json_close(out, '}');
  orb_json_key(out, "sphere");
  orb_text_printf(out, "\"/v1/embeddings/%s/sphere.ply\"", id);
  orb_json_member_string(out, "engine", ORB_ENGINE);
  orb_json_member_instant(out, "created", created);
  orb_json_close(out, '}');
}
