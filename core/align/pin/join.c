/* A base that all shapes share.
 *
 * Edges between landmarks are tried in the order of their length, which is the length of a path past the existing ones,
 * summed over the shapes: first edges that join two trees, which can always be drawn, then all others. An edge is drawn
 * on one shape (the shapes take turns) by the shortest path through any sectors, then on the others through the same
 * sectors, so that the cyclic order around each landmark agrees on all shapes. Two landmarks on one face that are not
 * neighbours can always be joined through the face. When no such pair is left, the graph is maximal planar, that is, a
 * triangulation without double edges. Such a graph has an embedding by great circle arcs (Steinitz), which orb_embed()
 * finds.
 */
#include <math.h>
#include <string.h>

#include "align/pin/join.h"
#include "align/pin/path_tracer.h"
#include "base/check.h"
#include "base/error.h"
#include "base/forest.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Chosen by trial. */
static const double SLACK = 2;     /* a pair is taken although it is longer than the next one by up to this factor */
static const double LONGEST = 200; /* chords of the unit sphere, summed: longer pairs are taken without a search */
enum { MANY = 45 };                /* from this many landmarks on, one search for all paths from a landmark is faster */

/* A pair of landmarks that an edge may join. */
typedef struct end_pair {
  double length;
  int32_t a, b;
} end_pair;

/* Abstract half-edges 2e and 2e + 1 of edge e, in cyclic order about their origins. */
typedef struct joiner {
  orb_context *ctx;
  orb_path_tracer *tracers;
  int32_t shapes, count;
  const int32_t *at, *most_triangles;
  int32_t *origin, *next, *prev; /* of each half-edge; next: counter-clockwise around the origin */
  int32_t *first;                /* of each landmark: one half-edge that leaves it, −1 */
  int32_t *face, faces;          /* of each half-edge: the face on its left */
  int32_t *forest;               /* of what edges join */
  int32_t edges;
  int64_t *work;
  double *least; /* shape-major, count × count: lower bounds of the lengths of paths */
  double
      *ball_radius; /* shape-major: up to where they were exact around a landmark, when there were ball_edges edges */
  int32_t *ball_edges;
  int32_t **mark, *marked; /* of each shape: the landmark at each vertex, −1: none; and the number of these vertices */
} joiner;

/* A heap of pairs by length, ties by number. */
typedef struct queue {
  end_pair *pair; /* all of them; lengths only grow */
  int64_t *heap, count;
} queue;

static int shorter(const queue *q, int64_t x, int64_t y) {
  return q->pair[x].length != q->pair[y].length ? q->pair[x].length < q->pair[y].length : x < y;
}

static void sift(queue *q, int64_t i) {
  int64_t item = q->heap[i];
  for (;;) {
    int64_t child = 2 * i + 1;
    if (child >= q->count) {
      break;
    }
    child += child + 1 < q->count && shorter(q, q->heap[child + 1], q->heap[child]);
    if (!shorter(q, q->heap[child], item)) {
      break;
    }
    q->heap[i] = q->heap[child];
    i = child;
  }
  q->heap[i] = item;
}

static void queue_fill(queue *q, int64_t count) {
  q->count = count;
  for (int64_t i = 0; i < count; i++) {
    q->heap[i] = i;
  }
  for (int64_t i = count / 2; i-- > 0;) {
    sift(q, i);
  }
}

static void queue_pop(queue *q) {
  q->heap[0] = q->heap[--q->count];
  if (q->count > 0) {
    sift(q, 0);
  }
}

static int neighbours(const joiner *j, int32_t a, int32_t b) {
  int32_t start = j->first[a], h = start;
  if (h < 0) {
    return 0;
  }
  do {
    if (j->origin[h ^ 1] == b) {
      return 1;
    }
    h = j->next[h];
  } while (h != start);
  return 0;
}

static void number_faces(joiner *j) {
  j->faces = 0;
  for (int32_t h = 0; h < 2 * j->edges; h++) {
    j->face[h] = -1;
  }
  for (int32_t h = 0; h < 2 * j->edges; h++) {
    if (j->face[h] < 0) {
      for (int32_t g = h; j->face[g] < 0; g = j->prev[g ^ 1]) {
        j->face[g] = j->faces;
      }
      j->faces++;
    }
  }
}

