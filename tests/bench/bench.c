/* The command line. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "api/embedding_codec.h"
#include "api/json.h"
#include "bench.h"

#define WORD(id, function, name, heeds) name,
#define LISTED(id, function, name, heeds) " " name
static const char usage_text[] =
    "usage: orbmorph-bench embed [options] FILE...\n"
    "       orbmorph-bench merge [options] A B [C...]\n"
    "       orbmorph-bench landmarks [options] A B [C...]\n"
    "       orbmorph-bench pairs [options] A B [C...]\n"
    "       orbmorph-bench truth [options] --landmarks FILE A B\n"
    "       orbmorph-bench remesh [options] (--bodies N,N... | [--keep FILE] A B [C...])\n"
    "\n"
    "Measures the library in-process and prints one JSON object per repeat, each on its own line.\n"
    "  --method M        newton (default) or kernel-sampling\n"
    "  --preset P        default, fast or quality\n"
    "  --options JSON    embedding options as in a request: '{\"energy_weight\":0}'\n"
    "  --repair LIST     safe (default), none, fill_holes, largest_component, split_nonmanifold,\n"
    "                    close_handles, as for an upload\n"
    "  --threads N       number of threads (default: one per processor)\n"
    "  --cpu C           auto (default), avx512, avx2 or plain: the widest vector instructions to use\n"
    "  --repeat N        runs per file (1)\n"
    "  --out DIR         embed: write DIR/NAME.sphere.ply\n"
    "  --out FILE.glb    merge: write the asset\n"
    "  --align M         pin (default with landmarks), rbf, rotate or auto (default without)\n"
    "  --align-preset P  default, fast (default of landmarks) or quality\n"
    "  --remesh M        one of:" ORB_REMESH_METHODS(LISTED) " (adaptive)\n"
    "  --tolerance X     adaptive: relative to the diagonal (0.001)\n"
    "  --max-triangles N\n"
    "  --landmarks FILE  a landmarks array, alone or as the member \"landmarks\"\n"
    "landmarks pins sets of random landmarks on pairs of the files; pairs merges every pair of them:\n"
    "  --sets N          number of landmark sets (100) or pairs (all)\n"
    "  --first N         first set or pair (0); a set depends only on the seed and its number\n"
    "  --seed N          (1)\n"
    "  --sizes LIST      landmarks per set; the sets cycle through the list (3,10,30,60); or 'awkward'\n"
    "  --merge-every N   also remesh every N-th set (0: none)\n"
    "  --seconds N       abandon a set or pair after N seconds (0: never)\n"
    "truth measures how accurate the map from A to B is:\n"
    "  --given N         align by the first N landmarks and measure at the rest (all)\n"
    "  --methods LIST    of rotate, rbf, fast, default, quality, auto (all of them)\n"
    "  --bodies N,N,...  remesh: generate one body for each number of triangles\n"
    "  --keep FILE       remesh: save the alignment to FILE, or load it if FILE exists\n"
    "  --version, --help\n"
    "Exit status: 0 done, 1 refused (the reason is on standard error), 2 wrong usage.\n";

static int wrong(const char *message, const char *what) {
  fprintf(stderr, "orbmorph-bench: %s%s\nTry orbmorph-bench --help.\n", message, what);
  return 0;
}

static int read_integer(const char *name, const char *text, long least, long most, long *out) {
  char *end;
  errno = 0;
  long value = strtol(text, &end, 10);
  if (errno || end == text || *end || value < least || value > most) {
    fprintf(stderr, "orbmorph-bench: %s must be from %ld to %ld, not '%s'\n", name, least, most, text);
    return 0;
  }
  *out = value;
  return 1;
}

static int read_word(const char *name, const char *text, const char *const *words, int *out) {
  for (int i = 0; words[i]; i++) {
    if (strcmp(text, words[i]) == 0) {
      *out = i;
      return 1;
    }
  }
  fprintf(stderr, "orbmorph-bench: %s cannot be '%s'; it is one of", name, text);
  for (int i = 0; words[i]; i++) {
    fprintf(stderr, " %s", words[i]);
  }
  fputc('\n', stderr);
  return 0;
}

/* Parses the options with the table of the API, so names and ranges are those of a request. */
static int read_options(const char *text, orb_embed_options *options) {
  api_text request = {0};
  api_problem problem = {0};
  api_json_error error;
  orb_embed_method method = options->method;
  api_text_printf(&request, "{\"options\":%s}", text);
  cJSON *body = request.failed ? NULL : api_json_parse(request.data, request.size, &error);
  int fine = body ? api_embedding_options_read(body, "--options", 0, options, &problem)
                  : wrong("--options must be a JSON object, not ", text);
  if (body && !fine) {
    fprintf(stderr, "orbmorph-bench: %s\n", problem.detail);
  }
  options->method = method;
  api_problem_free(&problem);
  cJSON_Delete(body);
  api_text_free(&request);
  return fine;
}

