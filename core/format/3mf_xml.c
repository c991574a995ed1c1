#include "format/3mf_xml.h"

#include <stdio.h>
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/memory.h"
#include "format/number.h"
#include "format/xml.h"

#define CORE "http://schemas.microsoft.com/3dmanufacturing/core/2015/02|"
#define MATERIAL "http://schemas.microsoft.com/3dmanufacturing/material/2015/02|"
#define PRODUCTION "http://schemas.microsoft.com/3dmanufacturing/production/2015/06|"
#define RELATIONS "http://schemas.openxmlformats.org/package/2006/relationships|"

enum { SLOTS = 2 * ORB_3MF_PARTS_MAX };

static const orb_3mf_map IDENTITY = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};

/* Where an element is. */
typedef enum place {
  OUTSIDE,
  MODEL,
  RESOURCES,
  GROUP,
  GROUP_ENTRY,
  OBJECT,
  MESH,
  VERTICES,
  VERTEX,
  TRIANGLES,
  TRIANGLE,
  COMPONENTS,
  COMPONENT,
  BUILD,
  ITEM,
  IGNORED /* and all that is in it */
} place;

/* One XML file as it is read. */
typedef struct reading {
  orb_3mf_reader *r;
  orb_xml *xml;
  int32_t part;
  double unit; /* in millimetres */
  place places[ORB_XML_DEPTH];
  int64_t group_id, group; /* the group that the last triangle named, as a resource */
} reading;

/* ---- values of attributes */

static orb_status malformed(reading *x, const char *what, const char *value) {
  return orb_build_malformed(x->r->model.ctx, 1, orb_xml_line(x->xml), "The 3MF file has %s \"%.40s\".", what, value);
}

static const char *attribute(const char **attributes, const char *name) {
  for (; *attributes; attributes += 2) {
    if (strcmp(attributes[0], name) == 0) {
      return attributes[1];
    }
  }
  return NULL;
}

static int is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/* Reads numbers that blanks separate, and nothing else. */
static int to_numbers(const char *text, int count, double *out) {
  const unsigned char *p = (const unsigned char *)text, *end = p + strlen(text);
  for (int i = 0; i < count; i++) {
    while (is_blank((char)*p)) {
      p++;
    }
    p = orb_number_parse(p, end, &out[i]);
    if (!p || (*p && !is_blank((char)*p))) {
      return 0;
    }
  }
  while (is_blank((char)*p)) {
    p++;
  }
  return p == end;
}

/* Reads a whole number from 0 to 2^31 − 1. */
static int to_index(const char *text, int64_t *out) {
  int64_t value = 0;
  int digits = 0;
  while (is_blank(*text)) {
    text++;
  }
  for (; *text >= '0' && *text <= '9' && digits < 11; text++, digits++) {
    value = 10 * value + (*text - '0');
  }
  while (is_blank(*text)) {
    text++;
  }
  *out = value;
  return digits > 0 && !*text && value <= INT32_MAX;
}

/* The value of an attribute that is a whole number; `missing` where there is none. */
static orb_status get_index(reading *x, const char **attributes, const char *name, int64_t missing, int64_t *out) {
  const char *text = attribute(attributes, name);
  *out = missing;
  if (text && !to_index(text, out)) {
    return malformed(x, "a wrong number", text);
  }
  return ORB_OK;
}

/* The id of a resource, which must be there. */
static orb_status get_id(reading *x, const char **attributes, const char *name, int64_t *out) {
  ORB_TRY(get_index(x, attributes, name, -1, out));
  return *out >= 0 ? ORB_OK : malformed(x, "an element that lacks its attribute", name);
}

static orb_status get_map(reading *x, const char **attributes, orb_3mf_map *out) {
  const char *text = attribute(attributes, "transform");
  double m[12];
  *out = IDENTITY;
  if (!text) {
    return ORB_OK;
  }
  if (!to_numbers(text, 12, m)) {
    return malformed(x, "a transform that is not twelve numbers,", text);
  }
  for (int i = 0; i < 12; i++) {
    out->row[i / 3][i % 3] = m[i] * (i < 9 ? 1 : x->unit);
  }
  return ORB_OK;
}

