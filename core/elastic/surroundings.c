#include "elastic/surroundings.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"

/* A vertex takes its first rotation from the images of its surroundings, one vertex in this many of the mesh. With one
 * in 16, a limb's girth and as much of its length, noise of the rough map stays as twists: of 20 pairs, the right map
 * then bends the shapes least in 17 instead of 19, and by a tenth more. Chosen by trial on the pairs of the half
 * `choose` of tests/bench/correspond.py. */
enum { SURROUNDINGS = 4 };

int32_t orb_surroundings_most(int32_t n) {
  return 1 + n / SURROUNDINGS;
}

int32_t orb_surroundings_list(const orb_body *a, int32_t v, int32_t most, int32_t *mark, int32_t *list) {
  int32_t count = 1;
  list[0] = v;
  mark[v] = v + 1;
  for (int32_t k = 0; k < count; k++) {
    for (int32_t i = a->start[list[k]]; i < a->start[list[k] + 1] && count < most; i++) {
      if (mark[a->next[i]] != v + 1) {
        mark[a->next[i]] = v + 1;
        list[count++] = a->next[i];
      }
    }
  }
  return count;
}

orb_status orb_surroundings_create(orb_context *ctx, const orb_mesh *mesh, orb_surroundings *out) {
  const int32_t n = mesh->vertex_count;
  orb_body body = {0};
  int32_t *mark = ORB_NEW0(ctx, int32_t, n);
  orb_status status = ORB_E_NO_MEMORY;
  *out = (orb_surroundings){.most = orb_surroundings_most(n)};
  out->size = ORB_NEW(ctx, int32_t, n);
  out->list = ORB_NEW(ctx, int32_t, (size_t)n * (size_t)out->most);
  if (!mark || !out->size || !out->list) {
    goto end;
  }
  ORB_GO(status, orb_body_create(ctx, mesh, &body), end);
  for (int32_t v = 0; v < n; v++) {
    out->size[v] = orb_surroundings_list(&body, v, out->most, mark, out->list + (size_t)v * (size_t)out->most);
  }
end:
  orb_body_free(ctx, &body);
  orb_free(ctx, mark);
  return status;
}

void orb_surroundings_free(orb_context *ctx, orb_surroundings *s) {
  orb_free(ctx, s->size);
  orb_free(ctx, s->list);
  memset(s, 0, sizeof *s);
}
