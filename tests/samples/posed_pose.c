/* Poses: bones rotate about their joints, and the skin follows by linear blend skinning. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "posed.h"
#include "primitives.h"

enum { X, Y, Z }; /* about the right (Z) a limb below swings forward; about up (Y) what is ahead swings to the left */

/* A rotation of the bones of a limb relative to their parents. */
typedef struct turn {
  const char *pose;
  posed_limb limb;
  int axis;
  int every;   /* each bone of the limb rotates, else only the first one */
  double half; /* the tangent of half the angle */
} turn;

#define D10 0.0875
#define D15 0.1317
#define D20 0.1763
#define D30 0.2679
#define D40 0.3640
#define D50 0.4663
#define D60 0.5774
#define D80 0.8391

static const turn animal_turns[] = {
    {"walk", FRU, Z, 0, D20},    {"walk", FRL, Z, 0, -D15},   {"walk", FLU, Z, 0, -D20},    {"walk", HRU, Z, 0, -D20},
    {"walk", HLU, Z, 0, D20},    {"walk", HLL, Z, 0, -D15},   {"walk", TAIL, Z, 1, D10},    {"walk", NECK, Z, 0, -D10},
    {"walk", SNOUT, Z, 1, D10},  {"run", FRU, Z, 0, D50},     {"run", FRL, Z, 0, -D40},     {"run", FLU, Z, 0, D30},
    {"run", FLL, Z, 0, D10},     {"run", HRU, Z, 0, -D40},    {"run", HLU, Z, 0, -D30},     {"run", HLL, Z, 0, D20},
    {"run", NECK, Z, 0, -D20},   {"run", HEAD, Z, 0, D15},    {"run", TAIL, Z, 1, -D15},    {"run", TORSO, Z, 1, D10},
    {"graze", NECK, Z, 0, -D60}, {"graze", HEAD, Z, 0, -D20}, {"graze", SNOUT, Z, 0, -D15}, {"graze", FLU, Z, 0, D15},
    {"graze", HRU, Z, 0, D10},   {"graze", EAR_R, X, 0, D15}, {"graze", TAIL, Y, 1, D15},   {"turn", NECK, Y, 0, D40},
    {"turn", HEAD, Y, 0, D20},   {"turn", TAIL, Y, 1, D20},   {"turn", TORSO, Y, 1, D10},   {"turn", FRU, X, 0, D10},
    {"turn", FLU, Z, 0, D15},    {"turn", HRU, X, 0, D10},    {"turn", SNOUT, Y, 1, D10},   {"sit", HRU, Z, 0, D60},
    {"sit", HLU, Z, 0, D60},     {"sit", HRL, Z, 0, -D80},    {"sit", HLL, Z, 0, -D80},     {"sit", HRC, Z, 0, D60},
    {"sit", HLC, Z, 0, D60},     {"sit", FRU, Z, 0, D15},     {"sit", FLU, Z, 0, D15},      {"sit", NECK, Z, 0, D15},
    {"sit", TAIL, Y, 1, -D15},   {"lift", FRU, Z, 0, D60},    {"lift", FRL, Z, 0, -D80},    {"lift", HEAD, Y, 0, -D20},
    {"lift", HLU, Z, 0, -D15},   {"lift", TAIL, Z, 1, -D20},  {"nod", FACE, Z, 0, -D20},    {"look", FACE, Y, 0, D30},
};

