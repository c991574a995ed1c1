#include "support_handles.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "numeric/vec3.h"

enum { APART = 6, RINGS = 3, FACES_MOST = 4096 };

typedef struct stitch {
  const orb_mesh *mesh;
  int32_t *first, *list;  /* faces of each vertex */
  unsigned char *used;    /* vertices in reach of a tube */
  unsigned char *dropped; /* faces */
  int32_t *rings, *seen;  /* of faces: distance from the first face of a tube, and for which tube that was set */
  double (*point)[3];
  int32_t (*face)[3];
  int points, faces;
  uint64_t random;
} stitch;

static uint32_t draw(stitch *s) {
  s->random = s->random * 6364136223846793005u + 1442695040888963407u;
  return (uint32_t)(s->random >> 33);
}

static void list_faces(stitch *s) {
  const orb_mesh *m = s->mesh;
  for (int32_t h = 0; h < 3 * m->triangle_count; h++) {
    s->first[m->triangles[h] + 2]++;
  }
  for (int32_t v = 0; v < m->vertex_count; v++) {
    s->first[v + 2] += s->first[v + 1];
  }
  for (int32_t h = 0; h < 3 * m->triangle_count; h++) {
    s->list[s->first[m->triangles[h] + 1]++] = h / 3;
  }
}

static int is_free(const stitch *s, int32_t t) {
  const int32_t *c = s->mesh->triangles + 3 * t;
  return !s->used[c[0]] && !s->used[c[1]] && !s->used[c[2]];
}

/* Which corner of b faces corner 0 of a in a mirror between both; −1 where b is not close to the mirror image of a, so
 * that a tube between them would be twisted. */
static int mirrored(const stitch *s, int32_t a, int32_t b) {
  const double *p = s->mesh->positions;
  const int32_t *from = s->mesh->triangles + 3 * a, *to = s->mesh->triangles + 3 * b;
  double axis[3] = {0, 0, 0}, middle[3] = {0, 0, 0}, least = INFINITY;
  int turn = -1;
  for (int i = 0; i < 3; i++) {
    for (int d = 0; d < 3; d++) {
      axis[d] += p[3 * to[i] + d] - p[3 * from[i] + d];
      middle[d] += (p[3 * to[i] + d] + p[3 * from[i] + d]) / 6;
    }
  }
  double edge2 = orb_distance2(p + 3 * from[0], p + 3 * from[1]), size = orb_length(axis);
  for (int r = 0; r < 3; r++) { /* the rim of b runs the other way */
    double worst = 0;
    for (int i = 0; i < 3; i++) {
      double out[3], image[3];
      orb_sub(p + 3 * from[i], middle, out);
      double along = 2 * orb_dot(out, axis) / (size * size);
      for (int d = 0; d < 3; d++) {
        image[d] = p[3 * from[i] + d] - along * axis[d];
      }
      worst = fmax(worst, orb_distance2(image, p + 3 * to[(r + 3 - i) % 3]));
    }
    if (worst < least) {
      least = worst;
      turn = r;
    }
  }
  return least < 0.1 * edge2 ? turn : -1;
}

/* A free face APART rings from t for a tube, or −1; marks the vertices between them as used if there is one. */
static int32_t partner(stitch *s, int32_t t, int32_t number) {
  static int32_t queue[FACES_MOST];
  int32_t head = 0, tail = 0, found = -1;
  queue[tail++] = t;
  s->rings[t] = 0;
  s->seen[t] = number;
  while (head < tail && found < 0) {
    int32_t f = queue[head++];
    if (!is_free(s, f)) {
      continue;
    }
    if (s->rings[f] == APART) {
      found = mirrored(s, t, f) >= 0 ? f : -1;
      continue;
    }
    for (int k = 0; k < 3; k++) {
      int32_t v = s->mesh->triangles[3 * f + k];
      for (int32_t i = s->first[v]; i < s->first[v + 1]; i++) {
        int32_t g = s->list[i];
        if (s->seen[g] != number && tail < FACES_MOST) {
          s->seen[g] = number;
          s->rings[g] = s->rings[f] + 1;
          queue[tail++] = g;
        }
      }
    }
  }
  for (int32_t i = 0; i < tail && found >= 0; i++) {
    for (int k = 0; k < 3; k++) {
      s->used[s->mesh->triangles[3 * queue[i] + k]] = 1;
    }
  }
  return found;
}

