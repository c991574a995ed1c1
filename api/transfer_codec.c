#include "api/transfer_codec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/options.h"

/* Refuses an entry, whose number becomes a fact of the problem. */
#define REFUSE(problem, index, ...)                     \
  (api_refuse(problem, "invalid-request", __VA_ARGS__), \
   api_text_printf(&(problem)->facts, "\"transfer\":%d", (int)(index)), 0)

static int read_what(const cJSON *value, int32_t index, orb_carry *out, api_problem *problem) {
  for (int what = 0; cJSON_IsString(value) && what < ORB_CARRY_COUNT; what++) {
    if (strcmp(value->valuestring, orb_carry_name((orb_carry_what)what)) == 0) {
      out->what = (orb_carry_what)what;
      return 1;
    }
  }
  return REFUSE(problem, index,
                "\"what\" of entry %d of \"transfer\" must be \"skin\", \"color\", \"texcoord\", \"targets\" or "
                "\"texture\".",
                (int)index);
}

static int is_whole(const cJSON *value, double least, double most) {
  return cJSON_IsNumber(value) && value->valuedouble >= least && value->valuedouble <= most &&
         value->valuedouble == floor(value->valuedouble);
}

static int read_entry(const cJSON *item, int32_t shape_count, int32_t index, orb_carry *out, api_problem *problem) {
  static const char *const known[] = {"from", "what", "resolution", NULL};
  if (!cJSON_IsObject(item)) {
    return REFUSE(problem, index, "Each entry of \"transfer\" must be an object with \"from\" and \"what\".");
  }
  if (!api_members_known(item, "an entry of \"transfer\"", known, problem)) {
    api_json_member_integer(&problem->facts, "transfer", index);
    return 0;
  }
  const cJSON *from = cJSON_GetObjectItemCaseSensitive(item, "from");
  const cJSON *resolution = cJSON_GetObjectItemCaseSensitive(item, "resolution");
  *out = (orb_carry){0};
  if (!is_whole(from, 0, shape_count - 1)) {
    return REFUSE(problem, index,
                  "\"from\" of entry %d of \"transfer\" must be the number of a shape, 0 to %d in their order.",
                  (int)index, (int)shape_count - 1);
  }
  out->from = (int32_t)from->valuedouble;
  if (!read_what(cJSON_GetObjectItemCaseSensitive(item, "what"), index, out, problem)) {
    return 0;
  }
  if (resolution && (out->what != ORB_CARRY_TEXTURE || !is_whole(resolution, ORB_BAKE_LEAST, ORB_BAKE_MOST))) {
    return REFUSE(problem, index,
                  "\"resolution\" of entry %d of \"transfer\" must be the texels per side of a \"texture\", %d to %d.",
                  (int)index, (int)ORB_BAKE_LEAST, (int)ORB_BAKE_MOST);
  }
  out->resolution = resolution ? (int32_t)resolution->valuedouble : 0;
  if (out->what == ORB_CARRY_TEXTURE && out->from == 0) {
    return REFUSE(problem, index,
                  "Entry %d of \"transfer\" takes a texture from the first shape, whose materials the asset has "
                  "already. Name a later shape.",
                  (int)index);
  }
  return 1;
}

int api_transfer_read(const cJSON *list, int32_t shape_count, orb_carry *out, int32_t *count, api_problem *problem) {
  int skin = -1;
  *count = 0;
  if (!cJSON_IsArray(list) || cJSON_GetArraySize(list) > ORB_CARRY_MAX) {
    return api_refuse(problem, "invalid-request", "\"transfer\" must be an array of at most %d entries.",
                      (int)ORB_CARRY_MAX);
  }
  for (const cJSON *item = list->child; item; item = item->next, ++*count) {
    orb_carry *made = &out[*count];
    if (!read_entry(item, shape_count, *count, made, problem)) {
      return 0;
    }
    for (int32_t i = 0; i < *count; i++) {
      if (out[i].from == made->from && out[i].what == made->what) {
        return REFUSE(problem, *count, "Entries %d and %d of \"transfer\" ask for the same. Omit one of them.", (int)i,
                      (int)*count);
      }
    }
    if (made->what == ORB_CARRY_SKIN && skin >= 0) {
      return REFUSE(problem, *count, "An asset can have one skin, but entries %d and %d of \"transfer\" ask for one.",
                    skin, (int)*count);
    }
    skin = made->what == ORB_CARRY_SKIN ? (int)*count : skin;
  }
  return 1;
}

/* A part of an entry: digits become a number. */
static int add_part(cJSON *item, const char *name, const char *text, size_t size, int is_number) {
  char part[16];
  size_t kept = size < sizeof part ? size : sizeof part - 1;
  memcpy(part, text, kept);
  part[kept] = 0;
  return is_number && size > 0 && kept == size && strspn(part, "0123456789") == size
             ? cJSON_AddNumberToObject(item, name, strtod(part, NULL)) != NULL
             : cJSON_AddStringToObject(item, name, part) != NULL;
}

/* One entry: the shape, what, and of a texture the texels a side. */
static int add_entry(cJSON *list, const char *text, size_t size) {
  cJSON *item = cJSON_CreateObject();
  if (!item || !cJSON_AddItemToArray(list, item)) {
    cJSON_Delete(item);
    return 0;
  }
  const char *first = memchr(text, ':', size);
  size_t before = first ? (size_t)(first - text) : size;
  if (!add_part(item, "from", text, before, 1)) {
    return 0;
  }
  if (!first) {
    return 1;
  }
  const char *what = first + 1, *second = memchr(what, ':', size - before - 1);
  size_t length = second ? (size_t)(second - what) : size - before - 1;
  return add_part(item, "what", what, length, 0) &&
         (!second || add_part(item, "resolution", second + 1, size - before - length - 2, 1));
}

cJSON *api_transfer_parse(const char *list) {
  cJSON *out = cJSON_CreateArray();
  int fine = out != NULL;
  for (int count = 0; fine && list && count <= ORB_CARRY_MAX; count++) { /* one more than is accepted */
    const char *end = strchr(list, ',');
    fine = add_entry(out, list, end ? (size_t)(end - list) : strlen(list));
    list = end ? end + 1 : NULL;
  }
  if (!fine) {
    cJSON_Delete(out);
    out = NULL;
  }
  return out;
}

void api_transfer_write(const orb_carry *carries, int32_t count, api_text *out) {
  api_json_open(out, '[');
  for (int32_t i = 0; i < count; i++) {
    api_json_open(out, '{');
    api_json_member_integer(out, "from", carries[i].from);
    api_json_member_string(out, "what", orb_carry_name(carries[i].what));
    if (carries[i].resolution) {
      api_json_member_integer(out, "resolution", carries[i].resolution);
    }
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}

void api_transferred_write(const orb_carried *carried, int32_t count, api_text *out) {
  api_json_open(out, '[');
  for (int32_t i = 0; i < count; i++) {
    api_json_open(out, '{');
    api_json_member_integer(out, "from", carried[i].from);
    api_json_member_string(out, "what", orb_carry_name(carried[i].what));
    api_json_member_string(out, "as", carried[i].as);
    if (carried[i].resolution > 0) {
      api_json_member_integer(out, "resolution", carried[i].resolution);
    }
    api_json_close(out, '}');
  }
  api_json_close(out, ']');
}
