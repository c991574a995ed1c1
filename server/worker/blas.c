#include "worker/blas.h"

#include <dlfcn.h>
#include <string.h>

/* Found at run time: which library serves LAPACK is the machine's choice. */
static void set_one(const char *symbol) {
  void (*set)(int);
  void *found = dlsym(RTLD_DEFAULT, symbol);
  if (found) {
    memcpy(&set, &found, sizeof set);
    set(1);
  }
}

void blas_use_one_thread(void) {
  set_one("openblas_set_num_threads");
  set_one("omp_set_num_threads");
}
