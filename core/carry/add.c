/* The second half of carry.h: what was read becomes part of the asset. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "carry/bake.h"
#include "carry/carry.h"
#include "carry/check.h"
#include "carry/corners.h"
#include "format/gltf_add.h"
#include "mesh/dropped.h"
#include "numeric/vec3.h"
#include "orbmorph/utf8.h"

/* What the additions are made of; memory of the context. */
typedef struct adder {
  int64_t *corner;
  orb_added_set *sets;
  float **values;
  uint16_t *joints; /* 4 per vertex, as the weights */
  float *weights;
  double *before, *after, *area; /* of the surface of a skin */
  orb_baked *baked;              /* as many as textures, as the variants and images */
  orb_added_variant *variants;
  orb_added_image **images;
  int32_t *texture_carry;
} adder;

static void adder_free(orb_context *ctx, const orb_carrier *carrier, adder *a) {
  for (int32_t i = 0; i < carrier->texture_count; i++) {
    if (a->baked) {
      orb_baked_free(ctx, &a->baked[i]);
    }
    if (a->images) {
      orb_free(ctx, a->images[i]);
    }
  }
  orb_free(ctx, a->baked);
  orb_free(ctx, a->images);
  orb_free(ctx, a->variants);
  orb_free(ctx, a->texture_carry);
  for (int32_t i = 0; a->values && i < carrier->set_count; i++) {
    orb_free(ctx, a->values[i]);
  }
  orb_free(ctx, a->values);
  orb_free(ctx, a->sets);
  orb_free(ctx, a->corner);
  orb_free(ctx, a->joints);
  orb_free(ctx, a->weights);
  orb_free(ctx, a->before);
  orb_free(ctx, a->after);
  orb_free(ctx, a->area);
}

/* The value of each vertex of the asset; those off the surface get white, or zeros. */
static orb_status fill_sets(orb_context *ctx, const orb_carrier *carrier, int32_t vertex_count, adder *a) {
  const int32_t *triangles = carrier->job.supermesh->triangles;
  for (int32_t i = 0; i < carrier->set_count; i++) {
    const orb_wedges *wedges = &carrier->sets[i].wedges;
    size_t width = (size_t)wedges->width;
    float *values = a->values[i] = ORB_NEW(ctx, float, width *(size_t)vertex_count);
    if (!values) {
      return ORB_E_NO_MEMORY;
    }
    for (int32_t g = 0; g < vertex_count; g++) {
      for (size_t c = 0; c < width; c++) {
        values[width * (size_t)g + c] =
            a->corner[g] >= 0 ? wedges->values[width * (size_t)orb_wedge_of(wedges, triangles, a->corner[g]) + c]
            : width == 4      ? 1.0f
                              : 0.0f;
      }
    }
    a->sets[i] = (orb_added_set){.width = wedges->width, .values = values};
  }
  return ORB_OK;
}

/* The surface of the asset on a shape, in the coordinates of the asset. */
static orb_status surface_on(orb_context *ctx, const orb_carrier *carrier, int32_t shape, double **out) {
  const orb_supermesh *mesh = carrier->job.supermesh;
  const double *m = carrier->moved + 16 * (int64_t)shape;
  double *points = *out = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  if (!points) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(orb_transfer_positions(ctx, &carrier->job.shapes[shape], mesh->places + (int64_t)shape * mesh->vertex_count,
                                 mesh->vertex_count, points));
  for (int64_t v = 0; v < mesh->vertex_count; v++) {
    double *p = points + 3 * v, moved[3];
    for (int k = 0; k < 3; k++) {
      moved[k] = m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2] + m[12 + k];
    }
    memcpy(p, moved, sizeof moved);
  }
  return ORB_OK;
}

/* What the joints of a skin are fitted by. */
static orb_status fill_surface(orb_context *ctx, const orb_carrier *carrier, int32_t from, adder *a,
                               orb_skin_surface *out) {
  const orb_supermesh *mesh = carrier->job.supermesh;
  a->area = ORB_NEW0(ctx, double, mesh->vertex_count);
  if (!a->area) {
    return ORB_E_NO_MEMORY;
  }
  ORB_TRY(surface_on(ctx, carrier, from, &a->before));
  ORB_TRY(surface_on(ctx, carrier, 0, &a->after));
  for (int64_t t = 0; t < mesh->triangle_count; t++) {
    const int32_t *corner = mesh->triangles + 3 * t;
    double u[3], w[3], n[3];
    orb_sub(a->after + 3 * (int64_t)corner[1], a->after + 3 * (int64_t)corner[0], u);
    orb_sub(a->after + 3 * (int64_t)corner[2], a->after + 3 * (int64_t)corner[0], w);
    orb_cross(u, w, n);
    for (int k = 0; k < 3; k++) {
      a->area[corner[k]] += orb_length(n) / 6;
    }
  }
  *out = (orb_skin_surface){.count = mesh->vertex_count,
                            .before = a->before,
                            .after = a->after,
                            .area = a->area,
                            .joints = (const uint16_t(*)[4])carrier->skin.joints,
                            .weights = (const float(*)[4])carrier->skin.weights};
  return ORB_OK;
}

