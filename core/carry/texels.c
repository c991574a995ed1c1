#include "carry/texels.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "orbmorph/utf8.h"

enum { NEAREST = 9728, CLAMP = 33071, MIRROR = 33648 }; /* of glTF's samplers */

static const orb_material *material_of(const orb_mesh *mesh, int32_t triangle) {
  int32_t m = mesh->material ? mesh->material[triangle] : 0;
  return mesh->material_count == 0 ? NULL : &mesh->materials[m >= 0 && m < mesh->material_count ? m : 0];
}

static int has_image(const orb_mesh *mesh, const orb_material *material) {
  return material && mesh->texcoords && material->base_texture.image >= 0 &&
         material->base_texture.image < mesh->image_count;
}

int orb_texels_has(const orb_mesh *mesh) {
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    if (has_image(mesh, material_of(mesh, t))) {
      return 1;
    }
  }
  return 0;
}

static float linear_of(int byte) {
  float v = (float)byte / 255;
  return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

static unsigned char encoded(float linear) {
  float x = linear > 0 ? linear < 1 ? linear : 1 : 0;
  float v = x <= 0.0031308f ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
  return (unsigned char)(v * 255 + 0.5f);
}

/* Whether a material shows alpha: its mode is not opaque. */
static int shows_alpha(const orb_mesh *mesh, const orb_material *material) {
  for (int32_t v = material->first_value; v < material->first_value + material->value_count; v++) {
    if (mesh->material_values[v].member == ORB_MATERIAL_ALPHA_MODE && mesh->material_values[v].number[0] > 0) {
      return 1;
    }
  }
  return 0;
}

static orb_status refuse_image(orb_context *ctx, const orb_mesh *mesh, const orb_material *material) {
  const int number = (int)(material - mesh->materials);
  orb_status status = orb_fail(ctx, ORB_E_BAD_OPTION,
                               "The base colour of material %d cannot be decoded as PNG or JPEG of at most "
                               "%d pixels a side. Convert the image, or omit \"texture\" from \"transfer\".",
                               number, (int)ORB_IMAGE_SIDE_MAX);
  orb_error *error = orb_context_error_edit(ctx);
  orb_error_element *element = &error->elements[0];
  error->element_count = 1;
  error->element_total = 1;
  snprintf(element->where, sizeof element->where, "materials[%d]", number);
  (void)orb_utf8_copy(element->name, sizeof element->name, material->name);
  return status;
}

orb_status orb_texels_open(orb_context *ctx, const orb_mesh *mesh, orb_texels *out) {
  *out = (orb_texels){.mesh = mesh, .images = ORB_NEW0(ctx, orb_pixels, mesh->image_count)};
  if (!out->images) {
    return ORB_E_NO_MEMORY;
  }
  for (int i = 0; i < 256; i++) {
    out->linear[i] = linear_of(i);
  }
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const orb_material *material = material_of(mesh, t);
    int32_t i = has_image(mesh, material) ? material->base_texture.image : -1;
    out->has_alpha |= material && shows_alpha(mesh, material);
    if (i < 0 || out->images[i].rgba) {
      continue;
    }
    orb_status status = orb_image_decode(ctx, mesh->images[i].bytes, mesh->images[i].size, &out->images[i]);
    if (status == ORB_E_CORRUPT || status == ORB_E_TOO_LARGE) {
      return refuse_image(ctx, mesh, material);
    }
    ORB_TRY(status);
  }
  return ORB_OK;
}

void orb_texels_close(orb_context *ctx, orb_texels *texels) {
  for (int32_t i = 0; texels->images && i < texels->mesh->image_count; i++) {
    orb_free(ctx, texels->images[i].rgba);
  }
  orb_free(ctx, texels->images);
  memset(texels, 0, sizeof *texels);
}

/* Texture coordinates as the texture uses them. */
static void transformed(const orb_texture *texture, const double uv[2], double out[2]) {
  if (!texture->is_transformed) {
    memcpy(out, uv, 2 * sizeof *out);
    return;
  }
  double c = cos(texture->rotation), s = sin(texture->rotation);
  double u = texture->scale[0] * uv[0], v = texture->scale[1] * uv[1];
  out[0] = c * u + s * v + texture->offset[0];
  out[1] = -s * u + c * v + texture->offset[1];
}

