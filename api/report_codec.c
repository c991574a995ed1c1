#include "api/report_codec.h"

#include <math.h>

void orb_certificate_write(orb_text *out, const orb_certificate *certificate) {
  orb_json_open(out, '{');
  orb_json_member_bool(out, "valid", certificate->valid);
  orb_json_member_integer(out, "flipped", certificate->flipped);
  orb_json_member_integer(out, "degenerate", certificate->degenerate);
  orb_json_member_integer(out, "degree", certificate->degree);
  orb_json_member_bool(out, "exact", certificate->exact);
  orb_json_member_number(out, "min_determinant", certificate->min_determinant);
  orb_json_close(out, '}');
}

static void write_measure(orb_text *out, const char *name, const orb_measure *measure) {
  orb_json_key(out, name);
  orb_json_open(out, '{');
  orb_json_member_number(out, "mean", measure->mean);
  orb_json_member_number(out, "median", measure->median);
  orb_json_member_number(out, "p99", measure->p99);
  orb_json_member_number(out, "max", measure->max);
  orb_json_member_number(out, "std", measure->std);
  orb_json_key(out, "histogram");
  orb_json_open(out, '{');
  orb_json_key(out, "edges");
  orb_json_open(out, '[');
  for (int32_t i = 0; measure->bins > 0 && i <= measure->bins; i++) {
    orb_json_number(out, measure->edges[i]);
  }
  orb_json_close(out, ']');
  orb_json_key(out, "counts");
  orb_json_open(out, '[');
  for (int32_t i = 0; i < measure->bins; i++) {
    orb_json_number(out, measure->counts[i]);
  }
  orb_json_close(out, ']');
  orb_json_close(out, '}');
  orb_json_close(out, '}');
}

void orb_distortion_write(orb_text *out, const orb_distortion *distortion) {
  orb_json_open(out, '{');
  write_measure(out, "symmetric_dirichlet", &distortion->symmetric_dirichlet);
  write_measure(out, "angle", &distortion->angle);
  write_measure(out, "area", &distortion->area);
  write_measure(out, "aspect", &distortion->aspect);
  orb_json_member_number(out, "stretch_efficiency", distortion->stretch_efficiency);
  orb_json_close(out, '}');
}

void orb_shape_report_members(orb_text *out, const orb_shape_report *report) {
  double unit = report->diagonal > 0 ? 1 / report->diagonal : NAN;
  double best = isnan(report->hausdorff) ? report->hausdorff_sampled : report->hausdorff;
  orb_json_member_number(out, "hausdorff_relative", best * unit);
  orb_json_member_bool(out, "hausdorff_proved", !isnan(report->hausdorff));
  orb_json_member_number(out, "hausdorff_sampled_relative", report->hausdorff_sampled * unit);
  orb_json_member_number(out, "rms_relative", report->rms * unit);
  orb_json_key(out, "normal_deviation");
  orb_json_open(out, '{');
  orb_json_member_number(out, "mean", report->normal_mean);
  orb_json_member_number(out, "p99", report->normal_p99);
  orb_json_close(out, '}');
  orb_json_member_number(out, "diagonal", report->diagonal);
  orb_json_member_number(out, "min_area_ratio", report->min_area_ratio);
}