/* The joints of each vertex of the asset; those off the surface follow the first joint. */
static orb_status fill_skin(orb_context *ctx, const orb_carrier *carrier, const int32_t *vertices, int32_t vertex_count,
                            adder *a, orb_added_skin *out) {
  const orb_carried_skin *skin = &carrier->skin;
  const orb_carry *carry = &carrier->job.carries[carrier->skin_carry];
  const orb_shape_file *file = &carrier->job.files[carry->from];
  a->joints = ORB_NEW0(ctx, uint16_t, 4 * (int64_t)vertex_count);
  a->weights = ORB_NEW0(ctx, float, 4 * (int64_t)vertex_count);
  if (!a->joints || !a->weights) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t g = 0; g < vertex_count; g++) {
    a->weights[4 * g] = 1;
    if (vertices[g] >= 0) {
      memcpy(a->joints + 4 * g, skin->joints[vertices[g]], sizeof skin->joints[0]);
      memcpy(a->weights + 4 * g, skin->weights[vertices[g]], sizeof skin->weights[0]);
    }
  }
  *out = (orb_added_skin){.bytes = file->bytes,
                          .size = file->size,
                          .skin = skin->given.skin,
                          .joint_count = skin->given.joint_count,
                          .joints = a->joints,
                          .weights = a->weights};
  memcpy(out->place, skin->given.place, sizeof out->place);
  memcpy(out->moved, carrier->moved + 16 * (int64_t)carry->from, sizeof out->moved);
  return carry->from > 0 ? fill_surface(ctx, carrier, carry->from, a, &out->surface) : ORB_OK; /* its own fits */
}

static orb_carried *list_one(const orb_carrier *carrier, int32_t number, orb_carried *list, int32_t *count) {
  const orb_carry *carry = &carrier->job.carries[number];
  orb_carried *one = &list[(*count)++];
  *one = (orb_carried){.from = carry->from, .what = carry->what};
  return one;
}

static orb_status list_carried(orb_context *ctx, const orb_carrier *carrier, const orb_additions *more, const adder *a,
                               orb_carried **list, int32_t *count) {
  *list = ORB_NEW0(ctx, orb_carried, (int64_t)carrier->set_count + carrier->target_count + carrier->texture_count + 1);
  if (!*list) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < carrier->set_count; i++) {
    orb_carried *one = list_one(carrier, carrier->sets[i].carry, *list, count);
    (void)snprintf(one->as, sizeof one->as, "%s_%d", one->what == ORB_CARRY_COLOR ? "COLOR" : "TEXCOORD",
                   (int)more->sets[i].number);
  }
  for (int32_t i = 0; i < carrier->texture_count; i++) {
    orb_carried *one = list_one(carrier, a->texture_carry[i], *list, count);
    one->resolution = a->baked[i].resolution;
    one->shared_texels = a->baked[i].shared;
    (void)snprintf(one->as, sizeof one->as, "%s", more->variants[i].name);
  }
  if (carrier->skin_carry >= 0) {
    (void)snprintf(list_one(carrier, carrier->skin_carry, *list, count)->as, sizeof(*list)->as, "JOINTS_0");
  }
  return ORB_OK;
}

/* Targets have the names that the asset gives them: equal ones got a number. */
static orb_status list_targets(orb_context *ctx, const orb_carrier *carrier, const int32_t *vertices,
                               int32_t vertex_count, const orb_buffer *asset, orb_carried *list, int32_t *count) {
  int32_t targets = carrier->target_count;
  orb_given_name *found = ORB_NEW0(ctx, orb_given_name, (int64_t)targets + 1);
  orb_status status =
      found ? orb_given_last_targets(ctx, asset->data, asset->size, vertices, vertex_count, targets, found)
            : ORB_E_NO_MEMORY;
  for (int32_t k = 0; status == ORB_OK && k < targets; k++) {
    orb_carried *one = list_one(carrier, carrier->target_carry[k], list, count);
    (void)orb_utf8_copy(one->as, sizeof one->as, *found[k] ? found[k] : carrier->targets[k].name);
  }
  orb_free(ctx, found);
  return status;
}

