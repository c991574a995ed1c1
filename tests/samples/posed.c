/* Writes posed bodies with true correspondences into a folder.
 *
 *   orbmorph-posed DIR          writes samples.csv, pairs.csv (animals) and plans.csv (other plans)
 *
 *   orbmorph-posed DIR BODY...  writes BODY.obj and BODY.truth.csv
 *
 * A body is KIND-POSE or KIND-VARIANT-POSE. Its vertices and triangles are shuffled; some bodies are turned, and some
 * have other units. All that follows from the name: the files are the same on each run.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "posed.h"
#include "primitives.h"

typedef struct pair {
  const char *first, *second, *kind;
} pair;

#define POSES "same kind, other pose"
#define PROPORTIONS "same kind, other proportions"
#define KINDS "other kind"
#define ANIMAL_PAIRS(kind)                                                                                       \
  {kind "-stand", kind "-run", POSES}, {kind "-walk", kind "-turn", POSES}, {kind "-graze", kind "-sit", POSES}, \
      {kind "-stand", kind "-slim-walk", PROPORTIONS}, {                                                         \
    kind "-stout-lift", kind "-run", PROPORTIONS                                                                 \
  }

static const pair pairs[] = {
    ANIMAL_PAIRS("dog"),
    ANIMAL_PAIRS("giraffe"),
    ANIMAL_PAIRS("elephant"),
    ANIMAL_PAIRS("horse"),
    ANIMAL_PAIRS("cow"),
    ANIMAL_PAIRS("cat"),
    ANIMAL_PAIRS("person"),
    {"dog-stand", "giraffe-stand", KINDS},
    {"dog-walk", "elephant-stand", KINDS},
    {"giraffe-walk", "elephant-walk", KINDS},
    {"person-stand", "dog-stand", KINDS},
    {"person-walk", "elephant-stand", KINDS},
    {"person-stand", "giraffe-walk", KINDS},
    {"person-stand", "cow-stand", KINDS},
    {"horse-stand", "cow-stand", KINDS},
    {"horse-run", "cow-walk", KINDS},
    {"horse-walk", "giraffe-walk", KINDS},
    {"horse-run", "dog-run", KINDS},
    {"horse-stand", "dog-slim-walk", KINDS},
    {"cat-stand", "elephant-stand", KINDS},
    {"cat-walk", "elephant-walk", KINDS},
    {"cat-stand", "horse-stand", KINDS},
    {"cat-turn", "dog-walk", KINDS},
    {"cow-graze", "giraffe-stand", KINDS},
    {"cow-stand", "elephant-stand", KINDS},
    {"head-stand", "bust-stand", KINDS},
    {"head-nod", "bust-look", KINDS},
    {"head-slim-stand", "bust-stout-stand", KINDS},
};
#define PLAN_PAIRS(kind, one, two, three)                                                                          \
  {kind "-stand", kind "-" one, POSES}, {kind "-" two, kind "-stand", POSES}, {kind "-" one, kind "-" two, POSES}, \
      {kind "-" three, kind "-" one, POSES}, {kind "-stand", kind "-slim-" two, PROPORTIONS}, {                    \
    kind "-stout-" three, kind "-" one, PROPORTIONS                                                                \
  }

static const pair plans[] = {
    PLAN_PAIRS("spider", "creep", "rear", "curl"), PLAN_PAIRS("beetle", "creep", "rear", "curl"),
    PLAN_PAIRS("hand", "grip", "splay", "point"),  PLAN_PAIRS("bird", "fly", "glide", "perch"),
    PLAN_PAIRS("lizard", "bend", "crawl", "walk"), PLAN_PAIRS("fish", "swim", "dart", "turn"),
    PLAN_PAIRS("centaur", "run", "rear", "turn"),
};

static FILE *open_file(const char *folder, const char *name, const char *ending) {
  char path[4096];
  snprintf(path, sizeof path, "%s/%s%s", folder, name, ending);
  FILE *file = fopen(path, "w");
  if (!file) {
    perror(path);
    exit(1);
  }
  return file;
}

static void close_file(FILE *file) {
  if (ferror(file) || fclose(file)) {
    fputs("a file cannot be written\n", stderr);
    exit(1);
  }
}

/* A permutation of 0 … count − 1. */
static int *shuffled(int count, unsigned *seed) {
  int *order = sample_alloc((size_t)count, sizeof(int));
  for (int i = 0; i < count; i++)
    order[i] = i;
  for (int i = count - 1; i > 0; i--) {
    const int j = (int)posed_random(seed, (unsigned)i + 1), kept = order[i];
    order[i] = order[j];
    order[j] = kept;
  }
  return order;
}

