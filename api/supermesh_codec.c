#include "api/supermesh_codec.h"
#include "api/transfer_codec.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/json.h"
#include "api/report_codec.h"

/* Of the landmarks that are not soft. */
static int landmarks_exact(const orb_merge_result *result) {
  int32_t shapes = result->supermesh.shape_count;
  for (int32_t l = 0; l < result->alignment.landmark_count; l++) {
    if (result->alignment.shapes[0].landmark_vertices[l] < 0) {
      continue;
    }
    if (result->supermesh.landmark_vertices[l] < 0) {
      return 0;
    }
    for (int32_t s = 0; s < shapes; s++) {
      if (!(result->landmark_residuals[(size_t)l * (size_t)shapes + (size_t)s] <= 1e-9)) {
        return 0;
      }
    }
  }
  return 1;
}

void api_merge_certificate_write(const orb_merge_result *result, api_text *out) {
  const orb_supermesh *mesh = &result->supermesh;
  api_json_open(out, '{');
  /* Redundant by design: the engine returns only closed supermeshes of genus zero, and Euler's formula checks it. */
  api_json_member_bool(out, "closed", (int64_t)mesh->triangle_count == 2 * (int64_t)mesh->vertex_count - 4);
  api_json_member_number(out, "genus", (2 - ((double)mesh->vertex_count - 0.5 * (double)mesh->triangle_count)) / 2);
  api_json_key(out, "flipped");
  api_json_open(out, '[');
  for (int32_t s = 0; s < mesh->shape_count; s++) {
    api_json_integer(out, result->alignment.shapes[s].certificate.flipped);
  }
  api_json_close(out, ']');
  api_json_key(out, "degree");
  api_json_open(out, '[');
  for (int32_t s = 0; s < mesh->shape_count; s++) {
    api_json_integer(out, result->alignment.shapes[s].certificate.degree);
  }
  api_json_close(out, ']');
  api_json_member_bool(out, "landmarks_exact", landmarks_exact(result));
  api_json_key(out, "supermesh");
  api_json_open(out, '{');
  api_json_member_integer(out, "flipped", mesh->flipped);
  api_json_member_integer(out, "degree", mesh->degree);
  api_json_close(out, '}');
  api_json_close(out, '}');
}

