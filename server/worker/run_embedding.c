#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/json.h"
#include "worker/run.h"

static int read_request(const run_job *j, api_embedding_request *request, api_problem *problem) {
  api_json_error error;
  cJSON *body = api_json_parse(j->request, strlen(j->request), &error);
  int fine =
      body ? api_embedding_request_read(body, request, problem)
           : api_refuse(problem, "corrupt", "The stored request of the job cannot be read: send the request again.");
  cJSON_Delete(body);
  return fine;
}

static int store_sphere(const run_env *env, orb_context *ctx, const char *key, const orb_mesh *mesh,
                        const orb_embedding *embedding, resource *result, api_problem *problem) {
  orb_buffer ply = {0};
  int fine = orb_sphere_ply_write(ctx, mesh, embedding->points, &ply) == ORB_OK;
  if (fine) {
    api_id_of_text((const char *)ply.data, ply.size, result->sha);
    result->bytes = (int64_t)ply.size;
    store_result stored = objects_put(env->store, OBJECT_SPHERE, key, ply.data, ply.size);
    if (stored != STORE_OK) {
      task_refuse_store(stored, problem);
      fine = 0;
    }
  }
  orb_buffer_free(ctx, &ply);
  return fine;
}

int run_embedding(const run_env *env, orb_context *ctx, const run_job *j, run_output *out, api_problem *problem) {
  resource *result = &out->row;
  api_embedding_request request;
  orb_mesh mesh = {0};
  orb_embedding embedding = {0};
  resource known = {0};
  int fine = 0;
  if (!read_request(j, &request, problem)) {
    return 0;
  }
  if (run_get(env, RESOURCE_EMBEDDING, j->key, &known) == STORE_OK) {
    resource_free(&known); /* of an earlier attempt or another owner */
    return 1;
  }
  progress_report(env->progress, "read", 0);
  double began = orb_clock();
  if (!run_load_mesh(env, ctx, request.mesh, &mesh, NULL, 0, NULL, NULL, problem)) {
    goto done;
  }
  orb_mesh_drop_attributes(ctx, &mesh);
  double checked = orb_clock() - began;
  if (orb_embed(ctx, &mesh, &request.options, &embedding) != ORB_OK) {
    goto done;
  }
  out->flips += embedding.certificate.flipped;
  embedding.timings.check += checked;
  embedding.timings.total += checked;
  progress_report(env->progress, "store", 0);
  objects_hold(env->store);
  out->holds = 1;
  if (!store_sphere(env, ctx, j->key, &mesh, &embedding, result, problem)) {
    goto done;
  }
  api_text json = {0};
  result->kind = RESOURCE_EMBEDDING;
  result->created = (int64_t)time(NULL) * 1000;
  memcpy(result->id, j->key, sizeof result->id);
  api_embedding_write(result->id, &request, &embedding, result->created, &json);
  result->json = json.data;
  fine = !json.failed;
  if (!fine) {
    api_refuse(problem, "no-memory", "The server has no memory left; try again later.");
  }
done:
  orb_embedding_free(ctx, &embedding);
  orb_mesh_free(ctx, &mesh);
  return fine;
}
