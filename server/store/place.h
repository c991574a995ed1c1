/* Ties together a data folder, its catalogue and its objects.
 *
 * The catalogue of a data folder is a file of the folder, in SQLite, or a database in PostgreSQL. The folder remembers
 * the latter in the file catalogue.postgresql, so that no daemon takes its objects for those of another catalogue,
 * which would not name them. In the same way the file objects.s3 remembers that the objects are in a bucket of S3, and
 * a bucket remembers its catalogue. */
#ifndef ORB_STORE_PLACE_H
#define ORB_STORE_PLACE_H

#include "config.h"
#include "store/catalogue.h"
#include "store/objects.h"

/* url: of a database in PostgreSQL; NULL: SQLite. STORE_UNFIT: the two do not belong together, the database cannot be
 * written, its schema is newer than this program, or it refuses the credentials, or a restore into the folder has not
 * ended; nothing was written, and the log says what is wrong. shared: several nodes use the database, as they do where
 * objects are in a bucket. */
store_result catalogue_open_among(const char *data, const char *url, int shared, catalogue **out);

/* The mark that ties them together: a hash of the catalogue's secret. It is in these two files of the data folder and
 * in the bucket.
 */
enum { PLACE_MARK = 2 * CATALOGUE_SECRET + 1 };
extern const char place_catalogue[], place_objects[];
void place_hash(const unsigned char secret[CATALOGUE_SECRET], char out[PLACE_MARK]);
/* name: of the file. out: "" where there is none. */
store_result place_read_mark(const char *data, const char *name, char out[PLACE_MARK]);
store_result place_write_mark(const char *data, const char *name, const char mark[PLACE_MARK]);
/* The names of a catalogue that a backup or a restore makes, until all that it names is there, and of the file that
 * marks the folder of a backup. */
extern const char place_new_catalogue[], place_backup_mark[];
/* Whether the folder has an entry of this name. */
int place_has(const char *data, const char *name);
/* Whether a restore, or the first backup, into the folder has not ended: it has a new catalogue only. */
int place_is_unfinished(const char *data);
/* Whether the data folder has objects in files, and whether it has a catalogue in SQLite. */
int place_has_files(const char *data);
int place_has_catalogue(const char *data);
/* Whether the folder has a catalogue, knows one in PostgreSQL, or is being filled with one. */
int place_is_data(const char *data);
/* What a bucket's owner begins with while `orbmorphd migrate` fills the bucket. */
#define PLACE_MIGRATING "migrating-"

typedef struct store_place {
  const char *data;
  const char *catalogue; /* as above */
  bucket_options bucket; /* url NULL: objects are files of the data folder */
  uint64_t cache;        /* bytes of the folder that caches objects of the bucket */
} store_place;

/* What the options say; points into them. */
store_place store_place_of(const config *options);
/* Opens both. STORE_UNFIT: as above; also if the objects belong to another catalogue, or the bucket does not exist or
 * refuses access. On failure the caller closes what was opened. */
store_result stores_open(const store_place *place, objects **store, catalogue **cat);

#endif