void api_pairs_write(const orb_merge_result *result, api_text *out) {
  api_json_open(out, '[');
  for (int32_t i = 0; i < result->pair_count; i++) {
    api_json_open(out, '{');
    api_json_member_integer(out, "a", result->pairs[i].a);
    api_json_member_integer(out, "b", result->pairs[i].b);
    api_json_key(out, "distortion");
    api_distortion_write(out, &result->pairs[i].distortion);
    api_json_member_number(out, "inverted_fraction", result->pairs[i].inverted_fraction);
    api_json_member_integer(out, "inverted_count", result->pairs[i].inverted_count);
    api_json_key(out, "inverted_triangles");
    api_json_open(out, '[');
    for (int32_t k = 0; k < result->pairs[i].inverted_listed; k++) {
      api_json_integer(out, result->pairs[i].inverted_triangles[k]);
    }
    api_json_close(out, ']');
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

static void write_numbers(const char *name, const double *numbers, int32_t count, api_text *out) {
  api_json_key(out, name);
  api_json_open(out, '[');
  for (int32_t i = 0; i < count; i++) {
    api_json_number(out, numbers[i]);
  }
  api_json_close(out, ']');
}

/* A part of a warning: its ball on both shapes, and triangles of the supermesh. */
static void write_warning_part(const orb_warning *warning, const orb_warning_part *part, api_text *out) {
  api_json_open(out, '{');
  api_json_member_number(out, "share", part->share);
  api_json_key(out, "at");
  api_json_open(out, '[');
  for (int k = 0; k < 2; k++) {
    api_json_open(out, '{');
    api_json_member_integer(out, "shape", k ? warning->b : warning->a);
    write_numbers("centre", part->centre[k], 3, out);
    api_json_member_number(out, "radius", part->radius[k]);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
  api_json_key(out, "triangles");
  api_json_open(out, '[');
  for (int32_t t = 0; t < part->triangle_count; t++) {
    api_json_open(out, '[');
    for (int k = 0; k < 3; k++) {
      api_json_integer(out, part->triangles[3 * t + k]);
    }
    api_json_close(out, ']');
  }
  api_json_close(out, ']');
  api_json_close(out, '}');
}

static void write_warnings(const orb_merge_result *result, api_text *out) {
  static const char *const kinds[] = {"stretched", "thin"};
  api_json_key(out, "warnings");
  api_json_open(out, '[');
  for (int32_t i = 0; i < result->warning_count; i++) {
    const orb_warning *warning = &result->warnings[i];
    api_json_open(out, '{');
    api_json_member_string(out, "kind", kinds[warning->kind]);
    api_json_member_integer(out, "a", warning->a);
    api_json_member_integer(out, "b", warning->b);
    api_json_member_number(out, "share", warning->share);
    api_json_key(out, "parts");
    api_json_open(out, '[');
    for (int32_t p = 0; p < warning->part_count; p++) {
      write_warning_part(warning, &warning->parts[p], out);
    }
    api_json_close(out, ']');
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

/* What asset.fit did to a shape. */
static void write_fit(const orb_fit_report *fit, api_text *out) {
  static const char *const kinds[] = {"none", "rigid", "similarity"};
  api_json_key(out, "fit");
  api_json_open(out, '{');
  api_json_member_string(out, "kind", kinds[fit->kind]);
  api_json_member_number(out, "scale", fit->scale);
  api_json_member_number(out, "rotation_degrees", fit->rotation_degrees);
  api_json_member_number(out, "translation_relative", fit->translation_relative);
  api_json_member_number(out, "up_degrees", fit->up_degrees);
  api_json_close(out, '}');
}

/* Where the template is too coarse for a shape. */
static void write_coarse(const orb_coarse *coarse, double diagonal, api_text *out) {
  api_json_key(out, "coarse");
  api_json_open(out, '{');
  api_json_member_number(out, "share", coarse->share);
  api_json_member_integer(out, "count", coarse->count);
  api_json_key(out, "triangles");
  api_json_open(out, '[');
  for (int32_t i = 0; i < coarse->listed; i++) {
    api_json_integer(out, coarse->triangles[i]);
  }
  api_json_close(out, ']');
  api_json_key(out, "errors_relative");
  api_json_open(out, '[');
  for (int32_t i = 0; i < coarse->listed; i++) {
    api_json_number(out, coarse->errors[i] / diagonal);
  }
  api_json_close(out, ']');
  api_json_close(out, '}');
}

static void write_shapes(const char *id, const api_supermesh_request *request, const orb_merge_result *result,
                         api_text *out) {
  api_json_key(out, "shapes");
  api_json_open(out, '[');
  for (int32_t s = 0; s < request->shape_count; s++) {
    api_json_open(out, '{');
    api_json_member_string(out, "mesh", request->shapes[s].mesh);
    api_json_member_string(out, "name", request->shapes[s].name);
    api_json_key(out, "sphere");
    api_text_printf(out, "\"/v1/supermeshes/%s/spheres/%d.ply\"", id, s);
    api_shape_report_members(out, &result->shapes[s]);
    if (result->coarse && result->coarse[s].count > 0) {
      write_coarse(&result->coarse[s], result->shapes[s].diagonal, out);
    }
    write_fit(&result->fits[s], out);
    write_numbers("transform", result->transforms + 16 * (size_t)s, 16, out);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

static void write_found(const orb_merge_result *result, const api_place *found, api_text *out) {
  size_t shapes = (size_t)result->supermesh.shape_count;
  for (int32_t l = 0; l < result->alignment.found_count; l++) {
    char name[32];
    if (result->found_names[l]) {
      snprintf(name, sizeof name, "%s", result->found_names[l]);
    } else {
      snprintf(name, sizeof name, "auto %d", l + 1);
    }
    api_json_open(out, '{');
    api_json_member_string(out, "name", name);
    api_json_key(out, "at");
    api_json_open(out, '[');
    for (size_t s = 0; s < shapes; s++) {
      api_place_write(out, &found[(size_t)l * shapes + s]);
    }
    api_json_close(out, ']');
    write_numbers("residual_relative", result->found_residuals + (size_t)l * shapes, (int32_t)shapes, out);
    api_json_member_number(out, "confidence", result->alignment.confidence[l]);
    api_json_close(out, '}');
  }
}

/* Writes the landmarks of the request, or else the found ones. */
static void write_landmarks(const api_supermesh_request *request, const orb_merge_result *result,
                            const api_place *found, api_text *out) {
  int32_t shapes = request->shape_count;
  api_json_key(out, "landmarks");
  api_json_open(out, '[');
  for (int32_t l = 0; l < result->alignment.landmark_count; l++) {
    api_json_open(out, '{');
    api_json_member_string(out, "name", request->landmarks.items[l].name);
    api_json_member_integer(out, "vertex", result->supermesh.landmark_vertices[l]);
    api_landmark_weight_write(&request->landmarks.items[l], out);
    write_numbers("residual_relative", result->landmark_residuals + (size_t)l * (size_t)shapes, shapes, out);
    if (result->alignment.landmark_shares) {
      api_json_member_number(out, "share", result->alignment.landmark_shares[l]);
    }
    api_json_close(out, '}');
  }
  write_found(result, found, out);
  api_json_close(out, ']');
}

/* Landmarks of the request that may be misplaced. */
static void write_suspects(const api_supermesh_request *request, const orb_alignment *alignment, const api_place *meant,
                           api_text *out) {
  api_json_key(out, "suspects");
  api_json_open(out, '[');
  for (int32_t i = 0; i < alignment->suspect_count; i++) {
    const orb_suspect *one = &alignment->suspects[i];
    api_json_open(out, '{');
    api_json_member_integer(out, "landmark", one->landmark);
    api_json_member_string(out, "name", request->landmarks.items[one->landmark].name);
    api_json_member_integer(out, "shape", one->shape);
    api_json_member_number(out, "share", one->share);
    api_json_key(out, "at");
    api_place_write(out, &meant[i]);
    api_json_member_number(out, "distance_relative", one->distance);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

/* A match is sure from this confidence on. docs/bench-confidence.md says how often a sure match is right. */
static const double SURE = 0.8;

/* Appends how reliable the correspondence is that was found; nothing if none was searched. */
static void write_match(const orb_match_facts *match, api_text *out) {
  if (!match->is_measured) {
    return;
  }
  api_json_key(out, "match");
  api_json_open(out, '{');
  api_json_member_number(out, "confidence", match->confidence);
  api_json_member_string(out, "verdict",
                         match->confidence >= SURE               ? "sure"
                         : match->confidence >= ORB_MATCH_LIKELY ? "likely"
                                                                 : "unsure");
  api_json_member_number(out, "clear", match->clear);
  api_json_member_number(out, "lead", match->lead);
  api_json_member_number(out, "bend", match->bend);
  if (match->is_part) {
    api_json_member_bool(out, "part", 1);
  }
  api_json_close(out, '}');
}

/* The most confidence of a landmark that was found: 1 is that of given ones. */
static const double FOUND_MOST = 0.99;

/* The same request with the pairs of an alternative as landmarks, which the default method pins. Each landmark has the
 * confidence 1 / cost, or FOUND_MOST if that is less, since it was found, not given. */
static void write_alternative_request(const api_supermesh_request *request, const orb_alternative *alternative,
                                      api_place *spots, api_text *out) {
  api_landmark_spec items[ORB_ALTERNATIVE_PAIRS];
  api_supermesh_request changed = *request;
  memset(items, 0, sizeof items);
  for (int32_t i = 0; i < alternative->count; i++) {
    snprintf(items[i].name, sizeof items[i].name, "pair %d", i + 1);
    items[i].confidence = fmin(FOUND_MOST, 1 / alternative->cost);
    items[i].weight = 1;
  }
  changed.landmarks = (api_landmark_list){alternative->count, request->shape_count, items, spots};
  changed.merge.align.method = ORB_ALIGN_PIN;
  api_supermesh_request_write(&changed, out);
}

static void write_alternatives(const api_supermesh_request *request, const orb_alignment *alignment, api_place *spots,
                               api_text *out) {
  api_json_key(out, "alternatives");
  api_json_open(out, '[');
  for (int32_t i = 0; i < alignment->alternative_count; i++) {
    const orb_alternative *one = &alignment->alternatives[i];
    api_json_open(out, '{');
    api_json_member_number(out, "cost", one->cost);
    api_json_member_integer(out, "shape", one->shape);
    api_json_key(out, "request");
    write_alternative_request(request, one, spots, out);
    api_json_close(out, '}');
    spots += (size_t)one->count * (size_t)request->shape_count;
  }
  api_json_close(out, ']');
}

static void write_dropped(const orb_merge_result *result, api_text *out) {
  api_json_key(out, "dropped");
  api_json_open(out, '[');
  for (int32_t i = 0; i < result->dropped_count; i++) {
    api_json_open(out, '{');
    api_json_member_string(out, "what", result->dropped[i].what);
    api_json_member_string(out, "where", result->dropped[i].where);
    api_json_member_string(out, "why", result->dropped[i].why);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

/* Rims that lie on each other; nothing where there are none. */
static void write_rims(const orb_alignment *alignment, api_text *out) {
  if (alignment->rim_count == 0) {
    return;
  }
  api_json_key(out, "rims");
  api_json_open(out, '[');
  for (int32_t i = 0; i < alignment->rim_count; i++) {
    const orb_rim_match *one = &alignment->rims[i];
    api_json_open(out, '{');
    api_json_member_integer(out, "shape", one->shape);
    for (int k = 0; k < 2; k++) {
      api_json_key(out, k == 0 ? "base" : "other");
      api_json_open(out, '{');
      api_json_member_integer(out, "hole", one->hole[k] + 1);
      api_json_member_integer(out, "edges", one->edges[k]);
      api_json_member_number(out, "length_relative", one->length_relative[k]);
      api_json_close(out, '}');
    }
    api_json_member_number(out, "off_relative", one->off_relative);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

static void write_timings(const orb_merge_timings *t, double embed_ms, api_text *out) {
  api_json_key(out, "timings_ms");
  api_json_open(out, '{');
  api_json_member_number(out, "embed", embed_ms);
  api_json_member_number(out, "align", 1e3 * t->align);
  api_json_member_number(out, "remesh", 1e3 * t->remesh);
  api_json_member_number(out, "transfer", 1e3 * t->transfer);
  api_json_member_number(out, "write", 1e3 * t->write);
  api_json_member_number(out, "total", 1e3 * t->total + embed_ms);
  api_json_close(out, '}');
}

static void write_bounds(double relative, double degrees, api_text *out) {
  api_json_member_number(out, "quantization_relative", relative);
  api_json_member_number(out, "normal_degrees", degrees);
}

/* The bounds that hold for every profile, then those of each. */
static void write_profiles(const orb_profile_facts *profiles, api_text *out) {
  api_json_key(out, "profiles");
  api_json_open(out, '{');
  double relative = 0, degrees = 0;
  for (int p = ORB_PROFILE_FLOAT; p < ORB_PROFILES; p++) {
    relative = fmax(relative, profiles[p].position_relative);
    degrees = fmax(degrees, profiles[p].normal_degrees);
  }
  write_bounds(relative, degrees, out);
  for (int p = ORB_PROFILE_QUANTIZED; p < ORB_PROFILES; p++) {
    api_json_key(out, orb_profile_name((orb_profile)p));
    api_json_open(out, '{');
    write_bounds(profiles[p].position_relative, profiles[p].normal_degrees, out);
    api_json_close(out, '}');
  }
  api_json_close(out, '}');
}

void api_supermesh_write(const char *id, const api_supermesh_request *request, const orb_merge_result *result,
                         const api_place *found, api_place *others, const api_place *meant, double embed_ms,
                         int64_t created, api_text *out) {
  api_text canonical = {0};
  api_supermesh_request_write(request, &canonical);
  out->failed |= canonical.failed;
  api_json_open(out, '{');
  api_json_member_string(out, "id", id);
  api_json_key(out, "url");
  api_text_printf(out, "\"/v1/supermeshes/%s\"", id);
  api_json_key(out, "asset");
  api_text_printf(out, "\"/v1/supermeshes/%s/asset.glb\"", id);
  api_json_member_integer(out, "asset_bytes", (int64_t)result->asset.size);
  if (result->has_profiles) {
    write_profiles(result->profiles, out);
  }
  api_json_member_integer(out, "vertices", result->supermesh.vertex_count);
  api_json_member_integer(out, "triangles", result->supermesh.triangle_count);
  write_shapes(id, request, result, out);
  write_landmarks(request, result, found, out);
  write_suspects(request, &result->alignment, meant, out);
  char alignment[API_ID_SIZE];
  if (api_alignment_id(request, alignment)) {
    api_json_member_string(out, "alignment", alignment);
  }
  if (request->start[0]) {
    api_json_member_bool(out, "start_followed", result->alignment.has_followed);
  }
  write_match(&result->alignment.match, out);
  write_alternatives(request, &result->alignment, others, out);
  api_json_key(out, "certificate");
  api_merge_certificate_write(result, out);
  api_json_key(out, "pairs");
  api_pairs_write(result, out);
  write_warnings(result, out);
  api_json_member_number(out, "energy", result->alignment.energy);
  write_dropped(result, out);
  if (result->open_holes > 0) {
    api_json_member_integer(out, "open_holes", result->open_holes);
  }
  if (result->asset_facts.triangle_count != result->supermesh.triangle_count) {
    api_json_member_integer(out, "asset_triangles", result->asset_facts.triangle_count);
  }
  write_rims(&result->alignment, out);
  if (request->carry_count > 0) {
    api_json_key(out, "transferred");
    api_transferred_write(result->carried, result->carried_count, out);
  }
  write_timings(&result->timings, embed_ms, out);
  api_json_member_raw(out, "request", canonical.data);
  api_json_member_string(out, "engine", ORB_ENGINE);
  api_json_member_instant(out, "created", created);
  api_json_close(out, '}');
  api_text_free(&canonical);
}

/* Appends the members of this list that the object has: texts or whole numbers. */
static void copy_members(const cJSON *from, const char *const *names, api_text *out) {
  for (; *names; names++) {
    const cJSON *member = cJSON_GetObjectItemCaseSensitive(from, *names);
    if (cJSON_IsString(member)) {
      api_json_member_string(out, *names, member->valuestring);
    } else if (cJSON_IsNumber(member)) {
      api_json_member_integer(out, *names, (int64_t)member->valuedouble);
    }
  }
}

int api_supermesh_summary(const char *description, api_text *out) {
  static const char *const first[] = {"id", "url", "asset", "asset_bytes", "vertices", "triangles", NULL};
  static const char *const of_shape[] = {"mesh", "name", NULL}, *const last[] = {"engine", "created", NULL};
  cJSON *whole = cJSON_Parse(description);
  const cJSON *shape;
  if (!cJSON_IsObject(whole)) {
    cJSON_Delete(whole);
    return 0;
  }
  api_json_open(out, '{');
  copy_members(whole, first, out);
  api_json_key(out, "shapes");
  api_json_open(out, '[');
  cJSON_ArrayForEach(shape, cJSON_GetObjectItemCaseSensitive(whole, "shapes")) {
    api_json_open(out, '{');
    copy_members(shape, of_shape, out);
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
  copy_members(whole, last, out);
  api_json_close(out, '}');
  cJSON_Delete(whole);
  return 1;
}
