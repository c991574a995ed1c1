#include "warnings.h"

#include <math.h>
#include <string.h>

#include "text.h"

/* A good map of two whole animals has less; docs/bench-truth.md has the energies of many. */
static const double ENERGY_MOST = 2, MEDIAN_MOST = 1.5;
static const double INVERTED_MOST = 0.005;     /* of the triangles */
static const double CONFIDENCE_LEAST = 0.3;    /* of a found landmark */
static const double CLEAR = 0.5;               /* match.clear below it lowers the confidence of all found landmarks */
static const double TOLERANCE_ROUNDING = 1.01; /* a proved bound may exceed the tolerance by rounding */
static const double THIN_MOST = 0.01;          /* of the surface: a patch or two are hardly visible */
static const double TURNED_OVER = 60;          /* degrees of the y axis */

static const cJSON *member(const cJSON *object, const char *name) {
  return cJSON_GetObjectItemCaseSensitive(object, name);
}

static const char *name_of(const cJSON *supermesh, double index) {
  return cli_string(cJSON_GetArrayItem(member(supermesh, "shapes"), (int)index), "name", "?");
}

static int warn_of_pairs(FILE *out, const char *bullet, const cJSON *supermesh) {
  const cJSON *pair;
  int count = 0;
  cJSON_ArrayForEach(pair, member(supermesh, "pairs")) {
    const char *a = name_of(supermesh, cli_number(pair, "a")), *b = name_of(supermesh, cli_number(pair, "b"));
    double inverted = cli_number(pair, "inverted_fraction");
    double median = cli_number(member(member(pair, "distortion"), "symmetric_dirichlet"), "median");
    if (inverted > INVERTED_MOST) {
      fprintf(out, "%s%.2g %% of the triangles between %s and %s are inverted on one of them. Look there with '%s'.\n",
              bullet, 100 * inverted, a, b, "orbmorph view --inside");
      count++;
    }
    if (median > MEDIAN_MOST) {
      fprintf(out, "%sThe map from %s to %s stretches half of the surface (median %.3g; a good map is below %.2g).\n",
              bullet, a, b, median, MEDIAN_MOST);
      count++;
    }
  }
  if (!count && cli_number(supermesh, "energy") > ENERGY_MOST) {
    fprintf(
        out,
        "%sThe maps stretch some places strongly (energy %.3g; a good map is below %.2g). Set a landmark on each limb "
        "that morphs badly.\n",
        bullet, cli_number(supermesh, "energy"), ENERGY_MOST);
    count++;
  }
  return count;
}

/* Where the map is bad, by the largest part of each warning. What gets thin does so on the straight path only. */
static int warn_of_places(FILE *out, const char *bullet, const cJSON *supermesh) {
  const cJSON *warning;
  const int is_rigid = strcmp(cli_string(member(member(supermesh, "request"), "asset"), "path", ""), "rigid") == 0;
  int count = 0;
  cJSON_ArrayForEach(warning, member(supermesh, "warnings")) {
    const char *a = name_of(supermesh, cli_number(warning, "a")), *b = name_of(supermesh, cli_number(warning, "b"));
    const cJSON *at = cJSON_GetArrayItem(member(cJSON_GetArrayItem(member(warning, "parts"), 0), "at"), 0);
    const cJSON *centre = member(at, "centre");
    int thin = strcmp(cli_string(warning, "kind", ""), "thin") == 0;
    double x[3];
    if (thin && (is_rigid || cli_number(warning, "share") <= THIN_MOST)) {
      continue;
    }
    for (int k = 0; k < 3; k++) {
      const cJSON *number = cJSON_GetArrayItem(centre, k);
      x[k] = cJSON_IsNumber(number) ? number->valuedouble : NAN;
    }
    const char *what = thin ? "of the surface gets thin halfway, where a limb is twisted or rotated far"
                            : "of the surface is stretched badly (energy above 20)";
    fprintf(out, "%sFrom %s to %s, %.1f %% %s; look around (%.4g, %.4g, %.4g) of %s, within %.3g.%s\n", bullet, a, b,
            100 * cli_number(warning, "share"), what, x[0], x[1], x[2], a, cli_number(at, "radius"),
            thin ? " A landmark there helps against a twist, --path rigid against a rotation." : "");
    count++;
  }
  return count;
}

