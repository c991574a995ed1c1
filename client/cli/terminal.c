#include "terminal.h"

#include <stdarg.h>
#include <string.h>

enum { BAR_WIDTH = 32 };

void cli_error(const cli *c, const char *format, ...) {
  va_list list;
  if (c->bar_drawn) {
    fputs("\r\033[K", stderr);
  }
  fputs("orbmorph: ", stderr);
  va_start(list, format);
  vfprintf(stderr, format, list);
  va_end(list);
  fputc('\n', stderr);
}

void cli_note(const cli *c, const char *format, ...) {
  if (c->quiet || c->json) { /* standard error then has nothing but the JSON of a problem */
    return;
  }
  va_list list;
  if (c->bar_drawn) {
    fputs("\r\033[K", stderr);
  }
  va_start(list, format);
  vfprintf(stderr, format, list);
  va_end(list);
  fputc('\n', stderr);
}

void cli_bar(cli *c, const char *label, double fraction) {
  if (!c->bar) {
    return;
  }
  if (!(fraction >= 0 && fraction <= 1)) {
    fraction = 0;
  }
  int full = (int)(fraction * BAR_WIDTH + 0.5), percent = (int)(100 * fraction + 0.5);
  if (c->bar_drawn && percent == c->bar_percent && !strncmp(label, c->bar_label, sizeof c->bar_label - 1)) {
    return;
  }
  c->bar_percent = percent;
  snprintf(c->bar_label, sizeof c->bar_label, "%s", label);
  char line[BAR_WIDTH + 1];
  for (int i = 0; i < BAR_WIDTH; i++) {
    line[i] = i < full ? '#' : '.';
  }
  line[BAR_WIDTH] = 0;
  fprintf(stderr, "\r\033[K%-24.24s [%s] %3d %%", label, line, percent);
  fflush(stderr);
  c->bar_drawn = 1;
}

void cli_bar_end(cli *c) {
  if (c->bar_drawn) {
    fputs("\r\033[K", stderr);
  }
  c->bar_drawn = 0;
}
