/* GET /v1/morph.glb: the recipe is the URL. It names the same supermesh as the body of POST /v1/supermeshes with these
 * members, and the request waits until that exists.
 *
 * A known recipe is answered without a task: `recipes` remembers which supermesh a query named, for as long as no
 * description was dropped (a mesh may have been deleted, or uploaded again under another name). */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/landmark_codec.h"
#include "api/transfer_codec.h"
#include "http/http.h"
#include "http/read_json.h"
#include "metrics.h"
#include "store/object_removal.h"

enum { RECIPES = 4096, RECIPE_MOST = 1024, FAILURE_MS = 600000 };

typedef struct recipe {
  char *text; /* the tenant, a NUL, and the query up to the signature; NULL: empty */
  size_t size;
  char id[API_ID_SIZE];
  unsigned long long drops;
} recipe;

static struct {
  pthread_mutex_t lock;
  recipe all[RECIPES];
} recipes = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* The text of a request's recipe; returns its size, 0 if it is too long to be remembered. The signature changes each
 * time that a page is made, and is not part of the recipe. */
static size_t text_of(const request *r, char out[RECIPE_MOST]) {
  const char *query = strchr(r->target, '?'), *tenant = access_tenant(r);
  const char *end = query ? strstr(query, "&key=") : NULL;
  size_t size = !query ? 0 : r->signer && end ? (size_t)(end - query) : strlen(query), before = strlen(tenant) + 1;
  if (before + size > RECIPE_MOST) {
    return 0;
  }
  memcpy(out, tenant, before);
  memcpy(out + before, query ? query : "", size);
  return before + size;
}

static recipe *slot_of(const request *r, const char *text, size_t size) {
  uint64_t hash;
  _Static_assert(crypto_shorthash_BYTES == sizeof hash && crypto_shorthash_KEYBYTES == CATALOGUE_SECRET, "SipHash");
  crypto_shorthash((unsigned char *)&hash, (const unsigned char *)text, size, r->srv->secret);
  return &recipes.all[hash % RECIPES];
}

static int recall(const request *r, char id[API_ID_SIZE]) {
  char text[RECIPE_MOST];
  size_t size = text_of(r, text);
  if (size == 0) {
    return 0;
  }
  unsigned long long drops = cache_drops(r->srv->descriptions);
  const recipe *at = slot_of(r, text, size);
  pthread_mutex_lock(&recipes.lock);
  int known = at->text && at->drops == drops && at->size == size && memcmp(at->text, text, size) == 0;
  if (known) {
    memcpy(id, at->id, API_ID_SIZE);
  }
  pthread_mutex_unlock(&recipes.lock);
  return known;
}

static void remember(const request *r, const char *id, unsigned long long drops) {
  char text[RECIPE_MOST];
  size_t size = text_of(r, text);
  char *copy = size > 0 ? malloc(size) : NULL;
  if (!copy) {
    return;
  }
  memcpy(copy, text, size);
  recipe *at = slot_of(r, text, size);
  pthread_mutex_lock(&recipes.lock);
  char *old = at->text;
  *at = (recipe){.text = copy, .size = size, .drops = drops};
  memcpy(at->id, id, API_ID_SIZE);
  pthread_mutex_unlock(&recipes.lock);
  free(old);
}

enum kind { TEXT, NUMBER, BOOL };

/* The parameters that become a member of the request as they are. */
static const struct member {
  const char *parameter, *object, *name;
  enum kind kind;
} members[] = {
    {"align", "align", "method", TEXT},
    {"remesh", "remesh", "method", TEXT},
    {"tolerance", "remesh", "tolerance", NUMBER},
    {"max_triangles", "remesh", "max_triangles", NUMBER},
    {"fit", "asset", "fit", TEXT},
    {"path", "asset", "path", TEXT},
    {"animation", "asset", "animation", TEXT},
    {"normals", "asset", "normals", BOOL},
    {"holes", "asset", "holes", TEXT},
};

static cJSON *object_of(cJSON *body, const char *name) {
  cJSON *found = cJSON_GetObjectItemCaseSensitive(body, name);
  return found ? found : cJSON_AddObjectToObject(body, name);
}

/* The value as JSON. What is not a number or boolean stays text, which the reader of requests refuses by name. */
static cJSON *value_of(const char *text, enum kind kind) {
  char *end;
  size_t plain = strspn(text, "0123456789.eE+-");
  double number = strtod(text, &end);
  if (kind == NUMBER && *text && !text[plain] && !*end) {
    return cJSON_CreateNumber(number);
  }
  if (kind == BOOL && (strcmp(text, "true") == 0 || strcmp(text, "false") == 0)) {
    return cJSON_CreateBool(text[0] == 't');
  }
  return cJSON_CreateString(text);
}

/* Splits a comma list in place; returns the number of items, at most API_SHAPES_MAX + 1. */
static int split(char *text, char *items[API_SHAPES_MAX + 1]) {
  int count = 0;
  for (char *at = text; at && count <= API_SHAPES_MAX; count++) {
    items[count] = at;
    at = strchr(at, ',');
    if (at) {
      *at++ = 0;
    }
  }
  return count;
}

static int refuse_query(api_problem *problem, const char *parameter, const char *why) {
  api_refuse(problem, "bad-query", "%s", why);
  api_json_member_string(&problem->facts, "parameter", parameter);
  return 0;
}

