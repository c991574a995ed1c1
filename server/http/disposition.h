/* How downloads are named. */
#ifndef ORB_HTTP_DISPOSITION_H
#define ORB_HTTP_DISPOSITION_H

enum {
  DISPOSITION_NAME = 160,                       /* bytes of a name, with its end */
  DISPOSITION_SIZE = 64 + 4 * DISPOSITION_NAME, /* of the header: the name twice, once percent-encoded */
};

/* The name of an asset: those of its shapes, such as dog-giraffe.glb, in UTF-8. description: the JSON of the supermesh.
 * Characters that a file system may refuse become "_". */
void disposition_name(const char *description, char out[DISPOSITION_NAME]);

/* The name of an uploaded file: that of its mesh, and its format, such as dog.obj. description: the JSON of the mesh.
 */
void disposition_mesh_name(const char *description, const char *format, char out[DISPOSITION_NAME]);

/* The value of Content-Disposition (RFC 6266) for a name in UTF-8. A name that needs more than letters, digits, "-",
 * "_" and "." of ASCII comes twice: as filename with "_" for each other character, and as filename* (RFC 8187). */
void disposition_write(const char *name, char out[DISPOSITION_SIZE]);

#endif
