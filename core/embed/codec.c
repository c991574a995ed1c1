/* The stored form of an embedding, little-endian:
 *
 *   0  8 bytes  "ORBEMBED"
 *   8  uint32   version
 *  12  int32    vertices
 *  16  …        points, certificate, distortion, timings: 8 bytes a number (integers as int64, the rest as double)
 *  −8  uint64   checksum of all before it
 *
 * Decoding takes nothing on trust: the size must be what the header says, the checksum must fit, points must be unit,
 * and the certificate is worked out again on the mesh and must be what was stored.
 */
#include <math.h>
#include <string.h>

#include "base/check.h"
#include "numeric/vec3.h"
#include "orbmorph/embed.h"

enum { VERSION = 1, HEADER = 16, MEASURE_NUMBERS = 6 + 2 * ORB_HISTOGRAM_BINS + 1, TAIL_NUMBERS = 6 + 1 + 5 };
enum { FIXED_NUMBERS = 4 * MEASURE_NUMBERS + TAIL_NUMBERS };
static const char MAGIC[] = "ORBEMBED";
static const double UNIT = 1e-12;

typedef struct cursor {
  unsigned char *at;
  const unsigned char *from;
} cursor;

static void put_u64(cursor *c, uint64_t x) {
  for (int i = 0; i < 8; i++) {
    *c->at++ = (unsigned char)(x >> 8 * i);
  }
}
static uint64_t get_u64(cursor *c) {
  uint64_t x = 0;
  for (int i = 0; i < 8; i++) {
    x |= (uint64_t)*c->from++ << 8 * i;
  }
  return x;
}
static void put_double(cursor *c, double x) {
  uint64_t bits;
  memcpy(&bits, &x, sizeof bits);
  put_u64(c, bits);
}
static double get_double(cursor *c) {
  uint64_t bits = get_u64(c);
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

static void put_measure(cursor *c, const orb_measure *m) {
  const double plain[] = {m->mean, m->median, m->p99, m->max, m->std};
  for (int i = 0; i < 5; i++) {
    put_double(c, plain[i]);
  }
  put_u64(c, (uint64_t)m->bins);
  for (int i = 0; i <= ORB_HISTOGRAM_BINS; i++) {
    put_double(c, m->edges[i]);
  }
  for (int i = 0; i < ORB_HISTOGRAM_BINS; i++) {
    put_double(c, m->counts[i]);
  }
}

static int get_measure(cursor *c, orb_measure *m) {
  double *plain[] = {&m->mean, &m->median, &m->p99, &m->max, &m->std};
  for (int i = 0; i < 5; i++) {
    *plain[i] = get_double(c);
  }
  uint64_t bins = get_u64(c);
  m->bins = bins <= ORB_HISTOGRAM_BINS ? (int32_t)bins : -1;
  for (int i = 0; i <= ORB_HISTOGRAM_BINS; i++) {
    m->edges[i] = get_double(c);
  }
  for (int i = 0; i < ORB_HISTOGRAM_BINS; i++) {
    m->counts[i] = get_double(c);
  }
  return m->bins >= 0;
}

/* Word by word: multiply and fold (FNV-1a on 64-bit words, then a final mix). */
static uint64_t checksum(const unsigned char *bytes, size_t size) {
  uint64_t h = UINT64_C(0xcbf29ce484222325);
  cursor c = {.from = bytes};
  for (size_t i = 0; i + 8 <= size; i += 8) {
    h = (h ^ get_u64(&c)) * UINT64_C(0x100000001b3);
    h ^= h >> 29;
  }
  h *= UINT64_C(0x9e3779b97f4a7c15);
  return h ^ h >> 32;
}

static size_t stored_size(int64_t vertices) {
  return (size_t)(HEADER + 8 * (3 * vertices + FIXED_NUMBERS + 1));
}

orb_status orb_embedding_encode(orb_context *ctx, const orb_embedding *e, orb_buffer *out) {
  size_t size = stored_size(e->vertex_count);
  unsigned char *bytes = orb_alloc(ctx, size, 1);
  if (!bytes) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(bytes, MAGIC, 8);
  cursor c = {.at = bytes + 8};
  put_u64(&c, (uint64_t)VERSION | (uint64_t)(uint32_t)e->vertex_count << 32);
  for (int64_t i = 0; i < 3 * (int64_t)e->vertex_count; i++) {
    put_double(&c, e->points[i]);
  }
  const orb_certificate *cert = &e->certificate;
  put_u64(&c, (uint64_t)cert->valid);
  put_u64(&c, (uint64_t)cert->exact);
  put_u64(&c, (uint64_t)cert->flipped);
  put_u64(&c, (uint64_t)cert->degenerate);
  put_u64(&c, (uint64_t)(int64_t)cert->degree);
  put_double(&c, cert->min_determinant);
  put_measure(&c, &e->distortion.symmetric_dirichlet);
  put_measure(&c, &e->distortion.angle);
  put_measure(&c, &e->distortion.area);
  put_measure(&c, &e->distortion.aspect);
  put_double(&c, e->distortion.stretch_efficiency);
  const double times[] = {e->timings.check, e->timings.simplify, e->timings.embed, e->timings.certify,
                          e->timings.total};
  for (int i = 0; i < 5; i++) {
    put_double(&c, times[i]);
  }
  put_u64(&c, checksum(bytes, size - 8));
  ORB_ASSERT((size_t)(c.at - bytes) == size);
  orb_status status = orb_buffer_append(ctx, out, bytes, size);
  orb_free(ctx, bytes);
  return status;
}

static orb_status corrupt(orb_context *ctx, const char *why) {
  return orb_fail(ctx, ORB_E_CORRUPT, "The stored embedding cannot be used: %s.", why);
}

static orb_status check_envelope(orb_context *ctx, const unsigned char *bytes, size_t size, const orb_mesh *mesh) {
  if (size < HEADER || memcmp(bytes, MAGIC, 8) != 0) {
    return corrupt(ctx, "it is not one");
  }
  cursor c = {.from = bytes + 8};
  uint64_t header = get_u64(&c);
  if ((uint32_t)header != VERSION) {
    return corrupt(ctx, "it is of another version");
  }
  if (header >> 32 != (uint64_t)mesh->vertex_count) {
    return corrupt(ctx, "it belongs to another mesh");
  }
  if (size != stored_size(mesh->vertex_count)) {
    return corrupt(ctx, "its size is not what its header says");
  }
  c.from = bytes + size - 8;
  if (get_u64(&c) != checksum(bytes, size - 8)) {
    return corrupt(ctx, "its checksum does not fit");
  }
  return ORB_OK;
}

static int read_body(cursor *c, orb_embedding *out) {
  for (int64_t i = 0; i < 3 * (int64_t)out->vertex_count; i++) {
    out->points[i] = get_double(c);
  }
  orb_certificate *cert = &out->certificate;
  cert->valid = get_u64(c) == 1;
  cert->exact = get_u64(c) == 1;
  cert->flipped = (int64_t)get_u64(c);
  cert->degenerate = (int64_t)get_u64(c);
  cert->degree = (int32_t)get_u64(c);
  cert->min_determinant = get_double(c);
  int good = get_measure(c, &out->distortion.symmetric_dirichlet);
  good &= get_measure(c, &out->distortion.angle);
  good &= get_measure(c, &out->distortion.area);
  good &= get_measure(c, &out->distortion.aspect);
  out->distortion.stretch_efficiency = get_double(c);
  double *times[] = {&out->timings.check, &out->timings.simplify, &out->timings.embed, &out->timings.certify,
                     &out->timings.total};
  for (int i = 0; i < 5; i++) {
    *times[i] = get_double(c);
  }
  return good;
}

static int all_unit(const orb_embedding *e) {
  for (int64_t i = 0; i < e->vertex_count; i++) {
    if (!(fabs(orb_length(e->points + 3 * i) - 1) <= UNIT)) {
      return 0;
    }
  }
  return 1;
}

static orb_status certify_again(orb_context *ctx, const orb_mesh *mesh, const orb_embedding *e) {
  orb_certificate now;
  ORB_TRY(orb_certify(ctx, e->points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &now));
  const orb_certificate *then = &e->certificate;
  if (!now.valid || !then->valid || !then->exact || then->flipped || then->degenerate || then->degree != 1) {
    return corrupt(ctx, "its certificate does not hold on this mesh");
  }
  return ORB_OK;
}

orb_status orb_embedding_decode(orb_context *ctx, const unsigned char *bytes, size_t size, const orb_mesh *mesh,
                                orb_embedding *out) {
  memset(out, 0, sizeof *out);
  ORB_TRY(check_envelope(ctx, bytes, size, mesh));
  out->vertex_count = mesh->vertex_count;
  out->points = ORB_NEW(ctx, double, 3 * (int64_t)mesh->vertex_count);
  if (!out->points) {
    return ORB_E_NO_MEMORY;
  }
  cursor c = {.from = bytes + HEADER};
  orb_status status = ORB_OK;
  if (!read_body(&c, out) || !all_unit(out)) {
    status = corrupt(ctx, "its numbers are out of range");
  }
  if (status == ORB_OK) {
    status = certify_again(ctx, mesh, out);
  }
  if (status != ORB_OK) {
    orb_embedding_free(ctx, out);
  }
  return status;
}
