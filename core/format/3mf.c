/* 3MF packages: ZIP archives whose XML has objects of vertices and triangles, and a build that places them. The reader
 * takes the core specification, the paths of the production extension, and the groups of colours of the materials
 * extension. It notes all other materials as dropped. Coordinates are converted to millimetres. Vertices are numbered
 * as they are placed: item by item of the build, components in their order, each mesh in file order.
 *
 * zip.c unpacks, xml.c parses, 3mf_xml.c reads the elements, 3mf_model.c holds them, 3mf_place.c makes the mesh. */
#include <string.h>

#include "base/check.h"
#include "base/error.h"
#include "format/3mf_xml.h"
#include "format/readers.h"

enum {
  RATIO_MAX = 50, /* bytes that all XML may unpack to, for a byte of the archive: meshes have 4 to 30 */
  RATIO_FREE = 1 << 20
};

/* Whether the name of a file ends in `end`, in letters of either case. */
static int ends_in(const orb_zip_entry *entry, const char *end) {
  size_t length = strlen(end);
  for (size_t i = 0; i < length; i++) {
    unsigned char c = entry->name_length < length ? 0 : entry->name[entry->name_length - length + i];
    if ((c >= 'A' && c <= 'Z' ? c + 32 : c) != (unsigned char)end[i]) {
      return 0;
    }
  }
  return 1;
}

orb_certainty orb_3mf_is(const unsigned char *bytes, size_t size) {
  orb_zip zip;
  orb_zip_entry entry;
  size_t at = 0;
  if (size < 4 || memcmp(bytes, "PK\3\4", 4) != 0 || !orb_zip_open(bytes, size, &zip)) {
    return ORB_NO;
  }
  while (orb_zip_next(&zip, &at, &entry)) {
    if (ends_in(&entry, ".model")) {
      return ORB_SURE;
    }
  }
  return ORB_NO;
}

/* Adds the part that the package's relations name as its model, or else the one at the usual path. */
static orb_status find_root(orb_3mf_reader *r) {
  orb_zip_entry entry;
  size_t at = 0;
  while (orb_zip_next(&r->zip, &at, &entry)) {
    if (entry.name_length == strlen("_rels/.rels") && ends_in(&entry, "_rels/.rels")) {
      ORB_TRY(orb_3mf_read_relations(r, &entry));
      break;
    }
  }
  int32_t part;
  return r->part_count > 0 ? ORB_OK : orb_3mf_part(r, "3d/3dmodel.model", 0, &part);
}

orb_status orb_3mf_read(orb_context *ctx, const unsigned char *bytes, size_t size, orb_mesh *out) {
  orb_3mf_reader r = {.allowance = (uint64_t)size * RATIO_MAX + RATIO_FREE};
  orb_build build;
  orb_build_init(&build, ctx);
  orb_3mf_model_init(&r.model, ctx, size);
  r.build = &build;
  orb_status status = ORB_OK;
  if (!orb_zip_open(bytes, size, &r.zip)) {
    status = orb_build_malformed(ctx, 0, (int64_t)size,
                                 "The bytes are not a ZIP archive, as a 3MF file is, or the archive is cut short.");
    goto done;
  }
  ORB_GO(status, find_root(&r), done);
  for (int32_t part = 0; part < r.part_count; part++) { /* reading one may add more */
    ORB_GO(status, orb_3mf_read_part(&r, part), done);
  }
  ORB_GO(status, orb_3mf_place(&r.model, &build), done);
  orb_3mf_model_free(&r.model);
  status = orb_build_finish(&build, 0, (int64_t)size, out);

done:
  orb_3mf_model_free(&r.model);
  orb_3mf_reader_free(&r, ctx);
  orb_build_free(&build);
  return status;
}