/* The surface of the variant is that of the shape's first material. */
static void describe_variant(const orb_mesh *mesh, const orb_baked *baked, const orb_added_image *images,
                             const char *name, orb_added_variant *out) {
  const orb_material *material = mesh->material_count > 0 ? &mesh->materials[0] : NULL;
  *out = (orb_added_variant){.image_count = baked->image_count,
                             .images = images,
                             .metallic = material ? fmin(1, fmax(0, (double)material->metallic)) : 0,
                             .roughness = material ? fmin(1, fmax(0, (double)material->roughness)) : 1,
                             .is_blended = baked->has_alpha};
  for (int32_t v = 0; material && v < material->value_count; v++) {
    const orb_material_value *value = &mesh->material_values[material->first_value + v];
    out->is_double_sided |= value->member == ORB_MATERIAL_DOUBLE_SIDED && value->number[0] > 0;
  }
  (void)orb_utf8_copy(out->name, ORB_NAME_MAX, name); /* the rest is for a number that makes it unique */
}

static orb_status bake_one(orb_context *ctx, const orb_carrier *carrier, int32_t number, const orb_given_charts *charts,
                           const int32_t *vertices, adder *a, orb_additions *more) {
  const orb_carry *carry = &carrier->job.carries[number];
  int32_t i = more->variant_count;
  orb_baked *baked = &a->baked[i];
  orb_bake_job job = {.supermesh = carrier->job.supermesh,
                      .shape = &carrier->job.shapes[carry->from],
                      .number = carry->from,
                      .charts = charts,
                      .vertices = vertices,
                      .vertex_count = more->vertex_count,
                      .resolution = carry->resolution};
  orb_status status = orb_bake(ctx, &job, baked);
  if (status != ORB_OK) {
    return orb_carry_blame(ctx, status, carry->from, number);
  }
  orb_added_image *images = a->images[i] = ORB_NEW(ctx, orb_added_image, baked->image_count);
  if (!images) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t k = 0; k < baked->image_count; k++) {
    images[k] = (orb_added_image){baked->images[k].material, baked->images[k].png.data, baked->images[k].png.size};
  }
  describe_variant(&job.shape->mesh, baked, images, carrier->job.names[carry->from], &a->variants[i]);
  a->texture_carry[i] = number;
  more->variant_count++;
  return ORB_OK;
}

static orb_status bake_textures(orb_context *ctx, const orb_carrier *carrier, const orb_given_charts *charts,
                                const int32_t *vertices, adder *a, orb_additions *more) {
  a->baked = ORB_NEW0(ctx, orb_baked, carrier->texture_count);
  a->variants = ORB_NEW0(ctx, orb_added_variant, carrier->texture_count);
  a->images = ORB_NEW0(ctx, orb_added_image *, carrier->texture_count);
  a->texture_carry = ORB_NEW0(ctx, int32_t, carrier->texture_count);
  if (!a->baked || !a->variants || !a->images || !a->texture_carry) {
    return ORB_E_NO_MEMORY;
  }
  more->variants = a->variants;
  more->own_name = carrier->job.names[0];
  for (int32_t i = 0; i < carrier->job.carry_count; i++) {
    if (carrier->job.carries[i].what == ORB_CARRY_TEXTURE) {
      ORB_TRY(bake_one(ctx, carrier, i, charts, vertices, a, more));
    }
  }
  return ORB_OK;
}

