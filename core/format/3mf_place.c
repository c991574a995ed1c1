/* Places the objects of a 3MF package: the items of its build, the components of their objects, the components of
 * those, and so on. */
#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "format/3mf_model.h"
#include "format/build_finish.h"

enum { NESTING_MAX = 32 };

static const orb_3mf_map IDENTITY = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};

/* An object on the way from an item to the meshes below it. */
typedef struct frame {
  const orb_3mf_resource *object;
  int64_t next; /* of its components */
  orb_3mf_map map;
  const char *name; /* the nearest one, from here upwards */
} frame;

static void apply(const orb_3mf_map *map, const double in[3], double w, double out[3]) {
  for (int j = 0; j < 3; j++) {
    out[j] = in[0] * map->row[0][j] + in[1] * map->row[1][j] + in[2] * map->row[2][j] + w * map->row[3][j];
  }
}

/* First one map, then the other. */
static orb_3mf_map compose(const orb_3mf_map *first, const orb_3mf_map *second) {
  orb_3mf_map both;
  for (int i = 0; i < 4; i++) {
    apply(second, first->row[i], i == 3, both.row[i]);
  }
  return both;
}

static int is_mirror(const orb_3mf_map *map) {
  const double(*m)[3] = map->row;
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]) <
         0;
}

/* "#RRGGBBAA" to linear RGBA; white if it is empty. */
static void color_of(const char *hex, float out[4]) {
  for (int k = 0; k < 4; k++) {
    unsigned byte = 255;
    if (hex[0]) {
      (void)sscanf(hex + 1 + 2 * k, "%2x", &byte);
    }
    float c = (float)byte / 255;
    out[k] = k == 3 ? c : orb_srgb_to_linear(c);
  }
}

/* Gives the next faces a material, which is made when it is first used. Materials of one name and different colours
 * are told apart by the colour. */
static orb_status use_material(orb_3mf_material *material, orb_build *build) {
  if (material->made < 0) {
    char name[ORB_NAME_MAX];
    float color[4];
    color_of(material->hex, color);
    (void)snprintf(name, sizeof name, "%s", material->name[0] ? material->name : material->hex);
    int64_t before = build->material_count;
    ORB_TRY(orb_build_use_material(build, (const unsigned char *)name, strlen(name)));
    if (build->material_count == before &&
        memcmp(build->materials[build->material].base_color, color, sizeof color) != 0) {
      (void)snprintf(name, sizeof name, "%.100s %s", material->name, material->hex);
      ORB_TRY(orb_build_use_material(build, (const unsigned char *)name, strlen(name)));
    }
    memcpy(build->materials[build->material].base_color, color, sizeof color);
    material->made = build->material;
  }
  build->material = material->made;
  return ORB_OK;
}

static orb_status place_mesh(orb_3mf_model *model, const frame *at, orb_build *build) {
  const orb_3mf_resource *object = at->object;
  const orb_3mf_map *map = &at->map;
  int is_placed = memcmp(map, &IDENTITY, sizeof IDENTITY) != 0, mirror = is_mirror(map);
  int64_t base = build->vertices;
  ORB_TRY(orb_3mf_count(model, object->vertices + object->triangles));
  ORB_TRY(orb_build_object(build, (const unsigned char *)at->name, strlen(at->name)));
  for (int64_t v = 0; v < object->vertices; v++) {
    const double *p = model->positions + 3 * (object->vertex + v);
    double moved[3];
    apply(map, p, 1, moved);
    ORB_TRY(orb_build_vertex(build, is_placed ? moved : p));
  }
  for (int64_t t = 0; t < object->triangles; t++) {
    const orb_3mf_triangle *triangle = &model->triangles[object->triangle + t];
    int32_t material = triangle->material >= 0 ? triangle->material : object->material;
    build->material = -1;
    if (material >= 0) {
      ORB_TRY(use_material(&model->materials[material], build));
    }
    for (int k = 0; k < 3; k++) {
      int32_t v = triangle->vertex[mirror && k ? 3 - k : k];
      ORB_TRY(orb_build_corner(build, (orb_corner){(int32_t)(base + v), -1, -1}, t));
    }
    ORB_TRY(orb_build_face_end(build, 3));
    if ((t & 0xffff) == 0xffff) {
      ORB_TRY(orb_context_check(build->ctx));
    }
  }
  return ORB_OK;
}

static orb_status missing(const orb_3mf_model *model, int64_t id) {
  return orb_build_malformed(model->ctx, 0, -1, "The 3MF file names an object of the id %lld, which it does not have.",
                             (long long)id);
}

static orb_status enter(orb_3mf_model *model, frame stack[NESTING_MAX], int *depth, const orb_3mf_use *use,
                        const orb_3mf_map *parent, const char *name, orb_build *build) {
  const orb_3mf_resource *object = orb_3mf_find(model, use->part, use->id);
  if (!object || object->kind != ORB_3MF_OBJECT) {
    return missing(model, use->id);
  }
  if (*depth == NESTING_MAX) {
    return orb_build_malformed(
        model->ctx, 0, -1, "The components of the 3MF file nest deeper than %d, or contain themselves.", NESTING_MAX);
  }
  ORB_TRY(orb_3mf_count(model, 1));
  ORB_TRY(orb_context_check(model->ctx));
  frame *at = &stack[(*depth)++];
  *at = (frame){.object = object, .map = compose(&use->map, parent), .name = object->name[0] ? object->name : name};
  return object->triangles ? place_mesh(model, at, build) : ORB_OK;
}

static orb_status place_item(orb_3mf_model *model, const orb_3mf_use *item, orb_build *build) {
  frame stack[NESTING_MAX];
  int depth = 0;
  ORB_TRY(enter(model, stack, &depth, item, &IDENTITY, "", build));
  while (depth > 0) {
    frame *at = &stack[depth - 1];
    if (at->next == at->object->count) {
      depth--;
      continue;
    }
    const orb_3mf_use *component = &model->components[at->object->first + at->next++];
    ORB_TRY(enter(model, stack, &depth, component, &at->map, at->name, build));
  }
  return ORB_OK;
}

orb_status orb_3mf_place(orb_3mf_model *model, orb_build *build) {
  for (int64_t i = 0; i < model->item_count; i++) {
    ORB_TRY(place_item(model, &model->items[i], build));
  }
  if (model->item_count > 0) {
    return ORB_OK;
  }
  for (int64_t i = 0; i < model->component_count; i++) {
    orb_3mf_resource *object = orb_3mf_find(model, model->components[i].part, model->components[i].id);
    if (object) {
      object->is_used = 1;
    }
  }
  for (int64_t i = 0; i < model->resource_count; i++) {
    const orb_3mf_resource *object = &model->resources[i];
    if (object->kind == ORB_3MF_OBJECT && !object->is_used) {
      ORB_TRY(place_item(model, &(orb_3mf_use){object->part, object->id, IDENTITY}, build));
    }
  }
  return ORB_OK;
}
