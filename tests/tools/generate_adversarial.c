/* generate-adversarial KIND SEED TRIANGLES FILE.off: writes one mesh; without arguments lists the kinds. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "adversarial.h"

static int write_off(const adversarial_mesh *m, const char *path) {
  FILE *file = fopen(path, "w");
  if (!file) {
    perror(path);
    return 1;
  }
  fprintf(file, "OFF\n%d %d 0\n", m->vertex_count, m->triangle_count);
  for (int32_t v = 0; v < m->vertex_count; v++) {
    const double *p = m->positions + 3 * (size_t)v;
    fprintf(file, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
  }
  for (int32_t t = 0; t < m->triangle_count; t++) {
    const int32_t *c = m->triangles + 3 * (size_t)t;
    fprintf(file, "3 %d %d %d\n", c[0], c[1], c[2]);
  }
  if (fclose(file) != 0) {
    perror(path);
    return 1;
  }
  return 0;
}

int main(int argc, char **argv) {
  if (argc != 5) {
    fprintf(stderr, "usage: generate-adversarial KIND SEED TRIANGLES FILE.off\nkinds:");
    for (int k = 0; k < ADV_KIND_COUNT; k++) {
      fprintf(stderr, " %s", adversarial_name((adversarial_kind)k));
    }
    fprintf(stderr, "\n");
    return 2;
  }
  for (int k = 0; k < ADV_KIND_COUNT; k++) {
    if (strcmp(argv[1], adversarial_name((adversarial_kind)k)) == 0) {
      adversarial_mesh m = adversarial_make((adversarial_kind)k, strtoull(argv[2], NULL, 10), atoi(argv[3]));
      int failed = write_off(&m, argv[4]);
      adversarial_free(&m);
      return failed;
    }
  }
  fprintf(stderr, "generate-adversarial: no kind '%s'\n", argv[1]);
  return 2;
}
