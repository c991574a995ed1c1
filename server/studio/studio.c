/* Finds a file of the studio in the generated table, which is sorted by path (see embed.cmake). */
#include "studio/studio.h"

#include <stdlib.h>
#include <string.h>

static const char missing_page[] =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>orbmorph</title>"
    "<h1>orbmorph</h1><p>This daemon was built without the studio. To include it, run "
    "<code>client/web/build.sh</code> "
    "(Node 18, npm), then build the daemon again. The HTTP API is complete: see "
    "<a href=\"/openapi.json\">openapi.json</a>.</p></html>\n";

static const orb_studio_file missing = {
    "/",        "text/html; charset=utf-8",          "\"studio-not-built\"",
    "no-cache", (const unsigned char *)missing_page, sizeof missing_page - 1,
};

static int compare(const void *key, const void *entry) {
  return strcmp(key, ((const orb_studio_file *)entry)->path);
}

const orb_studio_file *orb_studio_find(const char *path) {
  if (orb_studio_count == 0) {
    return strcmp(path, "/") == 0 ? &missing : NULL;
  }
  return bsearch(path, orb_studio_table, orb_studio_count, sizeof orb_studio_table[0], compare);
}
