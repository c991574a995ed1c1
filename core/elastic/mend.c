#include "elastic/mend.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "base/tasks.h"
#include "elastic/ends.h"
#include "elastic/rounds.h"
#include "numeric/quaternion.h"
#include "numeric/vec3.h"

enum {
  STARTS = 6, /* of an end: the pose as it is, and as many twists */
  ROUNDS = 6  /* from each start. With 10, the same pairs come as near, and have 0.3 % more energy */
};
/* Twists about the limb, in radians. Of 36 ends of seven pairs of people, twists of 1.6 and more won none, and bends at
 * the wrist two. */
static const double TWIST[STARTS] = {0, 0, 0.5, -0.5, 1, -1};
/* Distances at which a pull is as strong as the edges, first and last. The last one is that of a pose that settles. */
static const double FIRST_REACH = 0.15, LAST_REACH = 0.03;
/* 1 − the cosine of a normal and that at its place counts this much beside the bend. */
static const double NORMALS = 0.1;
/* A start wins with less than this share of the score of the pose as it is. Of 40 pairs of people without landmarks,
 * with 0.6, 0.75 and 0.85, 14, 16 and 18 come nearer to the truth and 2, 3 and 3 farther from it; with 24 landmarks 8,
 * 8 and 9, and 3, 5 and 9. */
static const double BETTER = 0.6;
/* The vertices of all pieces of a search together are at most this many times those of both meshes, which bounds the
 * time where a dense part lies near several ends. Four limbs of a body have a third. */
static const int64_t PIECES_MOST = 2;
/* Scales of the ends: first whole hands, then what is left, such as two fingers on one. Without the second, 10 of the
 * 40 pairs come nearer instead of 16 (both with 0.75). */
static const double SCALE[] = {1, 0.5};

/* A part of a mesh as a mesh of its own. */
typedef struct piece {
  orb_mesh mesh;
  int32_t *vertex; /* of the whole mesh */
} piece;

/* An end with what its starts need, and what they have led to. */
typedef struct mended {
  const orb_end *end;
  piece a, b;
  orb_elastic_anchors held; /* what lies beyond the wrist stays, and so do anchors */
  orb_elastic_pose pose[STARTS];
  double score[STARTS];
} mended;

typedef struct mending {
  orb_registration *r;
  double scale;
  int32_t count;
  mended one[ORB_ENDS_MOST];
} mending;

/* The triangles of a mesh whose corners are all marked. number: room for a number per vertex. */
static orb_status piece_create(orb_context *ctx, const orb_mesh *whole, const unsigned char *in, int32_t *number,
                               piece *out) {
  int32_t vertices = 0, triangles = 0;
  memset(number, -1, (size_t)whole->vertex_count * sizeof *number);
  for (int32_t t = 0; t < whole->triangle_count; t++) {
    const int32_t *v = whole->triangles + 3 * (size_t)t;
    if (in[v[0]] && in[v[1]] && in[v[2]]) {
      triangles++;
      for (int k = 0; k < 3; k++) {
        number[v[k]] = number[v[k]] < 0 ? vertices++ : number[v[k]];
      }
    }
  }
  out->mesh.vertex_count = vertices;
  out->mesh.positions = ORB_NEW(ctx, double, 3 * (size_t)vertices);
  out->mesh.triangles = ORB_NEW(ctx, int32_t, 3 * (size_t)triangles);
  out->vertex = ORB_NEW(ctx, int32_t, vertices);
  if (!out->mesh.positions || !out->mesh.triangles || !out->vertex) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t t = 0; t < whole->triangle_count; t++) {
    const int32_t *v = whole->triangles + 3 * (size_t)t;
    if (in[v[0]] && in[v[1]] && in[v[2]]) {
      for (int k = 0; k < 3; k++) {
        out->mesh.triangles[3 * (size_t)out->mesh.triangle_count + (size_t)k] = number[v[k]];
      }
      out->mesh.triangle_count++;
    }
  }
  for (int32_t v = 0; v < whole->vertex_count; v++) {
    if (number[v] >= 0) {
      out->vertex[number[v]] = v;
      memcpy(out->mesh.positions + 3 * (size_t)number[v], whole->positions + 3 * (size_t)v, sizeof(double[3]));
    }
  }
  return ORB_OK;
}

static void piece_free(orb_context *ctx, piece *p) {
  orb_free(ctx, p->mesh.positions);
  orb_free(ctx, p->mesh.triangles);
  orb_free(ctx, p->vertex);
}

static void mended_free(orb_context *ctx, mended *m) {
  piece_free(ctx, &m->a);
  piece_free(ctx, &m->b);
  orb_free(ctx, (void *)m->held.one);
  for (int k = 0; k < STARTS; k++) {
    orb_free(ctx, m->pose[k].position);
    orb_free(ctx, m->pose[k].rotation);
  }
}

