/* Objects as files of a data folder. objects.h has the contract. No state: root is the data folder. */
#ifndef ORB_STORE_OBJECT_FILES_H
#define ORB_STORE_OBJECT_FILES_H

#include <limits.h>
#include <stdint.h>

#include "store/result.h"

typedef enum object_kind {
  OBJECT_MESH,
  OBJECT_SPHERE,
  OBJECT_ASSET,
  OBJECT_PLACES,
  OBJECT_SPHERES,   /* aligned spheres of a supermesh, see store/spheres.h */
  OBJECT_QUANTIZED, /* profiles of an asset */
  OBJECT_MESHOPT,
  OBJECT_ALIGNMENT, /* see store/alignments.h */
  OBJECT_KINDS
} object_kind;

/* The name of the folder of a kind, in the data folder and in a bucket. */
const char *object_folder(object_kind kind);

/* Logs errno and what could not be done with a path; STORE_FULL if the disk is full, STORE_ERROR otherwise. */
store_result file_failed(const char *what, const char *path);
/* Makes a folder unless it exists. */
store_result file_make_folder(const char *path);

/* Makes the folders of the data folder: all of them, or only those of a store whose objects lie elsewhere. */
store_result object_files_make(const char *root);
store_result object_files_make_top(const char *root);
/* Deletes temporary files. */
void object_files_sweep(const char *root);

void object_file_path(const char *root, object_kind kind, const char *id, char out[PATH_MAX]);
store_result object_file_make_folder(const char *root, object_kind kind, const char *id);
/* Turns a temporary file, open as fd, into the object. It has no other name afterwards, even on failure. */
store_result object_file_publish(const char *root, object_kind kind, const char *id, int fd, const char *from);
store_result object_file_read(const char *root, object_kind kind, const char *id, int *fd, uint64_t *size);
store_result object_file_look(const char *root, object_kind kind, const char *id);
/* STORE_OK also if there is no such object. */
store_result object_file_delete(const char *root, object_kind kind, const char *id);
/* Moves the file that was read through fd to the path `aside`, if it still has the name: it may have been replaced, or
 * moved by another thread, since it was read. STORE_NOT_FOUND: no file has the name now. *moved: this call moved it. */
store_result object_file_quarantine(const char *root, object_kind kind, const char *id, int fd, const char *aside,
                                    int *moved);
store_result object_file_set_aside(const char *root, object_kind kind, const char *id, const char *aside);
/* As objects_purge_lost() and objects_each(). */
long object_files_purge_lost(const char *root, int64_t before);
store_result object_files_each(const char *root,
                               void (*each)(void *user, object_kind kind, const char *id, uint64_t size), void *user);

#endif