/* A place as the client names it: a vertex, or a point of a triangle. */
static void print_place(FILE *out, const cJSON *at) {
  const cJSON *barycentric = member(at, "barycentric");
  if (barycentric) {
    fprintf(out, "triangle %.0f, barycentric %.2f %.2f %.2f", cli_number(at, "triangle"),
            cJSON_GetArrayItem(barycentric, 0)->valuedouble, cJSON_GetArrayItem(barycentric, 1)->valuedouble,
            cJSON_GetArrayItem(barycentric, 2)->valuedouble);
  } else if (member(at, "vertex")) {
    fprintf(out, "vertex %.0f", cli_number(at, "vertex"));
  } else {
    fputs("the place that the report names", out);
  }
}

static int warn_of_suspects(FILE *out, const char *bullet, const cJSON *supermesh) {
  const cJSON *suspect;
  int count = 0;
  cJSON_ArrayForEach(suspect, member(supermesh, "suspects")) {
    const char *name = cli_string(suspect, "name", "");
    char number[32];
    snprintf(number, sizeof number, "%.0f", cli_number(suspect, "landmark"));
    fprintf(out, "%sThe landmark %s may be misplaced: %.0f %% of the distortion is around it. On %s it would lie at ",
            bullet, name[0] ? name : number, 100 * cli_number(suspect, "share"),
            name_of(supermesh, cli_number(suspect, "shape")));
    print_place(out, member(suspect, "at"));
    fprintf(out, ", %.0f %% of the diagonal away.\n", 100 * cli_number(suspect, "distance_relative"));
    count++;
  }
  return count;
}

/* The first part of which a left and a right one were found, such as "front limb"; NULL if there is none. */
static const char *paired_part(const cJSON *supermesh) {
  static const char left[] = "left ", right[] = "right ";
  const cJSON *one, *other;
  cJSON_ArrayForEach(one, member(supermesh, "landmarks")) {
    const char *name = cli_string(one, "name", "");
    if (strncmp(name, left, strlen(left)) != 0) {
      continue;
    }
    const char *part = name + strlen(left);
    cJSON_ArrayForEach(other, member(supermesh, "landmarks")) {
      const char *twin = cli_string(other, "name", "");
      if (strncmp(twin, right, strlen(right)) == 0 && strcmp(twin + strlen(right), part) == 0) {
        return part;
      }
    }
  }
  return NULL;
}

/* The factor by which all found landmarks are less certain because another match is nearly as good. 1: there is none,
 * or a shape was matched as a part, of which the other matches say nothing. */
static double rivalled(const cJSON *supermesh) {
  const cJSON *match = member(supermesh, "match");
  double clear = cli_number(match, "clear");
  return cJSON_IsTrue(member(match, "part")) || !(clear < CLEAR) ? 1 : clear / CLEAR;
}

static void print_choice(FILE *out, const cJSON *supermesh) {
  int others = cJSON_GetArraySize(member(supermesh, "alternatives"));
  if (others > 1) {
    fprintf(out, "Set landmarks, or send one of the %d requests in `alternatives` (Next match in the studio).\n",
            others);
  } else {
    fputs(others ? "Set landmarks, or send the request in `alternatives` (Next match in the studio).\n"
                 : "Set landmarks.\n",
          out);
  }
}

static int warn_of_match(FILE *out, const char *bullet, const cJSON *supermesh) {
  static const char rival[] = "nother match is nearly as good, as where a shape looks alike from several sides. ";
  const cJSON *match = member(supermesh, "match");
  const int is_unsure = strcmp(cli_string(match, "verdict", ""), "unsure") == 0; /* 0 also if landmarks were given */
  const int has_rival = rivalled(supermesh) < CONFIDENCE_LEAST;                  /* makes all landmarks uncertain */
  const char *part = paired_part(supermesh);
  if (!is_unsure && !has_rival) {
    return 0;
  }
  if (is_unsure) {
    fprintf(out, "%sNot sure: the shapes may be matched wrongly%s%s%s (confidence %.2f)%s", bullet,
            part ? ", such as a left " : "", part ? part : "", part ? " with a right one" : "",
            cli_hundredths(cli_number(match, "confidence")), has_rival ? "; a" : ". ");
  } else {
    fprintf(out, "%sA", bullet);
  }
  fputs(has_rival ? rival : "", out);
  print_choice(out, supermesh);
  return 1;
}

