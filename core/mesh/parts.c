#include "mesh/parts.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "mesh/sort.h"

typedef struct tally {
  int64_t size, best, run; /* triangles: in all, of the object with most of them, of the current object */
  int32_t object, last;    /* with most of them; the current one */
} tally;

static void add_triangle(tally *piece, int32_t object) {
  piece->size++;
  if (object < 0) {
    return;
  }
  piece->run = piece->last == object ? piece->run + 1 : 1; /* triangles are in the file's order, so objects are too */
  piece->last = object;
  if (piece->run > piece->best) {
    piece->best = piece->run;
    piece->object = object;
  }
}

orb_status orb_parts_list(orb_surface *s, orb_parts *out) {
  const orb_mesh *mesh = s->mesh;
  *out = (orb_parts){0};
  tally *pieces = ORB_NEW(s->ctx, tally, s->piece_count);
  uint64_t *order = ORB_NEW(s->ctx, uint64_t, s->piece_count);
  out->part = ORB_NEW(s->ctx, orb_part, s->piece_count);
  orb_status status = pieces && order && out->part ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < s->piece_count && status == ORB_OK; i++) {
    pieces[i] = (tally){.object = -1, .last = -1};
  }
  for (int32_t t = 0, object = -1; t < mesh->triangle_count && status == ORB_OK; t++) {
    while (object + 1 < mesh->object_count && mesh->objects[object + 1].first_triangle <= mesh->source_triangle[t]) {
      object++;
    }
    add_triangle(&pieces[s->piece[t]], mesh->source_triangle[t] < 0 ? -1 : object);
  }
  int32_t count = 0;
  for (int32_t i = 0; i < s->piece_count && status == ORB_OK; i++) {
    if (pieces[i].size > 0) {
      order[count++] = (uint64_t)(INT32_MAX - pieces[i].size) << 32 | (uint32_t)i;
    }
  }
  if (status == ORB_OK) {
    orb_sort_u64(order, count);
  }
  for (int32_t i = 0; i < count; i++) {
    int32_t piece = (int32_t)(uint32_t)order[i];
    out->part[i] = (orb_part){.triangles = pieces[piece].size, .piece = piece, .object = pieces[piece].object};
  }
  out->count = count;
  if (status != ORB_OK) {
    orb_free(s->ctx, out->part);
    out->part = NULL;
  }
  orb_free(s->ctx, pieces);
  orb_free(s->ctx, order);
  return status;
}

const char *orb_part_name(const orb_mesh *mesh, const orb_part *part) {
  return part->object < 0 ? "" : mesh->objects[part->object].name;
}

const char *orb_part_node(const orb_mesh *mesh, const orb_part *part) {
  return part->object < 0 ? "" : mesh->objects[part->object].node;
}

static int is_named(const orb_object *object, const char *name) {
  return strcmp(object->name, name) == 0 || strcmp(object->node, name) == 0;
}

/* The piece of the first triangle of an object with this name; −1: there is none. */
static int32_t piece_of_object(const orb_surface *s, const char *name) {
  const orb_mesh *mesh = s->mesh;
  for (int32_t t = 0, object = -1; t < mesh->triangle_count; t++) {
    while (object + 1 < mesh->object_count && mesh->objects[object + 1].first_triangle <= mesh->source_triangle[t]) {
      object++;
    }
    if (object >= 0 && mesh->source_triangle[t] >= 0 && is_named(&mesh->objects[object], name)) {
      return s->piece[t];
    }
  }
  return -1;
}

int32_t orb_parts_find(const orb_surface *s, const orb_parts *parts, const orb_repair_options *options) {
  const orb_mesh *mesh = s->mesh;
  if (!options->part_name[0]) {
    return options->part >= 0 && options->part < parts->count ? options->part : -1;
  }
  for (int32_t i = 0; i < parts->count; i++) {
    if (strcmp(orb_part_name(mesh, &parts->part[i]), options->part_name) == 0) {
      return i;
    }
  }
  for (int32_t i = 0; i < parts->count; i++) {
    if (strcmp(orb_part_node(mesh, &parts->part[i]), options->part_name) == 0) {
      return i;
    }
  }
  int32_t piece = piece_of_object(s, options->part_name);
  for (int32_t i = 0; i < parts->count && piece >= 0; i++) {
    if (parts->part[i].piece == piece) {
      return i;
    }
  }
  return -1;
}