double orb_texels_count(const orb_texels *texels) {
  const orb_mesh *mesh = texels->mesh;
  double sum = 0;
  for (int64_t t = 0; t < mesh->triangle_count; t++) {
    const orb_material *material = material_of(mesh, (int32_t)t);
    if (!has_image(mesh, material)) {
      continue;
    }
    const orb_pixels *image = &texels->images[material->base_texture.image];
    double uv[3][2];
    for (int k = 0; k < 3; k++) {
      const float *at = mesh->texcoords + 2 * (3 * t + k);
      const double plain[2] = {(double)at[0], (double)at[1]};
      transformed(&material->base_texture, plain, uv[k]);
    }
    double area =
        0.5 * fabs((uv[1][0] - uv[0][0]) * (uv[2][1] - uv[0][1]) - (uv[1][1] - uv[0][1]) * (uv[2][0] - uv[0][0]));
    double texels_here = area * image->width * image->height;
    sum += texels_here < 1e12 ? texels_here : 0; /* not of broken coordinates */
  }
  return sum;
}

static int32_t wrapped(int64_t at, int32_t size, int32_t wrap) {
  if (wrap == CLAMP) {
    return (int32_t)(at < 0 ? 0 : at >= size ? size - 1 : at);
  }
  int64_t period = wrap == MIRROR ? 2 * (int64_t)size : size, rest = at % period;
  rest += rest < 0 ? period : 0;
  return (int32_t)(rest < size ? rest : period - 1 - rest);
}

/* Blends four texels in linear light, or takes the nearest. */
static void sample(const orb_texels *texels, const orb_texture *texture, const double uv[2], float out[4]) {
  const orb_pixels *image = &texels->images[texture->image];
  int near = texture->mag_filter == NEAREST;
  double x = uv[0] * image->width - (near ? 0 : 0.5), y = uv[1] * image->height - (near ? 0 : 0.5);
  memset(out, 0, 4 * sizeof *out);
  if (!(fabs(x) < 1e9 && fabs(y) < 1e9)) {
    return;
  }
  int64_t x0 = (int64_t)floor(x), y0 = (int64_t)floor(y);
  float fx = near ? 0 : (float)(x - (double)x0), fy = near ? 0 : (float)(y - (double)y0);
  for (int k = 0; k < 4; k++) {
    float weight = (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
    int32_t column = wrapped(x0 + k % 2, image->width, texture->wrap_s),
            row = wrapped(y0 + k / 2, image->height, texture->wrap_t);
    const unsigned char *p = image->rgba + 4 * ((size_t)row * (size_t)image->width + (size_t)column);
    for (int c = 0; c < 4 && weight > 0; c++) {
      out[c] += weight * (c < 3 ? texels->linear[p[c]] : (float)p[c] / 255);
    }
  }
}

void orb_texels_at(const orb_texels *texels, const orb_place *place, unsigned char out[4]) {
  const orb_mesh *mesh = texels->mesh;
  const orb_material *material = material_of(mesh, place->triangle);
  float color[4] = {1, 1, 1, 1};
  if (has_image(mesh, material)) {
    double uv[2] = {0, 0}, used[2];
    for (int k = 0; k < 3; k++) {
      const float *at = mesh->texcoords + 2 * (3 * (int64_t)place->triangle + k);
      uv[0] += place->at[k] * (double)at[0];
      uv[1] += place->at[k] * (double)at[1];
    }
    transformed(&material->base_texture, uv, used);
    sample(texels, &material->base_texture, used, color);
  }
  for (int c = 0; c < 4; c++) {
    color[c] *= material ? material->base_color[c] : 1;
    double painted = 0;
    for (int k = 0; mesh->colors && k < 3; k++) {
      painted += place->at[k] * (double)mesh->colors[4 * (3 * (int64_t)place->triangle + k) + c];
    }
    color[c] *= mesh->colors ? (float)painted : 1;
  }
  for (int c = 0; c < 3; c++) {
    out[c] = encoded(color[c]);
  }
  out[3] = (unsigned char)(fminf(fmaxf(color[3], 0), 1) * 255 + 0.5f);
}
