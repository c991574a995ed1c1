#include "report.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "problem.h"
#include "terminal.h"
#include "text.h"
#include "warnings.h"

/* Rims no farther apart lie on each other but for rounding, relative to the diagonal. */
static const double RIM_EXACT = 1e-6;
/* Relative distances below this are rounding of double numbers, and printed as 0. */
static const double ROUNDING = 1e-12;

static const cJSON *member(const cJSON *object, const char *name) {
  return cJSON_GetObjectItemCaseSensitive(object, name);
}

void cli_print_repairs(const cJSON *mesh) {
  const cJSON *repair;
  cJSON_ArrayForEach(repair, member(mesh, "repairs")) {
    char count[32];
    cli_count(cli_number(repair, "count"), count);
    const cJSON *loop = member(repair, "loop");
    if (loop) {
      printf("  repaired: close_handles (%s along a loop of %d vertices, %.2g of the diagonal, at vertex %.0f)\n",
             cli_string(repair, "how", "?"), cJSON_GetArraySize(loop), cli_number(repair, "length_relative"),
             cJSON_GetNumberValue(cJSON_GetArrayItem(loop, 0)));
      continue;
    }
    printf("  repaired: %s (%s)\n", cli_string(repair, "kind", "?"), count);
  }
}

void cli_print_mesh(const cJSON *mesh) {
  char vertices[32], triangles[32];
  cli_count(cli_number(mesh, "vertices"), vertices);
  cli_count(cli_number(mesh, "triangles"), triangles);
  printf("%s  %s: %s vertices, %s triangles\n", cli_string(mesh, "id", "?"), cli_string(mesh, "name", ""), vertices,
         triangles);
  cli_print_repairs(mesh);
}

void cli_print_embedding(const cJSON *embedding) {
  const cJSON *certificate = member(embedding, "certificate"), *distortion = member(embedding, "distortion");
  const cJSON *dirichlet = member(distortion, "symmetric_dirichlet");
  printf("%s  %s\n", cli_string(embedding, "id", "?"), cli_string(embedding, "method", ""));
  printf("  certificate: %s, %.0f flipped, degree %.0f\n",
         cJSON_IsTrue(member(certificate, "valid")) ? "valid" : "not valid", cli_number(certificate, "flipped"),
         cli_number(certificate, "degree"));
  printf("  symmetric Dirichlet energy: mean %.3g, median %.3g, worst %.3g\n", cli_number(dirichlet, "mean"),
         cli_number(dirichlet, "median"), cli_number(dirichlet, "max"));
  printf("  stretch efficiency: %.3g\n", cli_number(distortion, "stretch_efficiency"));
  printf("  time: %.3g s\n", cli_number(member(embedding, "timings_ms"), "total") / 1000);
}

void cli_print_job(const cJSON *job) {
  double progress = cli_number(job, "progress");
  const cJSON *problem = cJSON_GetObjectItemCaseSensitive(job, "problem");
  printf("%s  %-10s %-9s %3.0f %%  %s\n", cli_string(job, "id", "?"), cli_string(job, "kind", "?"),
         cli_string(job, "state", "?"), isfinite(progress) ? 100 * progress : 0,
         cJSON_IsObject(problem) ? cli_problem_type(problem) : cli_string(job, "result", cli_string(job, "stage", "")));
}

/* "0.04 %", or "?" if it was not measured. */
static void percent(double fraction, char out[32]) {
  if (isfinite(fraction)) {
    snprintf(out, 32, "%.3g %%", fabs(fraction) < ROUNDING ? 0 : 100 * fraction);
  } else {
    snprintf(out, 32, "?");
  }
}

/* The landmarks of one kind, and the largest distance of one from its given place, as a fraction of the diagonal. */
typedef struct landmark_group {
  int count;
  double worst;
} landmark_group;

/* A weight below 1 lets a landmark give way. The daemon writes it only then. */
static int is_soft(const cJSON *landmark) {
  return cli_number(landmark, "weight") < 1;
}