static int is_hex(const char *text) {
  size_t length = strlen(text);
  return text[0] == '#' && (length == 7 || length == 9) && strspn(text + 1, "0123456789abcdefABCDEF") == length - 1;
}

static orb_status drop(orb_3mf_reader *r, unsigned bit, const char *what, const char *why) {
  if (r->noted & bit) {
    return ORB_OK;
  }
  r->noted |= bit;
  return orb_build_drop(r->build, what, "", why);
}

/* ---- elements */

static orb_status on_model(reading *x, const char **attributes) {
  static const struct {
    const char *name;
    double millimetres;
  } units[] = {{"micron", 0.001}, {"millimeter", 1}, {"centimeter", 10},
               {"inch", 25.4},    {"foot", 304.8},   {"meter", 1000}};
  const char *unit = attribute(attributes, "unit");
  if (!unit) {
    return ORB_OK;
  }
  for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
    if (strcmp(unit, units[i].name) == 0) {
      x->unit = units[i].millimetres;
      return ORB_OK;
    }
  }
  return malformed(x, "the unknown unit", unit);
}

/* A resource of the part that precedes: a group with its materials, or NULL. */
static orb_3mf_resource *group_of(reading *x, int64_t id) {
  orb_3mf_model *model = &x->r->model;
  if (x->group < 0 || x->group_id != id) {
    orb_3mf_resource *found = orb_3mf_find(model, x->part, id);
    if (!found || found->kind != ORB_3MF_GROUP) {
      return NULL;
    }
    x->group_id = id;
    x->group = found - model->resources;
  }
  return &model->resources[x->group];
}

/* The material at an index of a group; −1 where the group is one that the reader does not know. */
static int32_t material_at(reading *x, int64_t group, int64_t index) {
  orb_3mf_resource *found = group >= 0 && index >= 0 ? group_of(x, group) : NULL;
  return found && index < found->count ? (int32_t)(found->first + index) : -1;
}

static orb_status on_group(reading *x, const char **attributes) {
  int64_t id;
  ORB_TRY(get_id(x, attributes, "id", &id));
  return orb_3mf_add(&x->r->model, x->part, id, ORB_3MF_GROUP, orb_xml_line(x->xml));
}

static orb_status add_material(reading *x, const char *name, const char *color) {
  orb_3mf_model *model = &x->r->model;
  if (color && !is_hex(color)) {
    return malformed(x, "a wrong colour", color);
  }
  ORB_TRY(orb_3mf_count(model, 4));
  ORB_TRY(orb_build_grow(model->ctx, &model->materials, &model->material_room, model->material_count + 1,
                         sizeof *model->materials));
  orb_3mf_material *material = &model->materials[model->material_count++];
  *material = (orb_3mf_material){.made = -1};
  (void)snprintf(material->name, sizeof material->name, "%s", name);
  (void)snprintf(material->hex, sizeof material->hex, "%s%s", color ? color : "#FFFFFF", color && color[7] ? "" : "FF");
  model->resources[model->resource_count - 1].count++;
  return ORB_OK;
}

static orb_status on_base(reading *x, const char **attributes) {
  const char *name = attribute(attributes, "name");
  ORB_TRY(add_material(x, name ? name : "", attribute(attributes, "displaycolor")));
  char *alpha = x->r->model.materials[x->r->model.material_count - 1].hex + 7;
  if (strcmp(alpha, "00") == 0) {
    memcpy(alpha, "FF", 2); /* lib3mf 1 writes this if a program gives red, green and blue */
  }
  return ORB_OK;
}

static orb_status on_color(reading *x, const char **attributes) {
  return add_material(x, "", attribute(attributes, "color"));
}