typedef struct texts {
  const char *method, *preset, *options, *repair, *threads, *repeat, *cpu, *align, *remesh, *tolerance, *max_triangles,
      *sets, *align_preset, *first, *seed, *merge_every, *seconds, *given;
} texts;

static int interpret(const texts *t, bench_options *o) {
  static const char *const methods[] = {"newton", "kernel-sampling", NULL};
  static const char *const presets[] = {"default", "fast", "quality", NULL};
  static const char *const cpus[] = {"auto", "plain", "avx2", "avx512", NULL};
  static const char *const aligns[] = {"pin", "rbf", "rotate", "auto", NULL};
  static const char *const remeshes[] = {ORB_REMESH_METHODS(WORD) NULL};
  int word = 0;
  long number = 0;
  if (t->options && !read_options(t->options, &o->embed)) {
    return 0;
  }
  if (t->repair) {
    api_problem problem = {0};
    char canonical[API_REPAIR_TEXT];
    int fine =
        api_repair_parse(t->repair, NULL, NULL, &o->repair, canonical, &problem) || wrong("--repair: ", problem.detail);
    api_problem_free(&problem);
    if (!fine) {
      return 0;
    }
  }
  if (t->method) {
    if (!read_word("--method", t->method, methods, &word)) {
      return 0;
    }
    o->embed.method = (orb_embed_method)word;
  }
  if (t->preset) {
    if (!read_word("--preset", t->preset, presets, &word)) {
      return 0;
    }
    o->embed.preset = (orb_preset)word;
  }
  if (t->align_preset) {
    if (!read_word("--align-preset", t->align_preset, presets, &word)) {
      return 0;
    }
    o->merge.align.preset = (orb_preset)word;
  }
  if (t->cpu) {
    if (!read_word("--cpu", t->cpu, cpus, &word)) {
      return 0;
    }
    o->cpu = (orb_cpu)word;
  }
  if (t->align) {
    if (!read_word("--align", t->align, aligns, &word)) {
      return 0;
    }
    o->merge.align.method = (orb_align_method)word;
    o->align_given = 1;
  }
  if (t->remesh) {
    if (!read_word("--remesh", t->remesh, remeshes, &word)) {
      return 0;
    }
    o->merge.remesh.method = (orb_remesh_method)word;
  }
  if (t->threads) {
    if (!read_integer("--threads", t->threads, 1, 64, &number)) {
      return 0;
    }
    o->threads = (int)number;
  }
  if (t->repeat) {
    if (!read_integer("--repeat", t->repeat, 1, 1000000, &number)) {
      return 0;
    }
    o->repeat = (int)number;
  }
  if (t->max_triangles) {
    if (!read_integer("--max-triangles", t->max_triangles, 4, 1000000000, &number)) {
      return 0;
    }
    o->merge.remesh.max_triangles = number;
  }
  if (t->tolerance) {
    char *end;
    double value = strtod(t->tolerance, &end);
    if (end == t->tolerance || *end || !(value > 0 && value <= 1)) {
      return wrong("--tolerance must be above 0 and at most 1, not ", t->tolerance);
    }
    o->merge.remesh.tolerance = value;
  }
  return 1;
}

static int interpret_numbers(const texts *t, bench_options *o) {
  long seed = (long)o->seed;
  const struct {
    const char *name, *text;
    long least, most, *out;
  } table[] = {{"--sets", t->sets, 1, 1000000, &o->sets},
               {"--first", t->first, 0, 1000000000, &o->first},
               {"--seed", t->seed, 0, 1000000000, &seed},
               {"--merge-every", t->merge_every, 0, 1000000, &o->merge_every},
               {"--seconds", t->seconds, 0, 1000000, &o->seconds},
               {"--given", t->given, 0, 1000000, &o->given}};
  for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
    if (table[i].text && !read_integer(table[i].name, table[i].text, table[i].least, table[i].most, table[i].out)) {
      return 0;
    }
  }
  o->seed = (uint64_t)seed;
  return 1;
}

/* Commands as bits, for the table of options. */
enum { EMBED = 1, MERGE = 2, LANDMARKS = 4, PAIRS = 8, TRUTH = 16, REMESH = 32, ALL = 63 };