/* Of kinds of other plans. */
static const turn plan_turns[] = {
    {"creep", LIMB_A, Y, 0, D15},  {"creep", LIMB_B, Y, 0, -D15}, {"creep", LIMB_B, X, 0, -D20},
    {"creep", LIMB_C, Y, 0, D15},  {"creep", LIMB_D, Y, 0, -D15}, {"creep", LIMB_D, X, 0, -D20},
    {"creep", LIMB_E, Y, 0, D15},  {"creep", LIMB_E, X, 0, D20},  {"creep", LIMB_F, Y, 0, -D15},
    {"creep", LIMB_G, Y, 0, D15},  {"creep", LIMB_G, X, 0, D20},  {"creep", LIMB_H, Y, 0, -D15},
    {"rear", LIMB_A, X, 0, -D40},  {"rear", LIMB_E, X, 0, D40},   {"rear", LIMB_B, X, 0, -D20},
    {"rear", LIMB_F, X, 0, D20},   {"rear", TAIL, Z, 0, D20},     {"rear", TORSO, Z, 0, D15},
    {"curl", LIMB_A, X, 1, D20},   {"curl", LIMB_B, X, 1, D20},   {"curl", LIMB_C, X, 1, D20},
    {"curl", LIMB_D, X, 1, D20},   {"curl", LIMB_E, X, 1, -D20},  {"curl", LIMB_F, X, 1, -D20},
    {"curl", LIMB_G, X, 1, -D20},  {"curl", LIMB_H, X, 1, -D20},  {"grip", LIMB_B, Z, 1, -D30},
    {"grip", LIMB_C, Z, 1, -D30},  {"grip", LIMB_D, Z, 1, -D30},  {"grip", LIMB_E, Z, 1, -D30},
    {"grip", LIMB_A, Z, 1, -D20},  {"point", LIMB_C, Z, 1, -D50}, {"point", LIMB_D, Z, 1, -D50},
    {"point", LIMB_E, Z, 1, -D50}, {"point", LIMB_A, Z, 1, -D15}, {"splay", LIMB_A, X, 0, D20},
    {"splay", LIMB_B, X, 0, D15},  {"splay", LIMB_D, X, 0, -D10}, {"splay", LIMB_E, X, 0, -D20},
    {"fly", LIMB_A, X, 1, -D15},   {"fly", LIMB_E, X, 1, D15},    {"fly", HRU, Z, 0, -D40},
    {"fly", HLU, Z, 0, -D40},      {"fly", TAIL, Z, 1, D10},      {"glide", LIMB_A, Y, 1, -D20},
    {"glide", LIMB_E, Y, 1, D20},  {"glide", HRU, Z, 0, -D60},    {"glide", HLU, Z, 0, -D60},
    {"glide", NECK, Z, 0, -D30},   {"perch", LIMB_A, Y, 0, -D60}, {"perch", LIMB_E, Y, 0, D60},
    {"perch", NECK, Y, 0, D40},    {"perch", HEAD, Y, 0, D20},    {"perch", HRL, Z, 0, -D30},
    {"perch", HLL, Z, 0, -D30},    {"bend", TORSO, Y, 1, D15},    {"bend", TAIL, Y, 1, -D20},
    {"bend", NECK, Y, 0, D30},     {"bend", FRU, Y, 0, D20},      {"bend", HLU, Y, 0, D20},
    {"crawl", FRU, Y, 0, D30},     {"crawl", FLU, Y, 0, D30},     {"crawl", HRU, Y, 0, -D30},
    {"crawl", HLU, Y, 0, -D30},    {"crawl", TAIL, Y, 1, D15},    {"crawl", TORSO, Y, 1, -D10},
    {"swim", TORSO, Y, 1, D15},    {"swim", TAIL, Y, 1, D30},     {"swim", LIMB_D, X, 0, D30},
    {"swim", LIMB_E, X, 0, -D20},  {"dart", TORSO, Y, 1, -D10},   {"dart", TAIL, Y, 1, -D20},
    {"dart", LIMB_D, Y, 0, -D30},  {"dart", LIMB_E, Y, 0, D30},   {"dart", LIMB_C, Z, 0, D20},
};

static const struct {
  const turn *turn;
  size_t count;
} tables[] = {{animal_turns, COUNT(animal_turns)}, {plan_turns, COUNT(plan_turns)}};

/* A rotation and a translation: the rows of the matrix, then the translation. */
typedef struct motion {
  double row[3][3], move[3];
} motion;