static int share_face(const joiner *j, int32_t a, int32_t b) {
  int32_t h = j->first[a];
  do {
    int32_t g = j->first[b];
    do {
      if (j->face[g] == j->face[h]) {
        return 1;
      }
      g = j->next[g];
    } while (g != j->first[b]);
    h = j->next[h];
  } while (h != j->first[a]);
  return 0;
}

/* The sector through which a new path leaves v, named by the half-edge before it; −1: no other path ends at v. */
static int32_t sector_of(const joiner *j, const orb_path_tracer *t, int32_t landmark, int32_t v, int32_t name) {
  int32_t h = orb_path_tracer_outgoing(t, v, name), start = j->first[landmark];
  if (start < 0 || h < 0) {
    return -1;
  }
  int32_t g = h;
  do { /* clockwise: the twin's next */
    g = orb_next(t->sheet->twin[g]);
  } while (t->paths->path[g] < 0);
  int32_t e = t->paths->path[g];
  return j->origin[2 * e] == landmark ? 2 * e : 2 * e + 1;
}

/* Opens or closes the gates of a sector (−1: all) around a landmark on one shape. */
static int set_gates(const joiner *j, orb_path_tracer *t, int32_t v, int32_t sector, int open) {
  if (sector < 0) {
    orb_path_tracer_gates(t, v, -1, -1, open);
    return 1;
  }
  int32_t first = orb_path_tracer_outgoing(t, v, sector / 2),
          last = orb_path_tracer_outgoing(t, v, j->next[sector] / 2);
  if (first < 0 || last < 0) {
    return 0;
  }
  orb_path_tracer_gates(t, v, first, last, open);
  return 1;
}

static orb_status draw(joiner *j, int32_t shape, int32_t a, int32_t b, const int32_t sector[2], int *good) {
  orb_path_tracer *t = &j->tracers[shape];
  int32_t from = j->at[(size_t)shape * (size_t)j->count + (size_t)a],
          to = j->at[(size_t)shape * (size_t)j->count + (size_t)b];
  ORB_TRY(orb_context_check(j->ctx));
  ORB_TRY(orb_path_tracer_fit(t));
  *good = t->sheet->shape.mesh.triangle_count <= j->most_triangles[shape] && set_gates(j, t, from, sector[0], 1) &&
          set_gates(j, t, to, sector[1], 1);
  if (*good) {
    ORB_TRY(orb_path_tracer_search(t, from, to, good));
    (void)set_gates(j, t, from, sector[0], 0);
    (void)set_gates(j, t, to, sector[1], 0);
  }
  return *good ? orb_path_tracer_lay(t, j->edges, good) : ORB_OK;
}

static void link_after(joiner *j, int32_t h, int32_t landmark, int32_t sector) {
  j->origin[h] = landmark;
  if (sector < 0) {
    j->next[h] = j->prev[h] = j->first[landmark] = h;
    return;
  }
  int32_t after = j->next[sector];
  j->next[sector] = h;
  j->prev[h] = sector;
  j->next[h] = after;
  j->prev[after] = h;
}

/* Draws edge a–b on every shape and inserts it into the order around both ends. */
static orb_status add_edge(joiner *j, int32_t a, int32_t b, int *good) {
  int32_t lead = j->edges % j->shapes, sector[2] = {-1, -1};
  ORB_TRY(draw(j, lead, a, b, sector, good));
  if (!*good) {
    return ORB_OK;
  }
  const orb_path_tracer *t = &j->tracers[lead];
  const int32_t *at = j->at + (size_t)lead * (size_t)j->count;
  sector[0] = sector_of(j, t, a, at[a], j->edges);
  sector[1] = sector_of(j, t, b, at[b], j->edges);
  for (int32_t s = 0; s < j->shapes && *good; s++) {
    if (s != lead) {
      ORB_TRY(draw(j, s, a, b, sector, good));
    }
  }
  link_after(j, 2 * j->edges, a, sector[0]);
  link_after(j, 2 * j->edges + 1, b, sector[1]);
  j->edges++;
  number_faces(j);
  return ORB_OK;
}

