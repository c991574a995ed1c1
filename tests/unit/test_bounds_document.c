/* glTF documents of one part, repeated as often as fits: the kernel's count of the memory that reading one takes is at
 * most what the budget counts. Each is read in a process of its own, whose peak the kernel reports. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "orbmorph/format.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ORB_TEST_SANITIZED 1
#else
#define ORB_TEST_SANITIZED 0
#endif

enum { MEGABYTE = 1 << 20, SLACK = 16 /* MB: of the allocator and the stack */, WORST = 200 /* bytes a byte */ };
enum { LEAST = 96 /* bytes a part: of a document that is refused before it is parsed nothing counts */ };

typedef struct document {
  const char *name;
  const char *before, *part, *after; /* of the part there are `count`, divided by commas */
  int count;
} document;

static size_t put(char *to, const char *text) {
  const size_t length = strlen(text);
  memcpy(to, text, length);
  return length;
}

static char *write_document(const document *d, size_t *size) {
  const size_t part = strlen(d->part);
  char *text = malloc(strlen(d->before) + (part + 1) * (size_t)d->count + strlen(d->after));
  assert_non_null(text);
  size_t at = put(text, d->before);
  for (int i = 0; i < d->count; i++) {
    at += put(text + at, i ? "," : "");
    at += put(text + at, d->part);
  }
  *size = at + put(text + at, d->after);
  return text;
}

/* What the child ends with. */
enum { FINE, BROKEN, UNCOUNTED, TOO_MUCH, TOO_EARLY };

static int read_and_compare(const char *text, size_t size, int count, long before) {
  orb_context *own;
  orb_mesh mesh;
  struct rusage used;
  if (orb_context_create(&(orb_context_options){.threads = 1}, &own) != ORB_OK) {
    return BROKEN;
  }
  const orb_status status = orb_mesh_read(own, (const unsigned char *)text, size, ORB_FORMAT_GLTF, &mesh, NULL);
  if (getrusage(RUSAGE_SELF, &used) != 0) {
    return BROKEN;
  }
  const double peak = (double)orb_memory_peak(own) / MEGABYTE;
  const double resident = (double)(used.ru_maxrss - before) / 1024;
  print_message("%.1f MB: %.0f MB counted, %.0f MB resident, status %d\n", (double)size / MEGABYTE, peak, resident,
                (int)status);
  fflush(stdout); /* the process ends without */
  return !ORB_TEST_SANITIZED && resident > peak + SLACK ? UNCOUNTED
         : peak * MEGABYTE > WORST * (double)size       ? TOO_MUCH
         : peak * MEGABYTE < LEAST * (double)count      ? TOO_EARLY
                                                        : FINE;
}

static void test_document(void **state) {
  const document *d = *state;
  size_t size;
  char *text = write_document(d, &size);
  struct rusage before;
  assert_int_equal(getrusage(RUSAGE_SELF, &before), 0);
  const pid_t child = fork();
  assert_true(child >= 0);
  if (child == 0) {
    _exit(read_and_compare(text, size, d->count, before.ru_maxrss));
  }
  int ended = -1;
  assert_int_equal(waitpid(child, &ended, 0), child);
  assert_true(WIFEXITED(ended));
  assert_int_equal(WEXITSTATUS(ended), FINE);
  free(text);
}

#define TRIANGLE                                                                                             \
  "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"data:;base64,"                 \
  "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}]," \
  "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"type\":\"VEC3\",\"count\":3}],"
#define MESH "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}]"

int main(void) {
  static document documents[] = {
      {"nodes", TRIANGLE MESH ",\"nodes\":[", "{\"mesh\":0}", "]}", 330000},
      {"roots", TRIANGLE MESH ",\"nodes\":[{}],\"scenes\":[{\"nodes\":[", "0", "]}]}", 800000},
      {"children", TRIANGLE MESH ",\"nodes\":[{\"children\":[", "1", "]},{}]}", 800000},
      {"parents", TRIANGLE MESH ",\"nodes\":[", "{\"children\":[0]}", "]}", 300000},
      {"meshes", TRIANGLE "\"meshes\":[", "{}", "]}", 450000},
      {"materials", TRIANGLE MESH ",\"materials\":[", "{}", "]}", 450000},
      {"images", TRIANGLE MESH ",\"images\":[", "{}", "]}", 450000},
      {"textures",
       TRIANGLE MESH ",\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],\"textures\":[",
       "{}", "]}", 450000},
      {"primitives", TRIANGLE "\"meshes\":[{\"primitives\":[", "{\"attributes\":{\"POSITION\":0}}", "]}]}", 100000},
      {"buffers", "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[", "{}", "]}", 450000},
  };
  enum { COUNT = sizeof documents / sizeof *documents };
  struct CMUnitTest tests[COUNT];
  for (int i = 0; i < COUNT; i++) {
    tests[i] = (struct CMUnitTest){documents[i].name, test_document, NULL, NULL, &documents[i]};
  }
  return cmocka_run_group_tests(tests, NULL, NULL);
}
