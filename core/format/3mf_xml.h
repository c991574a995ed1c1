/* The XML files of a 3MF package: reads them into an orb_3mf_model. */
#ifndef ORB_FORMAT_3MF_XML_H
#define ORB_FORMAT_3MF_XML_H

#include "format/3mf_model.h"
#include "format/zip.h"

enum { ORB_3MF_PARTS_MAX = 1024, ORB_3MF_PATH_MAX = 256 };

/* An XML file of the package that has objects. */
typedef struct orb_3mf_part_file {
  char path[ORB_3MF_PATH_MAX]; /* in lower case, without the leading slash */
  orb_zip_entry entry;
} orb_3mf_part_file;

typedef struct orb_3mf_reader {
  orb_3mf_model model;
  orb_build *build; /* for what is noted as dropped */
  orb_zip zip;
  uint64_t allowance; /* bytes that files may still unpack to */
  orb_3mf_part_file *parts;
  int32_t *slots; /* a hash table of the parts by path: number + 1, 0: free */
  int32_t part_count, last_part;
  int64_t part_room;
  unsigned noted; /* bits of what has been noted as dropped */
} orb_3mf_reader;

void orb_3mf_reader_free(orb_3mf_reader *r, orb_context *ctx);

/* The number of the part at a path; one that is new is added. line: of the XML that names it, 0: none does. */
ORB_MUST_CHECK orb_status orb_3mf_part(orb_3mf_reader *r, const char *path, int64_t line, int32_t *out);

/* Adds the part that the relations of the package name as its model, if they do. */
ORB_MUST_CHECK orb_status orb_3mf_read_relations(orb_3mf_reader *r, const orb_zip_entry *entry);

/* Reads the objects of a part and, if it is the first, the build. */
ORB_MUST_CHECK orb_status orb_3mf_read_part(orb_3mf_reader *r, int32_t part);

#endif