/* The rows of a rotation: none for a third of the bodies, about the vertical for a third, any for the others. */
static void draw_turn(unsigned *seed, double row[3][3]) {
  const unsigned kind = posed_random(seed, 3);
  double q[4] = {1, 0, 0, 0}, norm = 0;
  for (int k = 0; k < 4 && kind; k++)
    q[k] = kind == 1 && k % 2 ? 0 : (double)posed_random(seed, 2001) / 1000 - 1.0005;
  for (int k = 0; k < 4; k++)
    norm += q[k] * q[k];
  const double w = q[0], x = q[1], y = q[2], z = q[3], s = 2 / norm;
  const double rows[3][3] = {{1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
                             {s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)},
                             {s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)}};
  memcpy(row, rows, sizeof rows);
}

static void write_body(const char *folder, const char *name, const orb_sample *mesh, const posed_place *places,
                       unsigned *seed) {
  static const double units[] = {1, 1, 10, 100};
  double row[3][3];
  draw_turn(seed, row);
  const double unit = units[posed_random(seed, 4)];
  int *vertices = shuffled(mesh->vertex_count, seed), *triangles = shuffled(mesh->triangle_count, seed);
  int *vertex_row = sample_alloc((size_t)mesh->vertex_count, sizeof(int));
  int *triangle_row = sample_alloc((size_t)mesh->triangle_count, sizeof(int));
  FILE *file = open_file(folder, name, ".obj");
  for (int i = 0; i < mesh->vertex_count; i++) {
    const double *p = &mesh->positions[3 * vertices[i]];
    vertex_row[vertices[i]] = i;
    fputc('v', file);
    for (int k = 0; k < 3; k++)
      fprintf(file, " %.6f", unit * (row[k][0] * p[0] + row[k][1] * p[1] + row[k][2] * p[2]));
    fputc('\n', file);
  }
  for (int i = 0; i < mesh->triangle_count; i++) {
    const int *v = &mesh->triangles[3 * triangles[i]];
    triangle_row[triangles[i]] = i;
    fprintf(file, "f %d %d %d\n", vertex_row[v[0]] + 1, vertex_row[v[1]] + 1, vertex_row[v[2]] + 1);
  }
  close_file(file);
  file = open_file(folder, name, ".truth.csv");
  fputs("sample,triangle,b0,b1,b2\n", file);
  for (int i = 0; i < posed_sample_count(); i++)
    if (places[i].triangle >= 0)
      fprintf(file, "%d,%d,%.5f,%.5f,%.5f\n", i, triangle_row[places[i].triangle], places[i].at[0], places[i].at[1],
              places[i].at[2]);
  close_file(file);
  free(vertices);
  free(triangles);
  free(vertex_row);
  free(triangle_row);
}

static void make_body(const char *folder, const char *name) {
  char kind[64], *pose, *variant = "";
  unsigned seed = 2166136261u;
  for (const char *at = name; *at; at++)
    seed = (seed ^ (unsigned char)*at) * 16777619u;
  snprintf(kind, sizeof kind, "%s", name);
  pose = strrchr(kind, '-');
  *pose++ = 0;
  char *middle = strchr(kind, '-');
  if (middle) {
    *middle = 0;
    variant = middle + 1;
  }
  posed_rest rest;
  const posed_kind *found = posed_find(kind);
  if (!found) {
    fprintf(stderr, "there is no kind '%s'\n", kind);
    exit(1);
  }
  posed_proportion(found, variant, &rest);
  orb_sample mesh;
  posed_polygonise(&rest, seed, &mesh);
  posed_place *places = sample_alloc((size_t)posed_sample_count(), sizeof *places);
  posed_find_places(&rest, &mesh, places);
  posed_skin(&rest, pose, &mesh);
  write_body(folder, name, &mesh, places, &seed);
  printf("%s: %d triangles\n", name, mesh.triangle_count);
  free(places);
  free(mesh.positions);
  free(mesh.triangles);
}

static void write_pairs(const char *folder, const char *name, const pair *rows, size_t count) {
  FILE *file = open_file(folder, name, ".csv");
  fputs("A,B,kind\n", file);
  for (size_t i = 0; i < count; i++)
    fprintf(file, "%s.obj,%s.obj,\"%s\"\n", rows[i].first, rows[i].second, rows[i].kind);
  close_file(file);
}

static void write_tables(const char *folder) {
  FILE *file = open_file(folder, "samples", ".csv");
  fputs("sample,part\n", file);
  for (int i = 0; i < posed_sample_count(); i++)
    fprintf(file, "%d,%s\n", i, posed_sample_part(i));
  close_file(file);
  write_pairs(folder, "pairs", pairs, COUNT(pairs));
  write_pairs(folder, "plans", plans, COUNT(plans));
}

int main(int argc, char **argv) {
  if (argc < 2) {
    fputs("usage: orbmorph-posed DIR [BODY...]\n", stderr);
    return 2;
  }
  if (argc == 2)
    write_tables(argv[1]);
  for (int i = 2; i < argc; i++)
    make_body(argv[1], argv[i]);
  return 0;
}