/* Adds the sets, the skin and the textures to the GLB. */
static orb_status add_to(orb_context *ctx, const orb_carrier *carrier, const int32_t *vertices, orb_additions *more,
                         adder *a, orb_buffer *asset) {
  orb_given_charts charts;
  orb_buffer made = {0};
  orb_status status;
  ORB_GO(status, orb_given_charts_read(ctx, asset->data, asset->size, &charts), done);
  ORB_GO(status,
         orb_corners_create(ctx, carrier->job.supermesh, vertices, more->vertex_count, charts.triangles,
                            charts.triangle_count, &a->corner),
         done);
  ORB_GO(status, fill_sets(ctx, carrier, more->vertex_count, a), done);
  if (carrier->skin_carry >= 0) {
    ORB_GO(status, fill_skin(ctx, carrier, vertices, more->vertex_count, a, &more->skin), done);
  }
  if (carrier->texture_count > 0) {
    ORB_GO(status, bake_textures(ctx, carrier, &charts, vertices, a, more), done);
  }
  status = orb_gltf_add(ctx, asset->data, asset->size, more, &made);
  if (status != ORB_OK) { /* orb_carry_check() has tried all that this can refuse, except a second skin */
    status = orb_carry_blame(ctx, status, 0, carrier->skin_carry);
    goto done;
  }
  orb_buffer_free(ctx, asset);
  *asset = made;
  made = (orb_buffer){0};
done:
  orb_given_charts_free(ctx, &charts);
  orb_buffer_free(ctx, &made);
  return status;
}

int orb_carrier_edits(const orb_carrier *carrier) {
  return carrier->set_count > 0 || carrier->skin_carry >= 0 || carrier->texture_count > 0;
}

/* Whether an entry of the list says that the asset lacks what was carried. */
static int is_about(const orb_dropped *dropped, const orb_carried *carried) {
  char shape[32];
  (void)snprintf(shape, sizeof shape, "shapes[%d]", (int)carried->from);
  switch (carried->what) {
    case ORB_CARRY_SKIN:
      return carried->from == 0 && strcmp(dropped->what, "skins") == 0;
    case ORB_CARRY_COLOR:
      return carried->from == 0 && strncmp(dropped->what, "COLOR_", 6) == 0;
    case ORB_CARRY_TEXCOORD:
      return carried->from == 0 && strncmp(dropped->what, "TEXCOORD_", 9) == 0;
    case ORB_CARRY_TARGETS:
      return carried->from == 0 && strcmp(dropped->what, "targets") == 0;
    default:
      return strcmp(dropped->what, "textures") == 0 && strcmp(dropped->where, shape) == 0;
  }
}

orb_status orb_carried_settle(orb_context *ctx, const orb_carried *carried, int32_t count, orb_dropped **dropped,
                              int32_t *dropped_count) {
  int32_t left = 0;
  for (int32_t i = 0; i < *dropped_count; i++) {
    int is_settled = 0;
    for (int32_t k = 0; k < count && !is_settled; k++) {
      is_settled = is_about(&(*dropped)[i], &carried[k]);
      if (carried[k].what == ORB_CARRY_SKIN && carried[k].from == 0 && strcmp((*dropped)[i].what, "animations") == 0) {
        (*dropped)[i].why = "Of the animations, the asset has those of its skeleton.";
      }
    }
    if (!is_settled) {
      (*dropped)[left++] = (*dropped)[i];
    }
  }
  *dropped_count = left;
  for (int32_t k = 0; k < count; k++) {
    if (carried[k].shared_texels > 0) {
      char where[32];
      (void)snprintf(where, sizeof where, "shapes[%d]", (int)carried[k].from);
      ORB_TRY(orb_dropped_add(ctx, dropped, dropped_count, "texture", where,
                              "Triangles of the first shape share texels, so some show the colours of others."));
    }
  }
  return ORB_OK;
}

orb_status orb_carrier_add(orb_context *ctx, const orb_carrier *carrier, const int32_t *vertices, int32_t vertex_count,
                           orb_buffer *asset, orb_carried **list, int32_t *count) {
  *list = NULL;
  *count = 0;
  if (carrier->job.carry_count == 0) {
    return ORB_OK;
  }
  adder a = {.sets = ORB_NEW0(ctx, orb_added_set, carrier->set_count),
             .values = ORB_NEW0(ctx, float *, carrier->set_count)};
  orb_status status = a.sets && a.values ? ORB_OK : ORB_E_NO_MEMORY;
  orb_additions more = {.vertex_count = vertex_count,
                        .on_surface = vertices,
                        .set_count = carrier->set_count,
                        .sets = a.sets,
                        .whiten = !carrier->job.is_document && carrier->job.shapes[0].mesh.material_count == 0};
  if (status == ORB_OK && orb_carrier_edits(carrier)) {
    status = add_to(ctx, carrier, vertices, &more, &a, asset);
  }
  if (status == ORB_OK) {
    status = list_carried(ctx, carrier, &more, &a, list, count);
  }
  if (status == ORB_OK && carrier->target_count > 0) {
    status = list_targets(ctx, carrier, vertices, vertex_count, asset, *list, count);
  }
  adder_free(ctx, carrier, &a);
  return status;
}
