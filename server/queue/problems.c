/* The problems of jobs that ended because processes died. */
#include "api/problem.h"
#include "queue/internal.h"

void crash_problem(api_text *text) {
  api_problem problem = {0};
  api_refuse(
      &problem, "crashed",
      "The daemon crashed %d times while this job ran alone; the job is not retried. Please report this as a bug, "
      "with its meshes.",
      CRASHES_MOST);
  api_problem_write(&problem, text);
  api_problem_free(&problem);
}
