#include "api/supermesh_codec.h"

#include <math.h>
#include <stdio.h>

#include "api/report_codec.h"

static int landmarks_exact(const orb_merge_result *result) {
  int32_t shapes = result->supermesh.shape_count;
  for (int32_t l = 0; l < result->alignment.landmark_count; l++) {
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

void orb_merge_certificate_write(const orb_merge_result *result, orb_text *out) {
  const orb_supermesh *mesh = &result->supermesh;
  orb_json_open(out, '{');
  /* The engine only returns supermeshes that are closed and of genus zero; Euler's count says it once more. */
  orb_json_member_bool(out, "closed", (int64_t)mesh->triangle_count == 2 * (int64_t)mesh->vertex_count - 4);
  orb_json_member_number(out, "genus", (2 - ((double)mesh->vertex_count - 0.5 * (double)mesh->triangle_count)) / 2);
  orb_json_key(out, "flipped");
  orb_json_open(out, '[');
  for (int32_t s = 0; s < mesh->shape_count; s++) {
    orb_json_integer(out, result->alignment.shapes[s].certificate.flipped);
  }
  orb_json_close(out, ']');
  orb_json_key(out, "degree");
  orb_json_open(out, '[');
  for (int32_t s = 0; s < mesh->shape_count; s++) {
    orb_json_integer(out, result->alignment.shapes[s].certificate.degree);
  }
  orb_json_close(out, ']');
  orb_json_member_bool(out, "landmarks_exact", landmarks_exact(result));
  orb_json_key(out, "supermesh");
  orb_json_open(out, '{');
  orb_json_member_integer(out, "flipped", mesh->flipped);
  orb_json_member_integer(out, "degree", mesh->degree);
  orb_json_close(out, '}');
  orb_json_close(out, '}');
}

void orb_pairs_write(const orb_merge_result *result, orb_text *out) {
  orb_json_open(out, '[');
  for (int32_t i = 0; i < result->pair_count; i++) {
    orb_json_open(out, '{');
    orb_json_member_integer(out, "a", result->pairs[i].a);
    orb_json_member_integer(out, "b", result->pairs[i].b);
    orb_json_key(out, "distortion");
    orb_distortion_write(out, &result->pairs[i].distortion);
    orb_json_member_number(out, "inverted_fraction", result->pairs[i].inverted_fraction);
    orb_json_close(out, '}');
  }
  orb_json_close(out, ']');
}

static void write_numbers(const char *name, const double *numbers, int32_t count, orb_text *out) {
  orb_json_key(out, name);
  orb_json_open(out, '[');
  for (int32_t i = 0; i < count; i++) {
    orb_json_number(out, numbers[i]);
  }
  orb_json_close(out, ']');
}

static void write_shapes(const char *id, const orb_supermesh_request *request, const orb_merge_result *result,
                         orb_text *out) {
  orb_json_key(out, "shapes");
  orb_json_open(out, '[');
  for (int32_t s = 0; s < request->shape_count; s++) {
    orb_json_open(out, '{');
    orb_json_member_string(out, "mesh", request->shapes[s].mesh);
    orb_json_member_string(out, "name", request->shapes[s].name);
    orb_json_key(out, "sphere");
    orb_text_printf(out, "\"/v1/supermeshes/%s/spheres/%d.ply\"", id, s);
    orb_shape_report_members(out, &result->shapes[s]);
    write_numbers("transform", result->transforms + 16 * (size_t)s, 16, out);
    orb_json_close(out, '}');
  }
  orb_json_close(out, ']');
}

static void write_found(const orb_merge_result *result, const orb_spot *found, orb_text *out) {
  size_t shapes = (size_t)result->supermesh.shape_count;
  for (int32_t l = 0; l < result->alignment.found_count; l++) {
    char name[32];
    snprintf(name, sizeof name, "auto %d", l + 1);
    orb_json_open(out, '{');
    orb_json_member_string(out, "name", name);
    orb_json_key(out, "at");
    orb_json_open(out, '[');
    for (size_t s = 0; s < shapes; s++) {
      orb_spot_write(out, &found[(size_t)l * shapes + s]);
    }
    orb_json_close(out, ']');
    write_numbers("residual_relative", result->found_residuals + (size_t)l * shapes, (int32_t)shapes, out);
    orb_json_member_number(out, "confidence", result->alignment.confidence[l]);
    orb_json_close(out, '}');
  }
}

/* The landmarks of the request, or else those that were found. */
static void write_landmarks(const orb_supermesh_request *request, const orb_merge_result *result, const orb_spot *found,
                            orb_text *out) {
  int32_t shapes = request->shape_count;
  orb_json_key(out, "landmarks");
  orb_json_open(out, '[');
  for (int32_t l = 0; l < result->alignment.landmark_count; l++) {
    orb_json_open(out, '{');
    orb_json_member_string(out, "name", request->landmarks.items[l].name);
    orb_json_member_integer(out, "vertex", result->supermesh.landmark_vertices[l]);
    write_numbers("residual_relative", result->landmark_residuals + (size_t)l * (size_t)shapes, shapes, out);
    orb_json_close(out, '}');
  }
  write_found(result, found, out);
  orb_json_close(out, ']');
}

static void write_timings(const orb_merge_timings *t, double embed_ms, orb_text *out) {
  orb_json_key(out, "timings_ms");
  orb_json_open(out, '{');
  orb_json_member_number(out, "embed", embed_ms);
  orb_json_member_number(out, "align", 1e3 * t->align);
  orb_json_member_number(out, "remesh", 1e3 * t->remesh);
  orb_json_member_number(out, "transfer", 1e3 * t->transfer);
  orb_json_member_number(out, "write", 1e3 * t->write);
  orb_json_member_number(out, "total", 1e3 * t->total + embed_ms);
  orb_json_close(out, '}');
}

void orb_supermesh_write(const char *id, const orb_supermesh_request *request, const orb_merge_result *result,
                         const orb_spot *found, double embed_ms, int64_t created, orb_text *out) {
  orb_text canonical = {0};
  orb_supermesh_request_write(request, &canonical);
  out->failed |= canonical.failed;
  orb_json_open(out, '{');
  orb_json_member_string(out, "id", id);
  orb_json_key(out, "url");
  orb_text_printf(out, "\"/v1/supermeshes/%s\"", id);
  orb_json_key(out, "asset");
  orb_text_printf(out, "\"/v1/supermeshes/%s/asset.glb\"", id);
  orb_json_member_integer(out, "asset_bytes", (int64_t)result->asset.size);
  orb_json_member_integer(out, "vertices", result->supermesh.vertex_count);
  orb_json_member_integer(out, "triangles", result->supermesh.triangle_count);
  write_shapes(id, request, result, out);
  write_landmarks(request, result, found, out);
  orb_json_key(out, "certificate");
  orb_merge_certificate_write(result, out);
  orb_json_key(out, "pairs");
  orb_pairs_write(result, out);
  orb_json_member_number(out, "energy", result->alignment.energy);
  write_timings(&result->timings, embed_ms, out);
  orb_json_member_raw(out, "request", canonical.data);
  orb_json_member_string(out, "engine", ORB_ENGINE);
  orb_json_member_instant(out, "created", created);
  orb_json_close(out, '}');
  orb_text_free(&canonical);
}