static int add_shapes(const request *r, cJSON *body, api_problem *problem) {
  const char *shapes = query_of(r, "shapes"), *names = query_of(r, "names");
  char *ids[API_SHAPES_MAX + 1], *called[API_SHAPES_MAX + 1];
  char *list = strdup(shapes ? shapes : ""), *others = strdup(names ? names : "");
  int fine = list && others, count = fine ? split(list, ids) : 0, named = fine && names ? split(others, called) : 0;
  cJSON *array = cJSON_AddArrayToObject(body, "shapes");
  if (fine && (!shapes || count < 2 || count > API_SHAPES_MAX)) {
    fine = refuse_query(problem, "shapes", "\"shapes\" must list the ids of 2 to 16 meshes, separated by commas.");
  } else if (fine && names && named != count) {
    fine = refuse_query(problem, "names",
                        "\"names\" must list one name for each shape, separated by commas. A name that contains "
                        "a comma needs POST /v1/supermeshes.");
  } else if (!fine) {
    api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  for (int i = 0; fine && i < count; i++) {
    cJSON *shape = cJSON_CreateObject();
    cJSON_AddStringToObject(shape, "mesh", ids[i]);
    if (named) {
      cJSON_AddStringToObject(shape, "name", called[i]);
    }
    cJSON_AddItemToArray(array, shape);
  }
  free(list);
  free(others);
  return fine;
}

/* The body of the POST that this recipe stands for. */
static int add_members(const request *r, cJSON *body, api_problem *problem) {
  const char *landmarks = query_of(r, "landmarks"), *preset = query_of(r, "preset");
  const char *transfer = query_of(r, "transfer");
  if (landmarks && strcmp(landmarks, "auto") == 0) {
    cJSON_AddStringToObject(body, "landmarks", "auto");
  } else if (landmarks) {
    cJSON_AddStringToObject(object_of(body, "landmarks"), "id", landmarks);
  }
  if (preset) {
    cJSON_AddStringToObject(object_of(object_of(body, "embedding"), "options"), "preset", preset);
  }
  if (transfer && !cJSON_AddItemToObject(body, "transfer", api_transfer_parse(transfer))) {
    return api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
  for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
    const char *text = query_of(r, members[i].parameter);
    if (text) {
      cJSON_AddItemToObject(object_of(body, members[i].object), members[i].name, value_of(text, members[i].kind));
    }
  }
  return add_shapes(r, body, problem);
}

/* A recipe that failed is not computed again for each visitor: a refusal of the shapes or landmarks stays the same. */
static int failed_before(request *r, const wanted_result *wish) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  char *problem = queue_failure(r->srv->q, wish->id, access_tenant(r), (int64_t)now.tv_sec * 1000 - FAILURE_MS);
  int again = problem && strstr(problem, "\"status\":422") != NULL;
  if (again) {
    reply_job_problem(r, problem);
  }
  free(problem);
  return again;
}

static int is_deleted(const request *r, const char *id) {
  resource row = {0};
  objects_settle(r->srv->store);
  store_result found = catalogue_get(r->srv->cat, RESOURCE_SUPERMESH, id, &row);
  resource_free(&row);
  return found == STORE_NOT_FOUND;
}

static void morph_away(request *r) {
  wanted_result wish = {0};
  api_problem problem = {0};
  store_result result;
  unsigned long long drops = cache_drops(r->srv->descriptions);
  cJSON *body = cJSON_CreateObject();
  int fine = add_members(r, body, &problem) && resolve_landmarks(r, body, &problem) &&
             wanted_supermesh(r, body, &wish, &problem);
  json_done(body); /* resolve_landmarks() reads JSON */
  if (!fine) {
    reply_problem(r, &problem);
  } else {
    const cached *known = find_description(r->srv, RESOURCE_SUPERMESH, wish.id, access_tenant(r), &result);
    if (known) {
      remember(r, wish.id, drops);
      r->make_again = morph_away;
      reply_asset(r, known);
      if (r->status == 404 && is_deleted(r, wish.id)) { /* it was damaged, see evict_damaged() */
        reply_drop(r);
        submit_wanted(r, &wish);
      } else if (r->status == 404) {
        reply_lost(r);
      }
    } else if (result != STORE_NOT_FOUND) {
      reply_store(r, result);
    } else if (!failed_before(r, &wish)) {
      submit_wanted(r, &wish);
    }
  }
  api_text_free(&wish.canonical);
}

enum MHD_Result handle_morph(request *r) {
  char id[API_ID_SIZE];
  int64_t wait = query_of(r, "wait") ? read_wait_ms(r) : WAIT_MOST_MS;
  if (wait < 0 || !profile_read(r)) {
    return MHD_YES;
  }
  const cached *known =
      recall(r, id) ? cache_find(r->srv->descriptions, RESOURCE_SUPERMESH, id, access_tenant(r)) : NULL;
  if (known) {
    metrics_cache(1);
    note_use(r->srv, known);
    if (reply_asset(r, known) && r->status != 404) {
      return MHD_YES;
    }
  }
  r->wait_until = orb_clock_ms() + wait;
  r->waits_for_what = WAIT_ASSET;
  return request_go_away(r, r->srv->io, morph_away);
}