static int parse(int argc, char **argv, int command, bench_options *o) {
  texts t = {0};
  const struct {
    const char *name;
    const char **place;
    int commands;
  } table[] = {{"--method", &t.method, ALL},
               {"--preset", &t.preset, ALL},
               {"--options", &t.options, ALL},
               {"--repair", &t.repair, ALL},
               {"--threads", &t.threads, ALL},
               {"--repeat", &t.repeat, EMBED | MERGE | REMESH},
               {"--cpu", &t.cpu, EMBED | MERGE | REMESH},
               {"--out", &o->out, EMBED | MERGE | REMESH},
               {"--align", &t.align, MERGE | LANDMARKS | PAIRS | REMESH},
               {"--align-preset", &t.align_preset, MERGE | LANDMARKS | PAIRS | REMESH},
               {"--remesh", &t.remesh, ALL & ~EMBED},
               {"--landmarks", &o->landmarks, MERGE | TRUTH | REMESH},
               {"--tolerance", &t.tolerance, ALL & ~EMBED},
               {"--max-triangles", &t.max_triangles, ALL & ~EMBED},
               {"--sets", &t.sets, LANDMARKS | PAIRS},
               {"--first", &t.first, LANDMARKS | PAIRS},
               {"--seed", &t.seed, LANDMARKS},
               {"--sizes", &o->sizes, LANDMARKS},
               {"--merge-every", &t.merge_every, LANDMARKS},
               {"--seconds", &t.seconds, LANDMARKS | PAIRS},
               {"--given", &t.given, TRUTH},
               {"--methods", &o->methods, TRUTH},
               {"--bodies", &o->bodies, REMESH},
               {"--keep", &o->keep, REMESH}};
  int plain = 0;
  for (int i = 2; i < argc; i++) {
    if (plain || argv[i][0] != '-' || !argv[i][1]) {
      o->files[o->file_count++] = argv[i];
      continue;
    }
    if (strcmp(argv[i], "--") == 0) {
      plain = 1;
      continue;
    }
    const char *value = strchr(argv[i], '=');
    size_t length = value ? (size_t)(value - argv[i]) : strlen(argv[i]), k = 0;
    while (k < sizeof table / sizeof table[0] &&
           (strlen(table[k].name) != length || strncmp(table[k].name, argv[i], length) != 0 ||
            !(table[k].commands & command))) {
      k++;
    }
    if (k == sizeof table / sizeof table[0]) {
      return wrong("unknown option ", argv[i]);
    }
    if (!value && i + 1 == argc) {
      return wrong("a value is missing after ", argv[i]);
    }
    *table[k].place = value ? value + 1 : argv[++i];
  }
  if (o->file_count < (command == EMBED ? 1 : 2) && !o->bodies && !o->keep) {
    return wrong(command == EMBED ? "embed needs a file" : "two files or more are needed", "");
  }
  if ((command == MERGE || command == REMESH) && o->file_count > API_SHAPES_MAX) {
    return wrong("merge takes 16 files at most", "");
  }
  if (command == TRUTH && (o->file_count > 2 || !o->landmarks)) {
    return wrong(o->landmarks ? "truth takes two files" : "truth needs --landmarks", "");
  }
  return interpret(&t, o) && interpret_numbers(&t, o);
}

/* As the processes of the daemon's jobs. The C library reads the variable only when a program starts, so this one
 * starts again, once. */
static void take_heap(char **argv) {
  static const char again[] = "ORB_BENCH_STARTED";
  const char *set = getenv(ORB_HEAP_VARIABLE);
  if (!set && !getenv(again)) {
    char self[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    self[length > 0 ? length : 0] = '\0';
    if (setenv(again, "1", 1) == 0 && setenv(ORB_HEAP_VARIABLE, ORB_HEAP_TUNABLES, 1) == 0) {
      (void)execv(self, argv);
    }
    fputs("orbmorph-bench: the heap has no huge pages, so times are longer than in the daemon\n", stderr);
  }
  orb_keep_heap();
}

int main(int argc, char **argv) {
  take_heap(argv);
  if ((argc >= 2 && strcmp(argv[1], "--help") == 0) || (argc == 3 && strcmp(argv[2], "--help") == 0)) {
    fputs(usage_text, stdout);
    return BENCH_DONE;
  }
  if (argc >= 2 && strcmp(argv[1], "--version") == 0) {
    puts(ORB_ENGINE);
    return BENCH_DONE;
  }
  static int (*const run[])(const bench_options *) = {bench_embed, bench_merge, bench_landmarks,
                                                      bench_pairs, bench_truth, bench_remesh};
  static const char *const commands[] = {"embed", "merge", "landmarks", "pairs", "truth", "remesh", NULL};
  int command = 0;
  while (argc >= 2 && commands[command] && strcmp(argv[1], commands[command]) != 0) {
    command++;
  }
  if (argc < 2 || !commands[command]) {
    fputs(usage_text, stderr);
    return BENCH_USAGE;
  }
  bench_options options = {.repeat = 1,
                           .repair = {.repair = ORB_REPAIR_SAFE},
                           .sizes = "3,10,30,60",
                           .sets = 1 << command == PAIRS ? 1000000 : 100,
                           .seed = 1,
                           .given = -1,
                           .files = calloc((size_t)argc, sizeof *options.files)};
  orb_embed_defaults(&options.embed);
  orb_merge_defaults(&options.merge);
  options.merge.align.preset = 1 << command == LANDMARKS ? ORB_PRESET_FAST : ORB_PRESET_DEFAULT;
  int status = BENCH_USAGE;
  if (options.files && parse(argc, argv, 1 << command, &options)) {
    status = run[command](&options);
  }
  free(options.files);
  return status;
}