static void add_tube(stitch *s, int32_t a, int32_t b, int outside) {
  const double *p = s->mesh->positions;
  const int32_t *from = s->mesh->triangles + 3 * a, *to = s->mesh->triangles + 3 * b;
  double u[3], w[3], n[3];
  int turn = mirrored(s, a, b);
  orb_sub(p + 3 * from[1], p + 3 * from[0], u);
  orb_sub(p + 3 * from[2], p + 3 * from[0], w);
  orb_cross(u, w, n);
  double size = orb_length(n);
  int32_t ring[RINGS + 2][3];
  for (int i = 0; i < 3; i++) {
    int32_t end = to[(turn + 3 - i) % 3];
    ring[0][i] = from[i];
    ring[RINGS + 1][i] = end;
    for (int k = 1; k <= RINGS; k++) {
      /* half a circle from corner to corner: tubes keep their thickness in the bend */
      double angle = M_PI * k / (RINGS + 1), x = 0.5 - 0.5 * cos(angle);
      double lift = (outside ? 0.5 : -0.5) * sqrt(orb_distance2(p + 3 * from[i], p + 3 * end)) * sin(angle) / size;
      ring[k][i] = s->mesh->vertex_count + s->points;
      for (int d = 0; d < 3; d++) {
        s->point[s->points][d] = (1 - x) * p[3 * from[i] + d] + x * p[3 * end + d] + lift * n[d];
      }
      s->points++;
    }
  }
  for (int k = 0; k <= RINGS; k++) {
    for (int i = 0; i < 3; i++) {
      int j = (i + 1) % 3;
      int32_t one[3] = {ring[k][i], ring[k][j], ring[k + 1][j]}, two[3] = {ring[k][i], ring[k + 1][j], ring[k + 1][i]};
      memcpy(s->face[s->faces++], one, sizeof one);
      memcpy(s->face[s->faces++], two, sizeof two);
    }
  }
  s->dropped[a] = s->dropped[b] = 1;
}

static char *write_text(const stitch *s, size_t *size) {
  const orb_mesh *m = s->mesh;
  char *text = malloc(90 * ((size_t)m->vertex_count + (size_t)s->points) +
                      40 * ((size_t)m->triangle_count + (size_t)s->faces) + 1),
       *at = text;
  for (int32_t v = 0; v < m->vertex_count + s->points; v++) {
    const double *p = v < m->vertex_count ? m->positions + 3 * v : s->point[v - m->vertex_count];
    at += sprintf(at, "v %.17g %.17g %.17g\n", p[0], p[1], p[2]);
  }
  for (int32_t t = 0; t < m->triangle_count + s->faces; t++) {
    const int32_t *c = t < m->triangle_count ? m->triangles + 3 * t : s->face[t - m->triangle_count];
    if (t >= m->triangle_count || !s->dropped[t]) {
      at += sprintf(at, "f %d %d %d\n", c[0] + 1, c[1] + 1, c[2] + 1);
    }
  }
  *size = (size_t)(at - text);
  return text;
}

char *handles_stitch(const orb_mesh *mesh, int count, unsigned seed, size_t *size, int *made) {
  size_t v = (size_t)mesh->vertex_count, t = (size_t)mesh->triangle_count;
  stitch s = {.mesh = mesh,
              .first = calloc(v + 2, sizeof(int32_t)),
              .list = calloc(3 * t, sizeof(int32_t)),
              .used = calloc(v, 1),
              .dropped = calloc(t, 1),
              .rings = calloc(t, sizeof(int32_t)),
              .seen = calloc(t, sizeof(int32_t)),
              .point = calloc(3 * RINGS * (size_t)count, sizeof *s.point),
              .face = calloc(6 * (RINGS + 1) * (size_t)count, sizeof *s.face),
              .random = seed};
  list_faces(&s);
  *made = 0;
  for (int tries = 0; tries < 200 * count && *made < count; tries++) {
    int32_t a = (int32_t)(draw(&s) % (uint32_t)mesh->triangle_count), b = partner(&s, a, tries + 1);
    if (b >= 0) {
      add_tube(&s, a, b, ++*made % 2);
    }
  }
  char *text = write_text(&s, size);
  void *blocks[] = {s.first, s.list, s.used, s.dropped, s.rings, s.seen, s.point, s.face};
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    free(blocks[i]);
  }
  return text;
}

static int is_solid(int holes, int x, int y, int z) {
  return x >= 0 && x <= 2 * holes && y >= 0 && y < 3 && z == 0 && !(y == 1 && x % 2 == 1);
}

char *handles_plate(int holes, size_t *size) {
  static const int side[6][4][3] = {
      {{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}}, {{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 0}},
      {{0, 1, 0}, {0, 1, 1}, {1, 1, 1}, {1, 1, 0}}, {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}},
      {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}, {{0, 0, 0}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}}};
  static const int step[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  int wide = 2 * holes + 2;
  char *text = malloc(4096 + 1024 * (size_t)wide), *at = text;
  for (int i = 0; i < wide * 4 * 2; i++) {
    at += sprintf(at, "v %d %d %d\n", i % wide, i / wide % 4, i / wide / 4);
  }
  for (int cell = 0; cell < (wide - 1) * 3; cell++) {
    int x = cell % (wide - 1), y = cell / (wide - 1);
    for (int f = 0; f < 6; f++) {
      if (!is_solid(holes, x, y, 0) || is_solid(holes, x + step[f][0], y + step[f][1], step[f][2])) {
        continue;
      }
      at += sprintf(at, "f");
      for (int k = 0; k < 4; k++) {
        at += sprintf(at, " %d", 1 + x + side[f][k][0] + wide * (y + side[f][k][1] + 4 * side[f][k][2]));
      }
      at += sprintf(at, "\n");
    }
  }
  *size = (size_t)(at - text);
  return text;
}