static orb_status on_object(reading *x, const char **attributes) {
  orb_3mf_model *model = &x->r->model;
  int64_t id, group, index;
  ORB_TRY(get_id(x, attributes, "id", &id));
  ORB_TRY(get_index(x, attributes, "pid", -1, &group));
  ORB_TRY(get_index(x, attributes, "pindex", -1, &index));
  int32_t material = material_at(x, group, index);
  ORB_TRY(orb_3mf_add(model, x->part, id, ORB_3MF_OBJECT, orb_xml_line(x->xml)));
  orb_3mf_resource *object = &model->resources[model->resource_count - 1];
  object->material = material;
  const char *name = attribute(attributes, "name");
  (void)snprintf(object->name, sizeof object->name, "%s", name ? name : "");
  return ORB_OK;
}

static orb_status on_vertex(reading *x, const char **attributes) {
  static const char *const names[3] = {"x", "y", "z"};
  orb_3mf_model *model = &x->r->model;
  ORB_TRY(orb_3mf_count(model, 1));
  ORB_TRY(
      orb_build_grow(model->ctx, &model->positions, &model->vertex_room, model->vertex_count + 1, 3 * sizeof(double)));
  double *p = model->positions + 3 * model->vertex_count;
  for (int k = 0; k < 3; k++) {
    const char *text = attribute(attributes, names[k]);
    if (!text || !to_numbers(text, 1, &p[k])) {
      return malformed(x, "a vertex with a wrong or missing coordinate", text ? text : names[k]);
    }
    p[k] *= x->unit;
  }
  model->vertex_count++;
  model->resources[model->resource_count - 1].vertices++;
  return ORB_OK;
}

static orb_status on_triangle(reading *x, const char **attributes) {
  static const char *const corners[3] = {"v1", "v2", "v3"}, *const properties[3] = {"p1", "p2", "p3"};
  orb_3mf_model *model = &x->r->model;
  orb_3mf_resource *object = &model->resources[model->resource_count - 1];
  orb_3mf_triangle triangle = {.material = -1};
  int64_t group, index[3], v;
  ORB_TRY(orb_3mf_count(model, 1));
  for (int k = 0; k < 3; k++) {
    ORB_TRY(get_id(x, attributes, corners[k], &v));
    if (v >= object->vertices) {
      return malformed(x, "a triangle that names a vertex beyond the last,", attribute(attributes, corners[k]));
    }
    triangle.vertex[k] = (int32_t)v;
  }
  ORB_TRY(get_index(x, attributes, "pid", -1, &group));
  for (int k = 0; k < 3; k++) {
    ORB_TRY(get_index(x, attributes, properties[k], k ? index[0] : -1, &index[k]));
  }
  if (index[0] >= 0) {
    const char *of_object = group < 0 && object->material >= 0 ? "" : NULL;
    triangle.material = of_object ? object->material : material_at(x, group, index[0]);
    if (index[1] != index[0] || index[2] != index[0]) {
      ORB_TRY(drop(x->r, 1, "colours that change within a triangle", "A triangle has one material."));
    }
  }
  ORB_TRY(orb_build_grow(model->ctx, &model->triangles, &model->triangle_room, model->triangle_count + 1,
                         sizeof *model->triangles));
  model->triangles[model->triangle_count++] = triangle;
  object->triangles++;
  return ORB_OK;
}

static orb_status get_use(reading *x, const char **attributes, orb_3mf_use *out) {
  const char *path = attribute(attributes, PRODUCTION "path");
  ORB_TRY(orb_3mf_count(&x->r->model, 4));
  *out = (orb_3mf_use){.part = x->part};
  if (path) {
    ORB_TRY(orb_3mf_part(x->r, path, orb_xml_line(x->xml), &out->part));
  }
  ORB_TRY(get_id(x, attributes, "objectid", &out->id));
  return get_map(x, attributes, &out->map);
}