static double straight(const joiner *j, int32_t s, int32_t a, int32_t b) {
  const double *p = j->tracers[s].sheet->shape.points;
  const int32_t *at = j->at + (size_t)s * (size_t)j->count;
  return sqrt(orb_distance2(p + 3 * (size_t)at[a], p + 3 * (size_t)at[b]));
}

static double *least_from(const joiner *j, int32_t s, int32_t a) {
  return j->least + ((size_t)s * (size_t)j->count + (size_t)a) * (size_t)j->count;
}

/* A lower bound of the length of a path from a to b, summed over the shapes. */
static double least_length(const joiner *j, int32_t a, int32_t b) {
  double sum = 0;
  for (int32_t s = 0; s < j->shapes; s++) {
    sum += least_from(j, s, a)[b];
  }
  return sum;
}

/* Raises the lower bound for the path from a to b, up to the radius. */
static orb_status measure_one(joiner *j, int32_t s, int32_t a, int32_t b, double radius) {
  orb_path_tracer *t = &j->tracers[s];
  const int32_t *at = j->at + (size_t)s * (size_t)j->count;
  double *least = least_from(j, s, a);
  int found;
  orb_path_tracer_gates(t, at[a], -1, -1, 1);
  orb_path_tracer_gates(t, at[b], -1, -1, 1);
  t->bound = radius;
  orb_status status = orb_path_tracer_search(t, at[a], at[b], &found);
  t->bound = 0;
  orb_path_tracer_gates(t, at[a], -1, -1, 0);
  orb_path_tracer_gates(t, at[b], -1, -1, 0);
  if (status == ORB_OK) {
    least[b] = fmax(least[b], found ? fmin(t->length, radius) : radius);
    least_from(j, s, b)[a] = least[b];
  }
  return status;
}

/* Raises the lower bounds for all paths from a, up to the radius. */
static orb_status measure_all(joiner *j, int32_t s, int32_t a, double radius) {
  size_t ball = (size_t)s * (size_t)j->count + (size_t)a;
  double *least = least_from(j, s, a);
  if (j->ball_edges[ball] == j->edges && j->ball_radius[ball] >= radius) {
    return ORB_OK;
  }
  ORB_TRY(orb_path_tracer_ball(&j->tracers[s], j->at[ball], radius, j->mark[s], j->marked[s], least, j->count));
  j->ball_edges[ball] = j->edges;
  j->ball_radius[ball] = radius;
  for (int32_t c = 0; c < j->count; c++) {
    double *other = &least_from(j, s, c)[a];
    *other = least[c] > *other ? least[c] : *other;
  }
  return ORB_OK;
}

/* Is the path from a to b past all existing paths, summed over the shapes, at most `most` long? Lower bounds that a
 * search finds stay valid, since further paths only make it longer. */
static orb_status short_enough(joiner *j, int32_t a, int32_t b, double most, int *yes) {
  *yes = least_length(j, a, b) < most;
  for (int32_t s = 0; s < j->shapes && *yes; s++) {
    ORB_TRY(orb_path_tracer_fit(&j->tracers[s]));
    ORB_TRY(orb_context_check(j->ctx));
    if (j->count < MANY) {
      ORB_TRY(measure_one(j, s, a, b, most - least_length(j, a, b) + least_from(j, s, a)[b]));
    } else {
      ORB_TRY(measure_all(j, s, a, most));
    }
    *yes = least_length(j, a, b) < most;
  }
  return ORB_OK;
}

static int is_open(joiner *j, int tree, int32_t a, int32_t b) {
  return tree ? orb_forest_root(j->forest, a) != orb_forest_root(j->forest, b)
              : !neighbours(j, a, b) && share_face(j, a, b);
}

/* Adds edges in the order of their true lengths, which grow as paths get in their way: a pair that has become longer
 * than the next one goes back into the queue. */
