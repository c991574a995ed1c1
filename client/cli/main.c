#include <stdio.h>

int main(void) {
  return puts("orbmorph 1.0.0") < 0;
}