static void apply(const motion *m, const double p[3], double out[3]) {
  double q[3];
  for (int k = 0; k < 3; k++)
    q[k] = m->row[k][0] * p[0] + m->row[k][1] * p[1] + m->row[k][2] * p[2] + m->move[k];
  memcpy(out, q, sizeof q);
}

/* first, then about the point p by an axis and the tangent of half the angle. */
static motion turned(const motion *first, const double p[3], int axis, double half) {
  const double cosine = (1 - half * half) / (1 + half * half), sine = 2 * half / (1 + half * half);
  motion own = {{{0}}, {0}}, out;
  const int u = (axis + 1) % 3, w = (axis + 2) % 3;
  own.row[axis][axis] = 1;
  own.row[u][u] = own.row[w][w] = cosine;
  own.row[u][w] = -sine;
  own.row[w][u] = sine;
  double stays[3];
  apply(&own, p, stays);
  for (int k = 0; k < 3; k++)
    own.move[k] = p[k] - stays[k];
  for (int k = 0; k < 3; k++)
    for (int j = 0; j < 3; j++)
      out.row[k][j] =
          first->row[k][0] * own.row[0][j] + first->row[k][1] * own.row[1][j] + first->row[k][2] * own.row[2][j];
  apply(first, own.move, out.move);
  return out;
}

static int is_pose(const char *pose) {
  int known = !strcmp(pose, "stand");
  for (size_t k = 0; k < COUNT(tables); k++)
    for (size_t t = 0; t < tables[k].count; t++)
      known |= !strcmp(tables[k].turn[t].pose, pose);
  return known;
}

static void move_bones(const posed_rest *rest, const char *pose, motion *of) {
  const motion still = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};
  const posed_bone *bones = rest->kind->bones;
  if (!is_pose(pose)) {
    fprintf(stderr, "there is no pose '%s'\n", pose);
    exit(1);
  }
  for (size_t i = 0; i < rest->animal.primitive_count; i++) {
    const int parent = bones[i].parent, is_first = parent < 0 || bones[parent].limb != bones[i].limb;
    of[i] = parent < 0 ? still : of[parent];
    for (size_t k = 0; k < COUNT(tables); k++)
      for (size_t t = 0; t < tables[k].count; t++) {
        const turn *one = &tables[k].turn[t];
        if (!strcmp(one->pose, pose) && one->limb == bones[i].limb && (is_first || one->every))
          of[i] = turned(&of[i], rest->primitives[i].a, one->axis, one->half);
      }
  }
}

/* How many bones lie between two bones, at most 3. */
static int steps_between(const posed_bone *bones, int a, int b) {
  int steps = 0;
  while (a != b && steps < 3) { /* a parent has the smaller number */
    if (a > b)
      a = bones[a].parent;
    else
      b = bones[b].parent;
    steps++;
  }
  return steps;
}

void posed_skin(const posed_rest *rest, const char *pose, orb_sample *mesh) {
  const double reach = 0.10; /* the distance over which the skin changes from one bone to the next */
  motion of[POSED_BONES];
  move_bones(rest, pose, of);
  const int count = (int)rest->animal.primitive_count;
  for (int v = 0; v < mesh->vertex_count; v++) {
    double *p = &mesh->positions[3 * v], distance[POSED_BONES], sum[3] = {0, 0, 0}, whole = 0;
    int nearest = 0;
    for (int i = 0; i < count; i++) {
      distance[i] = sample_distance(&rest->primitives[i], p);
      nearest = distance[i] < distance[nearest] ? i : nearest;
    }
    for (int i = 0; i < count; i++) {
      double q[3], weight = 1 - (distance[i] - distance[nearest]) / reach;
      if (weight <= 0 || steps_between(rest->kind->bones, i, nearest) > 2)
        continue;
      weight *= weight;
      apply(&of[i], p, q);
      for (int k = 0; k < 3; k++)
        sum[k] += weight * q[k];
      whole += weight;
    }
    for (int k = 0; k < 3; k++)
      p[k] = sum[k] / whole;
  }
}
