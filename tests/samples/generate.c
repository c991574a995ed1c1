/* Writes the samples, or checks the files in a folder against them.
 *
 *   orbmorph-samples DIR          writes them
 *   orbmorph-samples --check DIR  ends with 1 if a byte differs, and names the file
 *   orbmorph-samples --coarse DIR writes the same animals with a quarter of the triangles, for tests with sanitizers
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sample.h"

typedef struct made {
  const orb_animal *animal;
  orb_sample mesh;
} made;

/* Five decimals, and a zero without a sign, whatever the C library. */
static void print_number(FILE *file, double value) {
  long long scaled = (long long)(value < 0 ? value * 1e5 - 0.5 : value * 1e5 + 0.5);
  long long size = scaled < 0 ? -scaled : scaled;
  fprintf(file, "%s%lld.%05lld", scaled < 0 ? "-" : "", size / 100000, size % 100000);
}

static void print_positions(FILE *file, const orb_sample *mesh, const char *prefix) {
  for (int v = 0; v < mesh->vertex_count; v++) {
    fputs(prefix, file);
    for (int k = 0; k < 3; k++) {
      if (k)
        fputc(' ', file);
      print_number(file, mesh->positions[3 * v + k]);
    }
    fputc('\n', file);
  }
}

static void print_obj(FILE *file, const made *m, size_t count) {
  (void)count;
  fprintf(file, "# %s: %d vertices, %d triangles\n", m->animal->name, m->mesh.vertex_count, m->mesh.triangle_count);
  print_positions(file, &m->mesh, "v ");
  for (int t = 0; t < m->mesh.triangle_count; t++) {
    const int *v = &m->mesh.triangles[3 * t];
    fprintf(file, "f %d %d %d\n", v[0] + 1, v[1] + 1, v[2] + 1);
  }
}

static void print_faces(FILE *file, const made *m) {
  for (int t = 0; t < m->mesh.triangle_count; t++) {
    const int *v = &m->mesh.triangles[3 * t];
    fprintf(file, "3 %d %d %d\n", v[0], v[1], v[2]);
  }
}

static void print_off(FILE *file, const made *m, size_t count) {
  (void)count;
  fprintf(file, "OFF\n%d %d 0\n", m->mesh.vertex_count, m->mesh.triangle_count);
  print_positions(file, &m->mesh, "");
  print_faces(file, m);
}

static void print_ply(FILE *file, const made *m, size_t count) {
  (void)count;
  fprintf(file,
          "ply\nformat ascii 1.0\nelement vertex %d\nproperty double x\nproperty double y\nproperty double z\n"
          "element face %d\nproperty list uchar int vertex_indices\nend_header\n",
          m->mesh.vertex_count, m->mesh.triangle_count);
  print_positions(file, &m->mesh, "");
  print_faces(file, m);
}

/* The same features on each of `count` animals, in their order. */
static void print_landmarks(FILE *file, const made *m, size_t count) {
  fputs("{\"landmarks\": [\n", file);
  for (size_t i = 0; i < m->animal->feature_count; i++) {
    fprintf(file, "  {\"name\": \"%s\", \"at\": [", m->animal->features[i].name);
    for (size_t s = 0; s < count; s++)
      fprintf(file, "%s{\"vertex\": %d}", s ? ", " : "",
              sample_feature_vertex(m[s].animal, &m[s].mesh, &m[s].animal->features[i]));
    fprintf(file, "]}%s\n", i + 1 < m->animal->feature_count ? "," : "");
  }
  fputs("]}\n", file);
}

static char *read_whole(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  char *bytes = sample_alloc(1 << 22, 1);
  *size = file ? fread(bytes, 1, 1 << 22, file) : 0;
  if (file)
    fclose(file);
  return bytes;
}

static int put(const char *folder, const char *name, int check, const char *bytes, size_t size) {
  char path[4096];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  if (check) {
    size_t there_size;
    char *there = read_whole(path, &there_size);
    int same = there_size == size && memcmp(there, bytes, size) == 0;
    free(there);
    if (!same)
      fprintf(stderr, "%s is not what the generator writes\n", path);
    return !same;
  }
  FILE *file = fopen(path, "wb");
  int failed = !file || fwrite(bytes, 1, size, file) != size;
  if (file && fclose(file))
    failed = 1;
  if (failed)
    perror(path);
  return failed;
}