static landmark_group landmarks_of(const cJSON *supermesh, int soft) {
  landmark_group group = {0};
  const cJSON *landmark, *residual;
  cJSON_ArrayForEach(landmark, member(supermesh, "landmarks")) {
    if (is_soft(landmark) != soft) {
      continue;
    }
    group.count++;
    cJSON_ArrayForEach(residual, member(landmark, "residual_relative")) {
      if (cJSON_IsNumber(residual) && residual->valuedouble > group.worst) {
        group.worst = residual->valuedouble;
      }
    }
  }
  return group;
}

/* "1 soft landmark, up to 4.68 % of the diagonal from its place". The comma is the link for one and for several. */
static void write_soft(FILE *out, landmark_group soft, const char *one, const char *several) {
  const int is_one = soft.count == 1;
  char worst[32], apart[64] = "at";
  if (soft.worst >= ROUNDING) {
    percent(soft.worst, worst);
    snprintf(apart, sizeof apart, "up to %s of the diagonal from", worst);
  }
  fprintf(out, "%d soft landmark%s%s %s %s", soft.count, is_one ? "" : "s", is_one ? one : several, apart,
          is_one ? "its place" : "their places");
}

/* The daemon found the landmarks: the request gave none. */
static int were_found(const cJSON *supermesh) {
  return member(cJSON_GetArrayItem(member(supermesh, "landmarks"), 0), "vertex") == NULL;
}

/* The landmarks of the request came from a match that was found: only places that a user set are called exact. */
static int were_guessed(const cJSON *supermesh) {
  const cJSON *landmark;
  cJSON_ArrayForEach(landmark, member(member(supermesh, "request"), "landmarks")) {
    if (cli_number(landmark, "confidence") < 1) {
      return 1;
    }
  }
  return 0;
}

static int is_moved(const cJSON *shape) {
  const cJSON *fit = member(shape, "fit");
  return fit && strcmp(cli_string(fit, "kind", "none"), "none") != 0;
}

static void write_fit(FILE *out, const cJSON *shape) {
  const cJSON *fit = member(shape, "fit");
  fprintf(out, "moved onto the first shape: scaled by %.3g, rotated by %.0f°, moved by %.2g diagonals%s\n",
          cli_number(fit, "scale"), cli_number(fit, "rotation_degrees"), cli_number(fit, "translation_relative"),
          cli_number(fit, "up_degrees") > 60 ? "; its y axis tilts by more than 60°" : "");
}

/* A line for each shape that the asset has moved. */
static void print_fits(const cJSON *supermesh) {
  const cJSON *shape;
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    if (is_moved(shape)) {
      printf("  %-16s ", cli_string(shape, "name", "?"));
      write_fit(stdout, shape);
    }
  }
}

/* "rim of hole 1 to rim of hole 1 (48 and 52 edges), at most 0.1 % of the diagonal apart" */
static void write_rim(FILE *out, const cJSON *rim) {
  char off[32];
  percent(cli_number(rim, "off_relative"), off);
  fprintf(out, "rim of hole %.0f to rim of hole %.0f (%.0f and %.0f edges), ", cli_number(member(rim, "base"), "hole"),
          cli_number(member(rim, "other"), "hole"), cli_number(member(rim, "base"), "edges"),
          cli_number(member(rim, "other"), "edges"));
  if (cli_number(rim, "off_relative") < RIM_EXACT) {
    fputs("exact", out);
  } else {
    fprintf(out, "at most %s of the diagonal apart", off);
  }
}

/* A line for each pair of rims that lie on each other. */
static void print_rims(const cJSON *supermesh) {
  const cJSON *rim;
  cJSON_ArrayForEach(rim, member(supermesh, "rims")) {
    const cJSON *shape = cJSON_GetArrayItem(member(supermesh, "shapes"), (int)cli_number(rim, "shape"));
    printf("  %-16s ", cli_string(shape, "name", "?"));
    write_rim(stdout, rim);
    putchar('\n');
  }
}