static orb_status join_pass(joiner *j, queue *q, int tree, int *good) {
  while (q->count > 0 && *good && *j->work > 0 && j->edges < 3 * j->count - 6) {
    end_pair *pair = &q->pair[q->heap[0]];
    int32_t a = pair->a, b = pair->b;
    int taken = 1;
    if (!is_open(j, tree, a, b)) {
      queue_pop(q);
      continue;
    }
    int64_t second = q->count > 2 && shorter(q, q->heap[2], q->heap[1]) ? 2 : 1;
    if (q->count > 1 && pair->length < LONGEST) {
      double most = SLACK * q->pair[q->heap[second]].length;
      ORB_TRY(short_enough(j, a, b, most, &taken));
      if (!taken) {
        pair->length = fmax(most, least_length(j, a, b));
        sift(q, 0);
      }
    }
    if (taken) {
      queue_pop(q);
      orb_forest_join(j->forest, a, b);
      ORB_TRY(add_edge(j, a, b, good));
    }
  }
  return ORB_OK;
}

static orb_status join_all(joiner *j, queue *q, int *good) {
  int64_t pairs = 0;
  for (int32_t a = 0; a < j->count; a++) {
    for (int32_t b = 0; b < a; b++) {
      double length = 0;
      for (int32_t s = 0; s < j->shapes; s++) {
        length += least_from(j, s, a)[b] = least_from(j, s, b)[a] = straight(j, s, a, b);
      }
      q->pair[pairs++] = (end_pair){length, b, a};
    }
  }
  *good = 1;
  for (int tree = 1; tree >= 0; tree--) {
    queue_fill(q, pairs);
    ORB_TRY(join_pass(j, q, tree, good));
  }
  *good = *good && j->edges == 3 * j->count - 6 && j->faces == 2 * j->count - 4;
  return ORB_OK;
}

/* Lays out the base by orb_embed(). All its triangles count alike: without positions they are taken as equilateral. */
static orb_status lay_out(joiner *j, orb_sheet *base) {
  orb_context *ctx = j->ctx;
  orb_status status = ORB_OK;
  orb_embedding embedding = {0};
  orb_mesh mesh = {.vertex_count = j->count, .triangle_count = j->faces};
  unsigned char *seen = ORB_NEW0(ctx, unsigned char, j->faces);
  mesh.positions = ORB_NEW0(ctx, double, 3 * (size_t)j->count);
  mesh.triangles = ORB_NEW(ctx, int32_t, 3 * (size_t)j->faces);
  if (!seen || !mesh.positions || !mesh.triangles) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int32_t h = 0; h < 2 * j->edges; h++) {
    int32_t f = j->face[h], g = h;
    for (int k = 0; !seen[f] && k < 3; k++, g = j->prev[g ^ 1]) {
      mesh.triangles[3 * f + k] = j->origin[g];
    }
    seen[f] = 1;
  }
  orb_embed_options options;
  orb_embed_defaults(&options);
  ORB_GO(status, orb_embed(ctx, &mesh, &options, &embedding), end);
  ORB_GO(status, orb_sheet_create(ctx, &mesh, embedding.points, base), end);
  base->given = NULL; /* its mesh ends here */
end:
  orb_embedding_free(ctx, &embedding);
  orb_free(ctx, mesh.positions);
  orb_free(ctx, mesh.triangles);
  orb_free(ctx, seen);
  return status;
}

/* Renames paths to the names of the base's edges: the lesser half-edge. */
static void rename_paths(const joiner *j, const orb_sheet *base, orb_paths *paths, int32_t half_edges) {
  for (int32_t h = 0; h < half_edges; h++) {
    int32_t e = paths->path[h];
    if (e >= 0) {
      int32_t b = orb_sheet_edge(base, j->origin[2 * e], j->origin[2 * e + 1]);
      paths->path[h] = b < base->twin[b] ? b : base->twin[b];
    }
  }
}

