/* bench-cancel [--method M] [--threads N] [--cancels N] FILE...: measures how long an embedding keeps running after it
 * is cancelled. Embeds each mesh once, then N more times, each cancelled at a different moment, spread evenly over the
 * duration of the first run. Prints one JSON object per mesh: the mean and the longest delay, in milliseconds of wall
 * and processor time. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench.h"

typedef struct run {
  orb_context *ctx;
  const orb_mesh *mesh;
  const orb_embed_options *options;
  orb_status status;
  double ended, cpu;
} run;

static void *embed(void *argument) {
  run *r = argument;
  orb_embedding out;
  r->status = orb_embed(r->ctx, r->mesh, r->options, &out);
  r->ended = orb_clock();
  r->cpu = bench_cpu();
  if (r->status == ORB_OK) {
    orb_embedding_free(r->ctx, &out);
  }
  return NULL;
}

/* Embeds and cancels after `wait` seconds. The delays are in seconds, 0 if the embedding had already finished. */
static int cancel_at(const orb_mesh *mesh, const orb_embed_options *options, int threads, double wait, double *delay,
                     double *cpu) {
  run r = {.ctx = bench_open(threads, ORB_CPU_AUTO), .mesh = mesh, .options = options};
  pthread_t thread;
  *delay = *cpu = 0;
  if (pthread_create(&thread, NULL, embed, &r) != 0) {
    orb_context_destroy(r.ctx);
    return 0;
  }
  struct timespec pause = {.tv_sec = (time_t)wait, .tv_nsec = (long)(1e9 * (wait - (double)(time_t)wait))};
  nanosleep(&pause, NULL);
  double began = orb_clock(), cpu_began = bench_cpu();
  orb_context_cancel(r.ctx);
  pthread_join(thread, NULL);
  if (r.status == ORB_E_CANCELLED) {
    *delay = r.ended - began;
    *cpu = r.cpu - cpu_began;
  }
  orb_context_destroy(r.ctx);
  return 1;
}

static int measure(const char *path, const orb_embed_options *options, const char *method, int threads, int cancels) {
  orb_context *ctx = bench_open(threads, ORB_CPU_AUTO);
  bench_mesh m;
  if (!bench_load(ctx, path, (orb_repair_options){.repair = ORB_REPAIR_SAFE}, 0, &m)) {
    orb_context_destroy(ctx);
    return 0;
  }
  orb_embedding whole;
  double start = orb_clock(), longest = 0, longest_cpu = 0, sum = 0, at = 0;
  int fine = orb_embed(ctx, &m.mesh, options, &whole) == ORB_OK, caught = 0;
  double seconds = orb_clock() - start;
  if (fine) {
    orb_embedding_free(ctx, &whole);
  } else {
    bench_complain(path, ctx);
  }
  for (int i = 0; fine && i < cancels; i++) {
    double delay, cpu, wait = seconds * (i + 0.5) / cancels;
    fine = cancel_at(&m.mesh, options, threads, wait, &delay, &cpu);
    caught += delay > 0;
    sum += delay;
    at = delay > longest ? wait / seconds : at;
    longest = delay > longest ? delay : longest;
    longest_cpu = cpu > longest_cpu ? cpu : longest_cpu;
  }
  if (fine) {
    printf(
        "{\"mesh\":\"%s\",\"triangles\":%d,\"method\":\"%s\",\"threads\":%d,\"seconds\":%.3f,\"cancelled\":%d,"
        "\"mean_ms\":%.1f,\"longest_ms\":%.1f,\"longest_cpu_ms\":%.1f,\"longest_at\":%.3f}\n",
        m.name, m.mesh.triangle_count, method, threads, seconds, caught, caught ? 1e3 * sum / caught : 0, 1e3 * longest,
        1e3 * longest_cpu, at);
  }
  bench_unload(ctx, &m);
  orb_context_destroy(ctx);
  return fine;
}

int main(int argc, char **argv) {
  orb_embed_options options;
  const char *method = "newton";
  int threads = 1, cancels = 20, i = 1, refused = 0;
  orb_embed_defaults(&options);
  for (; i + 1 < argc && strncmp(argv[i], "--", 2) == 0; i += 2) {
    if (strcmp(argv[i], "--method") == 0) {
      method = argv[i + 1];
      options.method = strcmp(method, "kernel-sampling") == 0 ? ORB_EMBED_KERNEL_SAMPLING : ORB_EMBED_NEWTON;
    } else if (strcmp(argv[i], "--threads") == 0) {
      threads = atoi(argv[i + 1]);
    } else if (strcmp(argv[i], "--cancels") == 0) {
      cancels = atoi(argv[i + 1]);
    }
  }
  if (i >= argc) {
    fprintf(stderr, "usage: bench-cancel [--method M] [--threads N] [--cancels N] FILE...\n");
    return BENCH_USAGE;
  }
  for (; i < argc; i++) {
    refused |= !measure(argv[i], &options, method, threads, cancels);
  }
  return refused ? BENCH_REFUSED : BENCH_DONE;
}