static orb_status on_component(reading *x, const char **attributes) {
  orb_3mf_model *model = &x->r->model;
  orb_3mf_use use;
  ORB_TRY(get_use(x, attributes, &use));
  ORB_TRY(orb_build_grow(model->ctx, &model->components, &model->component_room, model->component_count + 1,
                         sizeof *model->components));
  model->components[model->component_count++] = use;
  model->resources[model->resource_count - 1].count++;
  return ORB_OK;
}

static orb_status on_item(reading *x, const char **attributes) {
  orb_3mf_model *model = &x->r->model;
  orb_3mf_use use;
  if (x->part != 0) {
    return ORB_OK; /* the first part's build counts */
  }
  ORB_TRY(get_use(x, attributes, &use));
  ORB_TRY(orb_build_grow(model->ctx, &model->items, &model->item_room, model->item_count + 1, sizeof *model->items));
  model->items[model->item_count++] = use;
  return ORB_OK;
}

/* ---- files */

/* What an element means by its name and its parent. read NULL: only its children matter. */
static const struct {
  place in;
  const char *name;
  place is;
  orb_status (*read)(reading *x, const char **attributes);
} ELEMENTS[] = {
    {VERTICES, CORE "vertex", VERTEX, on_vertex},
    {TRIANGLES, CORE "triangle", TRIANGLE, on_triangle},
    {OUTSIDE, CORE "model", MODEL, on_model},
    {MODEL, CORE "resources", RESOURCES, NULL},
    {MODEL, CORE "build", BUILD, NULL},
    {RESOURCES, CORE "object", OBJECT, on_object},
    {RESOURCES, CORE "basematerials", GROUP, on_group},
    {RESOURCES, MATERIAL "colorgroup", GROUP, on_group},
    {GROUP, CORE "base", GROUP_ENTRY, on_base},
    {GROUP, MATERIAL "color", GROUP_ENTRY, on_color},
    {OBJECT, CORE "mesh", MESH, NULL},
    {OBJECT, CORE "components", COMPONENTS, NULL},
    {MESH, CORE "vertices", VERTICES, NULL},
    {MESH, CORE "triangles", TRIANGLES, NULL},
    {COMPONENTS, CORE "component", COMPONENT, on_component},
    {BUILD, CORE "item", ITEM, on_item},
};

/* What the reader does not read, but notes as dropped. */
static const struct {
  const char *name, *what, *why;
} UNREAD[] = {
    {MATERIAL "texture2dgroup", "texture2dgroup", "The reader takes colours from 3MF, no textures."},
    {MATERIAL "compositematerials", "compositematerials", "The reader takes single materials from 3MF, no mixtures."},
    {MATERIAL "multiproperties", "multiproperties", "The reader takes single materials from 3MF, no mixtures."},
};

static orb_status note_unread(reading *x, const char *name) {
  for (size_t i = 0; i < sizeof UNREAD / sizeof *UNREAD; i++) {
    if (strcmp(name, UNREAD[i].name) == 0) {
      return drop(x->r, 2u << i, UNREAD[i].what, UNREAD[i].why);
    }
  }
  return ORB_OK;
}

static orb_status on_element(void *user, const char *name, const char **attributes, int depth) {
  reading *x = user;
  if (!attributes) {
    return ORB_OK;
  }
  place in = depth ? x->places[depth - 1] : OUTSIDE;
  x->places[depth] = IGNORED;
  for (size_t i = 0; i < sizeof ELEMENTS / sizeof *ELEMENTS; i++) {
    if (ELEMENTS[i].in == in && strcmp(name, ELEMENTS[i].name) == 0) {
      x->places[depth] = ELEMENTS[i].is;
      return ELEMENTS[i].read ? ELEMENTS[i].read(x, attributes) : ORB_OK;
    }
  }
  if (depth == 0) {
    return malformed(x, "a root element that is not a 3MF model:", name);
  }
  return in == RESOURCES ? note_unread(x, name) : ORB_OK;
}

static orb_status on_bytes(void *user, const unsigned char *bytes, size_t size, int is_last) {
  return orb_xml_parse(((reading *)user)->xml, bytes, size, is_last);
}