static void joiner_free(joiner *j) {
  for (int32_t s = 0; s < j->shapes; s++) {
    if (j->tracers && j->tracers[s].ctx) {
      orb_path_tracer_free(&j->tracers[s]);
    }
    if (j->mark) {
      orb_free(j->ctx, j->mark[s]);
    }
  }
  orb_free(j->ctx, j->tracers);
  orb_free(j->ctx, j->mark);
  orb_free(j->ctx, j->marked);
  orb_free(j->ctx, j->least);
  orb_free(j->ctx, j->ball_radius);
  orb_free(j->ctx, j->ball_edges);
  orb_free(j->ctx, j->origin);
}

static orb_status joiner_create(joiner *j, orb_sheet *sheets, orb_paths *paths) {
  size_t half_edges = 6 * (size_t)j->count, ends = (size_t)j->shapes * (size_t)j->count;
  int32_t *block = j->origin = ORB_NEW(j->ctx, int32_t, 4 * half_edges + 2 * (size_t)j->count);
  j->tracers = ORB_NEW0(j->ctx, orb_path_tracer, j->shapes);
  j->mark = ORB_NEW0(j->ctx, int32_t *, j->shapes);
  j->marked = ORB_NEW(j->ctx, int32_t, j->shapes);
  j->least = ORB_NEW0(j->ctx, double, ends *(size_t)j->count);
  j->ball_radius = ORB_NEW0(j->ctx, double, ends);
  j->ball_edges = ORB_NEW0(j->ctx, int32_t, ends);
  if (!block || !j->tracers || !j->mark || !j->marked || !j->least || !j->ball_radius || !j->ball_edges) {
    return ORB_E_NO_MEMORY;
  }
  j->next = block + half_edges;
  j->prev = block + 2 * half_edges;
  j->face = block + 3 * half_edges;
  j->first = block + 4 * half_edges;
  j->forest = j->first + j->count;
  orb_forest_plant(j->forest, j->count);
  for (int32_t k = 0; k < j->count; k++) {
    j->first[k] = -1;
  }
  for (int32_t s = 0; s < j->shapes; s++) {
    j->tracers[s] = (orb_path_tracer){.ctx = j->ctx, .sheet = &sheets[s], .paths = &paths[s], .work = j->work};
    ORB_TRY(orb_paths_fit(j->ctx, &sheets[s], &paths[s]));
    j->marked[s] = sheets[s].shape.mesh.vertex_count;
    j->mark[s] = ORB_NEW(j->ctx, int32_t, j->marked[s]);
    if (!j->mark[s]) {
      return ORB_E_NO_MEMORY;
    }
    memset(j->mark[s], -1, (size_t)j->marked[s] * sizeof *j->mark[s]);
    for (int32_t k = 0; k < j->count; k++) {
      int32_t v = j->at[(size_t)s * (size_t)j->count + (size_t)k];
      paths[s].on[v] = 1;
      j->mark[s][v] = k;
    }
  }
  return ORB_OK;
}

orb_status orb_base_join(orb_context *ctx, orb_sheet *sheets, orb_paths *paths, int32_t shape_count, const int32_t *at,
                         int32_t count, const int32_t *most_triangles, int64_t *work, orb_sheet *base, int *good) {
  orb_status status;
  ORB_ASSERT(count >= 4);
  joiner j = {
      .ctx = ctx, .shapes = shape_count, .count = count, .at = at, .most_triangles = most_triangles, .work = work};
  size_t pairs = (size_t)count * (size_t)(count - 1) / 2;
  queue q = {.pair = ORB_NEW(ctx, end_pair, pairs), .heap = ORB_NEW(ctx, int64_t, pairs)};
  *good = 0;
  if (!q.pair || !q.heap) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, joiner_create(&j, sheets, paths), end);
  ORB_GO(status, join_all(&j, &q, good), end);
  if (*good) {
    status = lay_out(&j, base);
    if (status == ORB_E_NOT_CERTIFIED) {
      orb_error_clear(ctx);
      status = ORB_OK;
      *good = 0;
    }
    for (int32_t s = 0; status == ORB_OK && *good && s < shape_count; s++) {
      rename_paths(&j, base, &paths[s], 3 * sheets[s].shape.mesh.triangle_count);
    }
  }
end:
  joiner_free(&j);
  orb_free(ctx, q.pair);
  orb_free(ctx, q.heap);
  return status;
}