/* How far a vertex of a piece goes with its end: 1 within it, 0 beyond the wrist. */
static double share_of(const mended *m, double scale, int32_t v) {
  const double away = m->end->away[m->a.vertex[v]] / scale;
  return fmin(1, fmax(0, (ORB_END_FAR - away) / (ORB_END_FAR - ORB_END_NEAR)));
}

/* Anchors of the piece: its vertices beyond the wrist where the pose has them, and the registration's own. number: of
 * each vertex of a, that in the piece. */
static orb_status hold(const orb_registration *r, const int32_t *number, double scale, mended *m) {
  const int32_t given = r->anchors ? r->anchors->count : 0;
  orb_elastic_anchor *one = ORB_NEW(r->ctx, orb_elastic_anchor, (size_t)m->a.mesh.vertex_count + (size_t)given);
  m->held.one = one;
  if (!one) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t v = 0; v < m->a.mesh.vertex_count; v++) {
    if (!(share_of(m, scale, v) > 0)) {
      orb_elastic_anchor *anchor = &one[m->held.count++];
      *anchor = (orb_elastic_anchor){.vertex = v};
      memcpy(anchor->place, r->pose->position + 3 * (size_t)m->a.vertex[v], sizeof anchor->place);
    }
  }
  for (int32_t i = 0; i < given; i++) {
    const orb_elastic_anchor *anchor = &r->anchors->one[i];
    if (number[anchor->vertex] >= 0) {
      one[m->held.count] = *anchor;
      one[m->held.count++].vertex = number[anchor->vertex];
    }
  }
  return ORB_OK;
}

/* The pieces of both meshes: what lies near the end, and the vertices of b whose nearest one lies there. in: room for a
 * mark for each vertex of both meshes, number: for a number of each. */
static orb_status prepare(const orb_registration *r, double scale, const orb_end *end, unsigned char *in,
                          int32_t *number, mended *m) {
  unsigned char *in_b = in + r->a.count;
  m->end = end;
  for (int32_t v = 0; v < r->a.count; v++) {
    in[v] = end->away[v] < INFINITY;
  }
  for (int32_t u = 0; u < r->b.count; u++) {
    in_b[u] = r->visit[u] >= 0 && in[r->visit[u]];
  }
  ORB_TRY(piece_create(r->ctx, r->b.mesh, in_b, number, &m->b));
  ORB_TRY(piece_create(r->ctx, r->a.mesh, in, number, &m->a));
  for (int k = 0; k < STARTS; k++) {
    m->pose[k].position = ORB_NEW(r->ctx, double, 3 * (size_t)m->a.mesh.vertex_count);
    m->pose[k].rotation = ORB_NEW(r->ctx, double, 9 * (size_t)m->a.mesh.vertex_count);
    if (!m->pose[k].position || !m->pose[k].rotation) {
      return ORB_E_NO_MEMORY;
    }
  }
  return hold(r, number, scale, m);
}

/* The rotation of the wrist, then a twist about the limb. */
static void turn_by(const orb_end *end, double twist, double out[9]) {
  double q[4] = {cos(twist / 2)}, r[9];
  for (int k = 0; k < 3; k++) {
    q[1 + k] = sin(twist / 2) * end->axis[k];
  }
  orb_quaternion_rotation(q, r);
  for (int i = 0; i < 9; i++) {
    const int row = i / 3 * 3, column = i % 3;
    out[i] = r[row] * end->turn[column] + r[row + 1] * end->turn[3 + column] + r[row + 2] * end->turn[6 + column];
  }
}

/* Fills the pose of start k: the end rigid, and the wrist between it and what lies beyond. */
static void place_start(const mending *w, mended *m, int k) {
  const orb_elastic_pose *pose = w->r->pose;
  for (int32_t v = 0; v < m->a.mesh.vertex_count; v++) {
    const size_t whole = (size_t)m->a.vertex[v];
    const double share = k > 0 ? share_of(m, w->scale, v) : 0;
    double *x = m->pose[k].position + 3 * (size_t)v, *rotation = m->pose[k].rotation + 9 * (size_t)v, turn[9], p[3];
    memcpy(x, pose->position + 3 * whole, sizeof(double[3]));
    memcpy(rotation, pose->rotation + 9 * whole, sizeof turn);
    if (share > 0) {
      turn_by(m->end, share * TWIST[k], turn);
      orb_sub(m->a.mesh.positions + 3 * (size_t)v, m->end->from, p);
      for (int i = 0; i < 3; i++) {
        x[i] += share * (m->end->to[i] + orb_dot(turn + 3 * i, p) - x[i]);
      }
    }
    if (share > 0.5) {
      memcpy(rotation, turn, sizeof turn);
    }
  }
}

