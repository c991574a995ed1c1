#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "bench.h"

int bench_slurp(const char *path, unsigned char **bytes, size_t *size) {
  *bytes = NULL;
  FILE *file = fopen(path, "rb");
  if (!file) {
    perror(path);
    return 0;
  }
  long end = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
  int fine = end >= 0 && fseek(file, 0, SEEK_SET) == 0;
  if (fine) {
    *size = (size_t)end;
    *bytes = malloc(*size + 1);
    fine = *bytes && fread(*bytes, 1, *size, file) == *size;
  }
  if (!fine) {
    fprintf(stderr, "%s: cannot be read\n", path);
    free(*bytes);
    *bytes = NULL;
  }
  fclose(file);
  return fine;
}

int bench_spill(const char *path, const unsigned char *bytes, size_t size) {
  FILE *file = fopen(path, "wb");
  if (!file) {
    perror(path);
    return 0;
  }
  int fine = fwrite(bytes, 1, size, file) == size;
  fine &= fclose(file) == 0;
  if (!fine) {
    perror(path);
  }
  return fine;
}

void bench_name_of(const char *path, char name[ORB_NAME_MAX]) {
  const char *base = strrchr(path, '/');
  snprintf(name, ORB_NAME_MAX, "%s", base ? base + 1 : path);
  char *dot = strrchr(name, '.');
  if (dot && dot != name) {
    *dot = 0;
  }
}

orb_context *bench_open(int threads, orb_cpu cpu) {
  orb_context *ctx;
  orb_context_options options = {.threads = threads, .cpu = cpu, .max_triangles = 50000000};
  if (orb_context_create(&options, &ctx) != ORB_OK) {
    fprintf(stderr, "orbmorph-bench: out of memory\n");
    exit(BENCH_REFUSED);
  }
  return ctx;
}

void bench_reset_peak(void) {
  FILE *file = fopen("/proc/self/clear_refs", "w");
  if (file) {
    fputs("5", file);
    fclose(file);
  }
}

int64_t bench_peak(void) {
  long long kibibytes = -1;
  char line[256];
  FILE *file = fopen("/proc/self/status", "r");
  while (file && kibibytes < 0 && fgets(line, sizeof line, file)) {
    if (sscanf(line, "VmHWM: %lld", &kibibytes) != 1) {
      kibibytes = -1;
    }
  }
  if (file) {
    fclose(file);
  }
  if (kibibytes < 0) {
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    kibibytes = usage.ru_maxrss;
  }
  return 1024 * kibibytes;
}

double bench_cpu(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void bench_complain(const char *path, const orb_context *ctx) {
  const orb_error *error = orb_context_error(ctx);
  fprintf(stderr, "%s: %s: %s\n", path, orb_status_name(error->status), error->detail);
}

int bench_print(api_text *line) {
  int fine = !line->failed && line->data;
  if (fine) {
    fine = puts(line->data) >= 0 && fflush(stdout) == 0;
  }
  if (!fine) {
    fprintf(stderr, "orbmorph-bench: the result could not be written\n");
  }
  api_text_free(line);
  return fine;
}

static orb_status note_corners(orb_context *ctx, bench_mesh *out) {
  size_t count = 0;
  for (int32_t t = 0; t < out->mesh.triangle_count; t++) {
    int32_t number = out->mesh.source_triangle[t];
    count = number >= 0 && (size_t)number >= count ? (size_t)number + 1 : count;
  }
  out->raw_corners = orb_alloc(ctx, 3 * count, sizeof *out->raw_corners);
  if (!out->raw_corners) {
    return ORB_E_NO_MEMORY;
  }
  out->raw_triangle_count = (int32_t)count;
  memset(out->raw_corners, 0xff, 3 * count * sizeof(int32_t));
  for (int32_t h = 0; h < 3 * out->mesh.triangle_count; h++) {
    int32_t number = out->mesh.source_triangle[h / 3];
    if (number >= 0) {
      out->raw_corners[3 * number + h % 3] = out->mesh.source[out->mesh.triangles[h]];
    }
  }
  return ORB_OK;
}

int bench_load(orb_context *ctx, const char *path, orb_repair_options repair, int keep_corners, bench_mesh *out) {
  memset(out, 0, sizeof *out);
  bench_name_of(path, out->name);
  unsigned char *bytes;
  size_t size;
  double start = orb_clock();
  if (!bench_slurp(path, &bytes, &size)) {
    return 0;
  }
  orb_status status = orb_mesh_read(ctx, bytes, size, ORB_FORMAT_AUTO, &out->mesh, NULL);
  free(bytes);
  out->read_seconds = orb_clock() - start;
  if (status == ORB_OK && keep_corners) {
    status = note_corners(ctx, out);
  }
  start = orb_clock();
  if (status == ORB_OK) {
    status = orb_mesh_repair_with(ctx, &out->mesh, &repair);
  }
  out->check_seconds = orb_clock() - start;
  if (status != ORB_OK) {
    bench_complain(path, ctx);
    bench_unload(ctx, out);
  }
  return status == ORB_OK;
}

void bench_unload(orb_context *ctx, bench_mesh *mesh) {
  orb_free(ctx, mesh->raw_corners);
  orb_mesh_free(ctx, &mesh->mesh);
  mesh->raw_corners = NULL;
}