/* Whether the surface is closed, and how many holes of it are open in the asset. */
static void surface_of(const cJSON *supermesh, char out[64]) {
  const double open = fmax(cli_number(supermesh, "open_holes"), 0);
  const int closed = cJSON_IsTrue(member(member(supermesh, "certificate"), "closed"));
  (void)snprintf(out, 64, "%s", closed ? "closed" : "not closed");
  if (open > 0) {
    (void)snprintf(out, 64, "open at %.0f hole%s", open, open > 1 ? "s" : "");
  }
}

/* A line about the landmarks of the request. Only those that had to meet are exact or not. */
static void print_landmarks(const cJSON *supermesh) {
  const landmark_group firm = landmarks_of(supermesh, 0), soft = landmarks_of(supermesh, 1);
  char worst[32];
  fputs("  ", stdout);
  if (firm.count) {
    percent(firm.worst, worst);
    printf("%d landmark%s, %s (distance at most %s)", firm.count, firm.count > 1 ? "s" : "",
           were_guessed(supermesh)                                                     ? "from a found match"
           : cJSON_IsTrue(member(member(supermesh, "certificate"), "landmarks_exact")) ? "exact"
                                                                                       : "not exact",
           worst);
  }
  if (soft.count) {
    fputs(firm.count ? "; " : "", stdout);
    write_soft(stdout, soft, ",", ",");
  }
  putchar('\n');
}

void cli_print_supermesh(const cJSON *supermesh) {
  char vertices[32], triangles[32], error[32], rms[32], surface[64];
  const cJSON *shape, *certificate = member(supermesh, "certificate");
  int landmarks = cJSON_GetArraySize(member(supermesh, "landmarks"));
  cli_count(cli_number(supermesh, "vertices"), vertices);
  cli_count(cli_number(supermesh, "triangles"), triangles);
  surface_of(supermesh, surface);
  printf("%s: %s vertices, %s triangles, %s, genus %.0f\n", cli_string(supermesh, "url", "?"), vertices, triangles,
         surface, cli_number(certificate, "genus"));
  if (member(supermesh, "asset_triangles")) {
    cli_count(cli_number(supermesh, "asset_triangles"), triangles);
    printf("  the asset has %s triangles\n", triangles);
  }
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    percent(cli_number(shape, "hausdorff_relative"), error);
    percent(cli_number(shape, "rms_relative"), rms);
    printf("  %-16s distance to its input: at most %s of the diagonal, RMS %s\n", cli_string(shape, "name", "?"), error,
           rms);
  }
  print_fits(supermesh);
  print_rims(supermesh);
  if (landmarks && were_found(supermesh)) {
    printf("  %d landmarks found; 'orbmorph get %s --json' prints them\n", landmarks,
           cli_string(supermesh, "url", "?"));
  } else if (landmarks) {
    print_landmarks(supermesh);
  }
  int dropped = cJSON_GetArraySize(member(supermesh, "dropped"));
  if (dropped) {
    printf("  not in the asset: %d %s of the files, which a report names (--report)\n", dropped,
           dropped == 1 ? "part" : "parts");
  }
  const cJSON *match = member(supermesh, "match");
  if (match) {
    printf("  match: %s (confidence %.2f)\n", cli_string(match, "verdict", "?"),
           cli_hundredths(cli_number(match, "confidence")));
  }
  cli_warnings(stdout, "  warning: ", supermesh);
  printf("  time: %.3g s\n", cli_number(member(supermesh, "timings_ms"), "total") / 1000);
}

/* A text from a file, in a cell of a table. */
static void markdown_text(FILE *out, const char *text) {
  for (; *text; text++) {
    if (strchr("|\\`*_<>[]", *text)) {
      fputc('\\', out);
    }
    fputc((unsigned char)*text < ' ' ? ' ' : *text, out);
  }
}

