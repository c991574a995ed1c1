/* GET of stored files: meshes, spheres, assets and places. */
#include <stdio.h>
#include <string.h>

#include "api/mesh_codec.h"
#include "http/disposition.h"
#include "http/http.h"
#include "metrics.h"
#include "store/spheres.h"

/* Sends a shape's sphere, or the places that are in the same object. Blocks: reads the object's table. */
static void reply_part_of_spheres(request *r, int shape, const char *name) {
  object_part part;
  char disposition[DISPOSITION_SIZE];
  object_is_ready(r, OBJECT_SPHERES, "");
  store_result found = spheres_find(r->srv->store, r->id, shape, &part.start, &part.length);
  if (found != STORE_OK) {
    reply_store(r, found);
    return;
  }
  disposition_write(name, disposition);
  reply_part(r, OBJECT_SPHERES, r->id, part, r->id, "application/octet-stream", disposition);
}

/* 0 without a response outside a task, if one is needed to verify, make or compress the object; releases the
 * description. */
static int file_of(request *r, const cached *entry) {
  char name[DISPOSITION_NAME], format[sizeof(api_format_name)] = "bin", disposition[DISPOSITION_SIZE];
  int done = 1;
  switch (r->route->id) {
    case ROUTE_MESH_FILE: {
      const char *at = strstr(entry->row.json, "\"format\":\"");
      if (at) {
        at += strlen("\"format\":\"");
        snprintf(format, sizeof format, "%.*s", (int)strcspn(at, "\""), at);
      }
      disposition_mesh_name(entry->row.json, format, name);
      disposition_write(name, disposition);
      done = object_is_ready(r, OBJECT_MESH, entry->row.sha) &&
             reply_object(r, OBJECT_MESH, r->id, r->id,
                          strcmp(format, "glb") == 0 ? "model/gltf-binary" : "application/octet-stream", disposition);
      break;
    }
    case ROUTE_EMBEDDING_SPHERE:
      disposition_write("sphere.ply", disposition);
      done = object_is_ready(r, OBJECT_SPHERE, entry->row.sha) &&
             reply_object(r, OBJECT_SPHERE, r->id, entry->row.sha, "application/octet-stream", disposition);
      break;
    case ROUTE_SUPERMESH_PLACES:
      if (resource_places_are_joined(&entry->row)) {
        if ((done = r->phase == PHASE_AWAY) != 0) {
          reply_part_of_spheres(r, SPHERES_PLACES, "places.bin");
        }
        break;
      }
      disposition_write("places.bin", disposition);
      done = object_is_ready(r, OBJECT_PLACES, entry->row.places) &&
             reply_object(r, OBJECT_PLACES, r->id, r->id, "application/octet-stream", disposition);
      break;
    case ROUTE_SUPERMESH_SPHERE:
      snprintf(name, sizeof name, "sphere-%d.ply", r->shape);
      reply_part_of_spheres(r, r->shape, name);
      break;
    default:
      return reply_asset(r, entry);
  }
  cache_release(r->srv->descriptions, entry);
  return done;
}

/* The row was there, and its object is not. */
static int is_lost(const request *r) {
  return r->status == 404;
}

static void file_away(request *r) {
  store_result result;
  const cached *entry = find_description(r->srv, object_owner(r), r->id, access_view(r), &result);
  if (!entry) {
    reply_store(r, result);
    return;
  }
  file_of(r, entry);
  if (is_lost(r)) {
    reply_lost(r);
  }
}

enum MHD_Result handle_file(request *r) {
  if (r->route->id == ROUTE_SUPERMESH_ASSET && !profile_read(r)) {
    return MHD_YES;
  }
  const cached *entry = cache_find(r->srv->descriptions, object_owner(r), r->id, access_view(r));
  if (!entry || r->route->id == ROUTE_SUPERMESH_SPHERE) {
    if (entry) {
      cache_release(r->srv->descriptions, entry);
    }
    return request_go_away(r, r->srv->io, file_away);
  }
  metrics_cache(1);
  note_use(r->srv, entry);
  if (!file_of(r, entry)) {
    return request_go_away(r, r->srv->checks, file_away);
  }
  return is_lost(r) ? request_go_away(r, r->srv->io, reply_lost) : MHD_YES;
}
