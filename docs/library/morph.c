/* Two closed meshes in, one GLB out that morphs the first into the second: morph FIRST SECOND > OUT.glb */
#include <orbmorph/orbmorph.h>
#include <stdio.h>

static int failed(orb_context *ctx, const char *what) {
  const orb_error *error = orb_context_error(ctx);
  fprintf(stderr, "%s: %s: %s\n", what, orb_status_name(error->status), error->detail);
  return 0;
}

static int load(orb_context *ctx, const char *path, orb_mesh *mesh, orb_embedding *sphere) {
  orb_buffer bytes = {NULL, 0, 0, 0};
  orb_status status = ORB_OK;
  char part[65536];
  FILE *file = fopen(path, "rb");
  while (file && status == ORB_OK && !feof(file) && !ferror(file)) {
    status = orb_buffer_append(ctx, &bytes, part, fread(part, 1, sizeof part, file));
  }
  int unread = !file || ferror(file);
  if ((file && fclose(file) != 0) || unread) {
    perror(path);
    orb_buffer_free(ctx, &bytes);
    return 0;
  }
  int fine = status == ORB_OK && orb_mesh_read(ctx, bytes.data, bytes.size, ORB_FORMAT_AUTO, mesh, NULL) == ORB_OK &&
             orb_mesh_repair(ctx, mesh, ORB_REPAIR_SAFE) == ORB_OK && orb_embed(ctx, mesh, NULL, sphere) == ORB_OK;
  orb_buffer_free(ctx, &bytes);
  return fine || failed(ctx, path);
}

int main(int argc, char **argv) {
  static orb_context_options limits; /* 0: the default of each */
  static orb_mesh mesh[2];           /* zeroed: what no call has filled is safe to free */
  static orb_embedding sphere[2];
  static orb_merge_result merged;
  orb_merge_options options;
  orb_context *ctx;
  limits.memory_limit = (size_t)2 << 30;
  if (argc != 3 || orb_context_create(&limits, &ctx) != ORB_OK) {
    return 2;
  }
  orb_merge_defaults(&options);
  options.align.method = ORB_ALIGN_AUTO; /* without landmarks */
  int fine = load(ctx, argv[1], &mesh[0], &sphere[0]) && load(ctx, argv[2], &mesh[1], &sphere[1]);
  const orb_align_shape shapes[2] = {{&mesh[0], sphere[0].points}, {&mesh[1], sphere[1].points}};
  const char *names[2] = {argv[1], argv[2]};
  fine = fine && (orb_merge(ctx, shapes, names, 2, NULL, 0, &options, &merged) == ORB_OK || failed(ctx, "merge"));
  if (fine && (fwrite(merged.asset.data, 1, merged.asset.size, stdout) < merged.asset.size || fflush(stdout) != 0)) {
    perror("output");
    fine = 0;
  }
  for (int s = 0; s < 2; s++) {
    orb_embedding_free(ctx, &sphere[s]);
    orb_mesh_free(ctx, &mesh[s]);
  }
  orb_merge_result_free(ctx, &merged);
  orb_context_destroy(ctx);
  return fine ? 0 : 1;
}