static orb_status read_xml(orb_3mf_reader *r, const orb_zip_entry *entry, reading *x, orb_xml_element element) {
  orb_context *ctx = r->model.ctx;
  *x = (reading){.r = r, .part = x->part, .unit = 1, .group = -1};
  ORB_TRY(orb_xml_begin(ctx, element, x, &x->xml));
  orb_status status = orb_zip_read(ctx, &r->zip, entry, &r->allowance, on_bytes, x);
  orb_xml_end(x->xml);
  return status;
}

orb_status orb_3mf_read_part(orb_3mf_reader *r, int32_t part) {
  reading x = {.part = part};
  const orb_zip_entry entry = r->parts[part].entry;
  return read_xml(r, &entry, &x, on_element);
}

static orb_status on_relation(void *user, const char *name, const char **attributes, int depth) {
  reading *x = user;
  const char *type = attributes ? attribute(attributes, "Type") : NULL, *target = NULL;
  int32_t part;
  if (depth == 1 && strcmp(name, RELATIONS "Relationship") == 0 && type && x->r->part_count == 0 &&
      strcmp(type, "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel") == 0) {
    target = attribute(attributes, "Target");
  }
  return target ? orb_3mf_part(x->r, target, orb_xml_line(x->xml), &part) : ORB_OK;
}

orb_status orb_3mf_read_relations(orb_3mf_reader *r, const orb_zip_entry *entry) {
  reading x = {.part = 0};
  return read_xml(r, entry, &x, on_relation);
}

/* ---- parts */

static char lower(char c) {
  return c >= 'A' && c <= 'Z' ? (char)(c + 32) : c;
}

/* Whether the archive has a file at a path in lower case. */
static int find_file(const orb_zip *zip, const char *path, orb_zip_entry *out) {
  size_t length = strlen(path), at = 0;
  while (orb_zip_next(zip, &at, out)) {
    size_t i = 0;
    while (i < length && out->name_length == length && lower((char)out->name[i]) == path[i]) {
      i++;
    }
    if (i == length && out->name_length == length) {
      return 1;
    }
  }
  return 0;
}

orb_status orb_3mf_part(orb_3mf_reader *r, const char *path, int64_t line, int32_t *out) {
  orb_context *ctx = r->model.ctx;
  char name[ORB_3MF_PATH_MAX] = "";
  path += *path == '/';
  for (size_t i = 0; path[i] && i + 1 < sizeof name; i++) {
    name[i] = lower(path[i]);
  }
  if (!r->slots && !(r->slots = ORB_NEW0(ctx, int32_t, SLOTS))) {
    return ORB_E_NO_MEMORY;
  }
  uint64_t slot = orb_hash(ctx, name, strlen(name)) % SLOTS;
  for (; r->slots[slot]; slot = (slot + 1) % SLOTS) {
    *out = r->slots[slot] - 1;
    if (strcmp(r->parts[*out].path, name) == 0) {
      return ORB_OK;
    }
  }
  if (r->part_count == ORB_3MF_PARTS_MAX) {
    return orb_fail(ctx, ORB_E_TOO_LARGE, "The 3MF file has more than %d files of objects; export one object alone.",
                    ORB_3MF_PARTS_MAX);
  }
  ORB_TRY(orb_build_grow(ctx, &r->parts, &r->part_room, r->part_count + 1, sizeof *r->parts));
  orb_3mf_part_file *part = &r->parts[r->part_count];
  memcpy(part->path, name, sizeof name);
  if (!find_file(&r->zip, name, &part->entry)) {
    return orb_build_malformed(ctx, 1, line, "The 3MF file lacks the file \"%.200s\", which has its objects.", name);
  }
  *out = r->part_count++;
  r->slots[slot] = *out + 1;
  return ORB_OK;
}

void orb_3mf_reader_free(orb_3mf_reader *r, orb_context *ctx) {
  orb_free(ctx, r->parts);
  orb_free(ctx, r->slots);
}
