#include "faults.h"

#ifdef ORB_FAULTS
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static atomic_int passes[2];

static int counts(const char *name, int kill) {
  const char *plan = getenv("ORBMORPH_FAULT");
  if (!plan) {
    return 0;
  }
  if ((strncmp(plan, "kill:", 5) == 0) != kill) {
    return 0;
  }
  plan += kill ? 5 : 0;
  size_t n = strlen(name);
  if (strncmp(plan, name, n) != 0 || plan[n] != ':') {
    return 0;
  }
  char *end;
  long nth = strtol(plan + n + 1, &end, 10);
  int now = atomic_fetch_add(&passes[kill], 1) + 1;
  return now == nth || (*end == '+' && now > nth);
}

int fault_hits(const char *kind) {
  return counts(kind, 0);
}

void fault_point(const char *name) {
  if (counts(name, 1)) {
    kill(getpid(), SIGKILL);
  }
}
#else
typedef int faults_none;
#endif