/* Where the map nearby is bad: what another match takes from the confidence says nothing of the map. */
static int warn_of_landmarks(FILE *out, const char *bullet, const cJSON *supermesh) {
  const double factor = rivalled(supermesh);
  const cJSON *landmark;
  int count = 0;
  cJSON_ArrayForEach(landmark, member(supermesh, "landmarks")) {
    double confidence = cli_number(landmark, "confidence");
    if (confidence < CONFIDENCE_LEAST * factor) { /* not if it is NAN: landmarks of the request have none */
      fprintf(out, "%s%s%s (%.2g)", count ? ", " : bullet,
              count ? "" : "The map is bad around these found landmarks; set them by hand: ",
              cli_string(landmark, "name", "?"), confidence);
      count++;
    }
  }
  fputs(count ? ".\n" : "", out);
  return count > 0;
}

/* One line names all shapes that are farther from their files than the tolerance allows: --max-triangles takes
 * precedence. */
static int warn_of_errors(FILE *out, const char *bullet, const cJSON *supermesh) {
  double tolerance = cli_number(member(member(supermesh, "request"), "remesh"), "tolerance");
  const cJSON *shape;
  int count = 0;
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    double error = cli_number(shape, "hausdorff_relative");
    if (error > tolerance * TOLERANCE_ROUNDING) {
      fprintf(out, "%s%s%s by up to %.3g %%", count ? ", " : bullet,
              count ? "" : "The morph differs from the files by more than the tolerance, in percent of the diagonal: ",
              cli_string(shape, "name", "?"), 100 * error);
      count++;
    }
  }
  if (count) {
    fprintf(out, " (tolerance %.3g %%).\n", 100 * tolerance);
  }
  return count > 0;
}

/* Where a template is too coarse for a shape: the farthest triangles by their numbers in the first file. */
static int warn_of_template(FILE *out, const char *bullet, const cJSON *supermesh) {
  enum { NAMED = 3 };
  const cJSON *shape;
  int count = 0;
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    const cJSON *coarse = member(shape, "coarse"), *triangles = member(coarse, "triangles");
    if (!coarse) {
      continue;
    }
    fprintf(out,
            "%sThe mesh of %s is too coarse for %s at %.0f of its triangles (%.2g %% of the surface); subdivide it",
            bullet, name_of(supermesh, 0), cli_string(shape, "name", "?"), cli_number(coarse, "count"),
            100 * cli_number(coarse, "share"));
    for (int i = 0; i < NAMED && i < cJSON_GetArraySize(triangles); i++) {
      fprintf(out, "%s %.0f", i ? "," : " around triangle", cJSON_GetNumberValue(cJSON_GetArrayItem(triangles, i)));
    }
    fputs(".\n", out);
    count++;
  }
  return count;
}

static int warn_of_fits(FILE *out, const char *bullet, const cJSON *supermesh) {
  const cJSON *shape;
  int count = 0;
  cJSON_ArrayForEach(shape, member(supermesh, "shapes")) {
    double up = cli_number(member(shape, "fit"), "up_degrees");
    if (up > TURNED_OVER) {
      fprintf(out, "%sThe fit rotated the y axis of %s by %.0f degrees; with --fit none it stays as in its file.\n",
              bullet, cli_string(shape, "name", "?"), up);
      count++;
    }
  }
  return count;
}

int cli_warnings(FILE *out, const char *bullet, const cJSON *supermesh) {
  return warn_of_match(out, bullet, supermesh) + warn_of_suspects(out, bullet, supermesh) +
         warn_of_pairs(out, bullet, supermesh) + warn_of_places(out, bullet, supermesh) +
         warn_of_landmarks(out, bullet, supermesh) + warn_of_errors(out, bullet, supermesh) +
         warn_of_template(out, bullet, supermesh) + warn_of_fits(out, bullet, supermesh);
}