static void markdown_dropped(FILE *out, const cJSON *supermesh) {
  const cJSON *entry, *list = member(supermesh, "dropped");
  if (!cJSON_GetArraySize(list)) {
    return;
  }
  fputs("\n## Not in the asset\n\n| what | where | why |\n|---|---|---|\n", out);
  cJSON_ArrayForEach(entry, list) {
    fputs("| ", out);
    markdown_text(out, cli_string(entry, "what", "?"));
    fputs(" | ", out);
    markdown_text(out, cli_string(entry, "where", ""));
    fprintf(out, " | %s |\n", cli_string(entry, "why", ""));
  }
}

static void markdown_rims(FILE *out, const cJSON *supermesh) {
  const cJSON *rim, *list = member(supermesh, "rims");
  if (!cJSON_GetArraySize(list)) {
    return;
  }
  fputs("\n## Holes that correspond\n\n", out);
  cJSON_ArrayForEach(rim, list) {
    const cJSON *shape = cJSON_GetArrayItem(member(supermesh, "shapes"), (int)cli_number(rim, "shape"));
    fputs("* ", out);
    markdown_text(out, cli_string(shape, "name", "?"));
    fputs(": ", out);
    write_rim(out, rim);
    fputs("\n", out);
  }
}

static void markdown_shapes(FILE *out, const cJSON *supermesh) {
  const cJSON *shape;
  fputs(
      "| shape | distance to input, maximum | distance, RMS | normal deviation, mean | normal deviation, 99th "
      "percentile |\n"
      "|---|---|---|---|---|\n",
      out);
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    char error[32], rms[32];
    const cJSON *normals = member(shape, "normal_deviation");
    percent(cli_number(shape, "hausdorff_relative"), error);
    percent(cli_number(shape, "rms_relative"), rms);
    fputs("| ", out);
    markdown_text(out, cli_string(shape, "name", "?"));
    fprintf(out, " | %s | %s | %.3g° | %.3g° |\n", error, rms, cli_number(normals, "mean"), cli_number(normals, "p99"));
  }
  fputs("\nDistances are fractions of the diagonal of each shape's bounding box.\n", out);
}

/* What the fit did to each shape that the asset has moved. */
static void markdown_fits(FILE *out, const cJSON *supermesh) {
  const cJSON *shape;
  int count = 0;
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    if (is_moved(shape)) {
      fputs(count++ ? "* " : "\n* ", out);
      markdown_text(out, cli_string(shape, "name", "?"));
      fputs(": ", out);
      write_fit(out, shape);
    }
  }
}

static void markdown_numbers(FILE *out, const char *title, const cJSON *object) {
  const cJSON *item;
  fprintf(out, "\n%s:", title);
  cJSON_ArrayForEach(item, object) {
    if (cJSON_IsNumber(item)) {
      fprintf(out, " %s %.*f%s", item->string, item->valuedouble < 100 ? 1 : 0, item->valuedouble,
              item->next ? "," : ".");
    }
  }
  fputc('\n', out);
}

/* How well the landmarks meet, in sentences. */
static void markdown_meeting(FILE *out, const cJSON *supermesh) {
  const landmark_group firm = landmarks_of(supermesh, 0), soft = landmarks_of(supermesh, 1);
  if (were_found(supermesh)) {
    fputs("The request gave no landmarks; orbmorph found these. Check them before you rely on the result.", out);
    return;
  }
  if (firm.count) {
    const int is_met = cJSON_IsTrue(member(member(supermesh, "certificate"), "landmarks_exact"));
    if (soft.count) {
      fprintf(out, "%d landmark%s", firm.count, firm.count > 1 ? "s" : "");
    } else {
      fputs(is_met && !were_guessed(supermesh) ? "All landmarks" : "The landmarks", out);
    }
    fputs(!is_met                         ? " coincide only approximately."
          : were_guessed(supermesh)       ? " coincide. They come from a match that orbmorph found."
          : firm.count == 1 && soft.count ? " coincides exactly."
                                          : " coincide exactly.",
          out);
  }
  if (soft.count) {
    fputs(firm.count ? " " : "", out);
    write_soft(out, soft, " stays", " stay");
    fputs(".", out);
  }
}

