/* Writes an asset in the other profiles and measures them.
 *
 *     bench-profile FILE.glb [OUT]
 *
 * Prints a line of JSON for each profile: bytes, milliseconds of processor time, bytes of memory and bounds. With OUT
 * also writes OUT.PROFILE.glb. */
#include <stdio.h>
#include <stdlib.h>

#include "bench.h"
#include "orbmorph/profile.h"

static int measure(const unsigned char *asset, size_t size, orb_profile profile, const char *out) {
  orb_context *ctx = bench_open(1, ORB_CPU_AUTO);
  orb_profile_facts facts;
  orb_buffer bytes = {0};
  double began = bench_cpu();
  int fine = orb_profile_write(ctx, asset, size, profile, &facts, &bytes) == ORB_OK;
  double seconds = bench_cpu() - began;
  if (!fine) {
    bench_complain("profile", ctx);
  }
  if (fine) {
    printf(
        "{\"profile\":\"%s\",\"bytes\":%zu,\"float_bytes\":%zu,\"cpu_ms\":%.3f,\"peak_bytes\":%zu,"
        "\"position_relative\":%.9g,\"normal_degrees\":%.9g}\n",
        orb_profile_name(profile), bytes.size, size, 1e3 * seconds, orb_memory_peak(ctx), facts.position_relative,
        facts.normal_degrees);
  }
  if (fine && out) {
    char path[4096];
    snprintf(path, sizeof path, "%s.%s.glb", out, orb_profile_name(profile));
    fine = bench_spill(path, bytes.data, bytes.size);
  }
  orb_buffer_free(ctx, &bytes);
  orb_context_destroy(ctx);
  return fine;
}

int main(int argc, char **argv) {
  unsigned char *asset;
  size_t size;
  int fine = 1;
  if (argc < 2 || argc > 3) {
    fputs("usage: bench-profile FILE.glb [OUT]\n", stderr);
    return BENCH_USAGE;
  }
  if (!bench_slurp(argv[1], &asset, &size)) {
    return BENCH_REFUSED;
  }
  for (int p = ORB_PROFILE_QUANTIZED; fine && p < ORB_PROFILES; p++) {
    fine = measure(asset, size, (orb_profile)p, argc > 2 ? argv[2] : NULL);
  }
  free(asset);
  return fine ? BENCH_DONE : BENCH_REFUSED;
}
