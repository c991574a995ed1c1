#include <stdio.h>
#include <string.h>

#include "admin/kinds.h"
#include "store/crashes.h"

static int apply(catalogue *cat, const char *line, api_text *reply) {
  char verb[8], name[65];
  if (sscanf(line, "crash %7s %64s", verb, name) != 2) {
    api_text_add(reply, "unknown command\n");
    return 2;
  }
  if (strcmp(verb, "list") == 0) {
    return catalogue_crash_list(cat, reply) < 0;
  }
  return admin_answer(catalogue_crash_clear(cat, name), &admin_crash, name, "", reply);
}

const admin_kind admin_crash = {
    .name = "crash",
    .usage =
        "  orbmorphd crash list | crash clear NAME\n"
        "                                 work whose processes died; NAME: the beginning of its key or of its\n"
        "                                 mesh, or the tenant: after three deaths it is refused until cleared\n",
    .takes_ids = 1,
    .verbs = {{"list", 0, 0, 0}, {"clear", 1, 0, 0}},
    .apply = apply,
};
