#include "api/report_codec.h"

#include <math.h>

void api_certificate_write(api_text *out, const orb_certificate *certificate) {
  api_json_open(out, '{');
  api_json_member_bool(out, "valid", certificate->valid);
  api_json_member_integer(out, "flipped", certificate->flipped);
  api_json_member_integer(out, "degenerate", certificate->degenerate);
  api_json_member_integer(out, "degree", certificate->degree);
  api_json_member_bool(out, "exact", certificate->exact);
  api_json_member_number(out, "min_determinant", certificate->min_determinant);
  api_json_close(out, '}');
}

static void write_measure(api_text *out, const char *name, const orb_measure *measure) {
  api_json_key(out, name);
  api_json_open(out, '{');
  api_json_member_number(out, "mean", measure->mean);
  api_json_member_number(out, "median", measure->median);
  api_json_member_number(out, "p99", measure->p99);
  api_json_member_number(out, "max", measure->max);
  api_json_member_number(out, "std", measure->std);
  api_json_key(out, "histogram");
  api_json_open(out, '{');
  api_json_key(out, "edges");
  api_json_open(out, '[');
  for (int32_t i = 0; measure->bins > 0 && i <= measure->bins; i++) {
    api_json_number(out, measure->edges[i]);
  }
  api_json_close(out, ']');
  api_json_key(out, "counts");
  api_json_open(out, '[');
  for (int32_t i = 0; i < measure->bins; i++) {
    api_json_number(out, measure->counts[i]);
  }
  api_json_close(out, ']');
  api_json_close(out, '}');
  api_json_close(out, '}');
}

void api_distortion_write(api_text *out, const orb_distortion *distortion) {
  api_json_open(out, '{');
  write_measure(out, "symmetric_dirichlet", &distortion->symmetric_dirichlet);
  write_measure(out, "angle", &distortion->angle);
  write_measure(out, "area", &distortion->area);
  write_measure(out, "aspect", &distortion->aspect);
  api_json_member_number(out, "stretch_efficiency", distortion->stretch_efficiency);
  api_json_close(out, '}');
}

void api_shape_report_members(api_text *out, const orb_shape_report *report) {
  double unit = report->diagonal > 0 ? 1 / report->diagonal : NAN;
  double best = isnan(report->hausdorff) ? report->hausdorff_sampled : report->hausdorff;
  api_json_member_number(out, "hausdorff_relative", best * unit);
  api_json_member_bool(out, "hausdorff_proved", !isnan(report->hausdorff));
  api_json_member_number(out, "hausdorff_sampled_relative", report->hausdorff_sampled * unit);
  api_json_member_number(out, "rms_relative", report->rms * unit);
  api_json_key(out, "normal_deviation");
  api_json_open(out, '{');
  api_json_member_number(out, "mean", report->normal_mean);
  api_json_member_number(out, "p99", report->normal_p99);
  api_json_close(out, '}');
  api_json_member_number(out, "diagonal", report->diagonal);
  api_json_member_number(out, "min_area_ratio", report->min_area_ratio);
}