/* How much the end is bent, and how unlike its normals are to those at its places. */
static double score_of(const orb_registration *one, const mended *m, double scale) {
  double sum = 0, mass = 0;
  for (int32_t v = 0; v < one->a.count; v++) {
    if (share_of(m, scale, v) > 0) {
      const double alike = orb_dot(one->normal + 3 * (size_t)v, one->b.normal + 3 * (size_t)one->place[v]);
      sum += one->a.mass[v] * (orb_registration_bend_at(one, v) + NORMALS * (1 - alike));
      mass += one->a.mass[v];
    }
  }
  return mass > 0 ? sum / mass : INFINITY;
}

/* Registers an end from one of its starts. */
static orb_status register_start(orb_context *ctx, void *arg, int32_t i) {
  mending *w = arg;
  mended *m = &w->one[i / STARTS];
  const int k = i % STARTS;
  orb_registration one = {.ctx = ctx, .anchors = &m->held, .pose = &m->pose[k]};
  orb_status status;
  place_start(w, m, k);
  ORB_GO(status, orb_context_check(ctx), end);
  ORB_GO(status, orb_registration_create(ctx, &m->a.mesh, &m->b.mesh, &one), end);
  ORB_GO(status, orb_registration_rounds(&one, ROUNDS, FIRST_REACH, LAST_REACH), end);
  m->score[k] = score_of(&one, m, w->scale);
end:
  orb_registration_free(&one);
  return status;
}

/* Writes what the best start has led to, if it is clearly better than the pose as it is. Returns whether it is. */
static int take_best(const mending *w, const mended *m) {
  int best = 1;
  for (int k = 2; k < STARTS; k++) {
    best = m->score[k] < m->score[best] ? k : best;
  }
  if (!(m->score[best] < BETTER * m->score[0])) {
    return 0;
  }
  for (int32_t v = 0; v < m->a.mesh.vertex_count; v++) {
    const size_t whole = (size_t)m->a.vertex[v];
    if (share_of(m, w->scale, v) > 0) {
      memcpy(w->r->pose->position + 3 * whole, m->pose[best].position + 3 * (size_t)v, sizeof(double[3]));
      memcpy(w->r->pose->rotation + 9 * whole, m->pose[best].rotation + 9 * (size_t)v, sizeof(double[9]));
    }
  }
  return 1;
}

/* Mends the ends of one scale. *changed: whether one of them has a better pose. */
static orb_status mend_ends(orb_registration *r, double scale, const orb_ends *ends, int *changed) {
  mending w = {.r = r, .scale = scale};
  const size_t all = (size_t)r->a.count + (size_t)r->b.count;
  unsigned char *in = ORB_NEW(r->ctx, unsigned char, all);
  int32_t *number = ORB_NEW(r->ctx, int32_t, all);
  int64_t taken = 0;
  orb_status status = in && number ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t e = 0; e < ends->count && status == ORB_OK; e++) {
    mended *m = &w.one[w.count++];
    status = prepare(r, scale, &ends->end[e], in, number, m);
    const int64_t vertices = (int64_t)m->a.mesh.vertex_count + m->b.mesh.vertex_count;
    const int is_empty = m->a.mesh.triangle_count == 0 || m->b.mesh.triangle_count == 0; /* nothing of b lies there */
    if (status == ORB_OK && !is_empty && taken + vertices <= PIECES_MOST * (int64_t)all) {
      taken += vertices;
    } else if (status == ORB_OK) {
      mended_free(r->ctx, m);
      *m = (mended){0};
      w.count--;
    }
  }
  if (status != ORB_OK) {
    goto end;
  }
  ORB_GO(status, orb_tasks_run(r->ctx, w.count * STARTS, register_start, &w), end);
  for (int32_t i = 0; i < w.count; i++) {
    *changed |= take_best(&w, &w.one[i]);
  }
end:
  for (int32_t i = 0; i < w.count; i++) {
    mended_free(r->ctx, &w.one[i]);
  }
  orb_free(r->ctx, in);
  orb_free(r->ctx, number);
  return status;
}

orb_status orb_registration_mend(orb_registration *r, double reach) {
  for (size_t i = 0; i < sizeof SCALE / sizeof *SCALE; i++) {
    int changed = 0;
    orb_ends ends;
    orb_status status = orb_ends_find(r, SCALE[i], &ends);
    if (status == ORB_OK && ends.count > 0) {
      status = mend_ends(r, SCALE[i], &ends, &changed);
    }
    orb_ends_free(r->ctx, &ends);
    ORB_TRY(status);
    if (changed) { /* and all else settles on it */
      ORB_TRY(orb_registration_round(r, 1, reach));
    }
  }
  return ORB_OK;
}
