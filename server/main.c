#include <stdio.h>

#include "orbmorph/status.h"

int main(void) {
  return puts(ORB_ENGINE) < 0;
}