static void markdown_landmarks(FILE *out, const cJSON *supermesh) {
  const cJSON *landmark, *residual;
  if (!cJSON_GetArraySize(member(supermesh, "landmarks"))) {
    return;
  }
  const int shares = member(cJSON_GetArrayItem(member(supermesh, "landmarks"), 0), "share") != NULL;
  fputs("\n## Landmarks\n\n", out);
  markdown_meeting(out, supermesh);
  fputs(shares ? "\n\n| landmark | distance on each shape | share of the distortion around it |\n|---|---|---|\n"
               : "\n\n| landmark | distance on each shape |\n|---|---|\n",
        out);
  cJSON_ArrayForEach(landmark, member(supermesh, "landmarks")) {
    fputs("| ", out);
    markdown_text(out, cli_string(landmark, "name", ""));
    if (is_soft(landmark)) {
      fprintf(out, " (weight %.3g)", cli_number(landmark, "weight"));
    }
    fputs(" |", out);
    cJSON_ArrayForEach(residual, member(landmark, "residual_relative")) {
      char text[32];
      percent(cJSON_IsNumber(residual) ? residual->valuedouble : NAN, text);
      fprintf(out, " %s%s", text, residual->next ? "," : "");
    }
    if (shares) {
      fprintf(out, " | %.0f %%", 100 * cli_number(landmark, "share"));
    }
    fputs(" |\n", out);
  }
}

/* A section of the warnings, if there are any; collected first, to know that. */
static void markdown_warnings(FILE *out, const cJSON *supermesh) {
  char *text = NULL;
  size_t size = 0;
  FILE *memory = open_memstream(&text, &size);
  int count = memory ? cli_warnings(memory, "* ", supermesh) : 0;
  if (memory && fclose(memory) == 0 && count) {
    fprintf(out, "## Warnings\n\n%s\n", text);
  }
  free(text);
}

static void markdown(FILE *out, const cJSON *supermesh) {
  char vertices[32], triangles[32], surface[64];
  const cJSON *shape, *certificate = member(supermesh, "certificate");
  fputs("# Morph of ", out);
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    markdown_text(out, cli_string(shape, "name", "?"));
    fputs(shape->next ? ", " : "\n\n", out);
  }
  cli_count(cli_number(supermesh, "vertices"), vertices);
  cli_count(cli_number(supermesh, "triangles"), triangles);
  surface_of(supermesh, surface);
  fprintf(out, "One mesh of %s vertices and %s triangles, %s, genus %.0f. Resource `%s`, made by %s.\n\n", vertices,
          triangles, surface, cli_number(certificate, "genus"), cli_string(supermesh, "url", "?"),
          cli_string(supermesh, "engine", "?"));
  const cJSON *match = member(supermesh, "match");
  if (match) {
    fprintf(out, "The correspondence was found without landmarks; verdict: %s (confidence %.2f).\n\n",
            cli_string(match, "verdict", "?"), cli_hundredths(cli_number(match, "confidence")));
  }
  markdown_warnings(out, supermesh);
  markdown_shapes(out, supermesh);
  markdown_fits(out, supermesh);
  markdown_landmarks(out, supermesh);
  markdown_rims(out, supermesh);
  markdown_dropped(out, supermesh);
  fputs("\n## Time\n", out);
  markdown_numbers(out, "Milliseconds", member(supermesh, "timings_ms"));
}

int cli_write_report(cli *c, const char *path, const cli_reply *supermesh) {
  size_t length = strlen(path);
  FILE *out = fopen(path, "wb");
  if (out && length > 3 && !strcasecmp(path + length - 3, ".md")) {
    markdown(out, supermesh->json);
  } else if (out) {
    fprintf(out, "%s\n", supermesh->body);
  }
  if (!out || fclose(out) != 0) {
    cli_error(c, "%s: %s", path, strerror(errno));
    return CLI_USAGE;
  }
  return CLI_DONE;
}
