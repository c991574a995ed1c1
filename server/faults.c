#include "faults.h"

#ifdef ORB_FAULTS
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static atomic_long passes;

void fault_point(const char *name) {
  const char *plan = getenv("ORBMORPH_FAULT");
  size_t n = strlen(name);
  if (!plan || strncmp(plan, "kill:", 5) != 0 || strncmp(plan + 5, name, n) != 0 || plan[5 + n] != ':') {
    return;
  }
  char *end;
  long nth = strtol(plan + 5 + n + 1, &end, 10), now = atomic_fetch_add(&passes, 1) + 1;
  if (now == nth || (*end == '+' && now > nth)) {
    kill(getpid(), SIGKILL);
  }
}
#else
typedef int faults_none;
#endif