typedef void (*print_fn)(FILE *file, const made *m, size_t count);

static int emit(const char *folder, const char *name, int check, print_fn print, const made *m, size_t count) {
  char *bytes = NULL;
  size_t size = 0;
  FILE *file = open_memstream(&bytes, &size);
  if (!file)
    return 1;
  print(file, m, count);
  if (fclose(file))
    return 1;
  int failed = put(folder, name, check, bytes, size);
  free(bytes);
  return failed;
}

/* Features must lie on different vertices, or landmarks would contradict one another. */
static int faulty(const made *m) {
  const char *fault = sample_fault(&m->mesh);
  for (size_t i = 0; i < m->animal->feature_count && !fault; i++)
    for (size_t j = 0; j < i && !fault; j++)
      if (sample_feature_vertex(m->animal, &m->mesh, &m->animal->features[i]) ==
          sample_feature_vertex(m->animal, &m->mesh, &m->animal->features[j]))
        fault = m->animal->features[i].name;
  if (fault)
    fprintf(stderr, "%s: %s\n", m->animal->name, fault);
  return fault != NULL;
}

/* All files of the three animals: the dog, the giraffe, the elephant. */
static int emit_all(const char *folder, int check, const made m[3]) {
  made dog_elephant[2] = {m[0], m[2]};
  int failed = 0;
  failed |= emit(folder, "dog.obj", check, print_obj, &m[0], 1);
  failed |= emit(folder, "giraffe.off", check, print_off, &m[1], 1);
  failed |= emit(folder, "elephant.ply", check, print_ply, &m[2], 1);
  failed |= emit(folder, "dog-giraffe.json", check, print_landmarks, m, 2);
  failed |= emit(folder, "dog-elephant.json", check, print_landmarks, dog_elephant, 2);
  failed |= emit(folder, "dog-giraffe-elephant.json", check, print_landmarks, m, 3);
  return failed;
}

int main(int argc, char **argv) {
  int check = argc == 3 && !strcmp(argv[1], "--check"), coarse = argc == 3 && !strcmp(argv[1], "--coarse");
  if (argc != 2 + check + coarse) {
    fputs("usage: orbmorph-samples [--check | --coarse] DIR\n", stderr);
    return 2;
  }
  int share = coarse ? 4 : 1;
  const char *folder = argv[argc - 1];
  made m[3] = {{&sample_dog, {0}}, {&sample_giraffe, {0}}, {&sample_elephant, {0}}};
  sample_marching_tetrahedra(m[0].animal, 0.045, &m[0].mesh);
  sample_smooth(m[0].animal, &m[0].mesh, 8);
  sample_decimate(m[0].animal, &m[0].mesh, 1, 5600 / share);
  sample_smooth(m[0].animal, &m[0].mesh, 3);
  sample_surface_nets(m[1].animal, 0.0395, &m[1].mesh);
  sample_smooth(m[1].animal, &m[1].mesh, 2);
  sample_decimate(m[1].animal, &m[1].mesh, 3, 6000 / share);
  sample_marching_tetrahedra(m[2].animal, 0.050, &m[2].mesh);
  sample_smooth(m[2].animal, &m[2].mesh, 2);
  sample_decimate(m[2].animal, &m[2].mesh, 10, 5400 / share);
  sample_smooth(m[2].animal, &m[2].mesh, 1);
  int failed = 0;
  for (int i = 0; i < 3; i++)
    failed |= faulty(&m[i]);
  if (!failed)
    failed = emit_all(folder, check, m);
  for (int i = 0; i < 3; i++) {
    if (!check)
      printf("%s: %d vertices, %d triangles\n", m[i].animal->name, m[i].mesh.vertex_count, m[i].mesh.triangle_count);
    free(m[i].mesh.positions);
    free(m[i].mesh.triangles);
  }
  return failed;
}
