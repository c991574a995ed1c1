/* Which catalogue belongs to a data folder: its own, in SQLite, or one in PostgreSQL. The folder remembers the latter
 * in the file catalogue.postgresql, so that its objects are never taken for those of another catalogue, which would not
 * name them. */
#ifndef ORB_STORE_PLACE_H
#define ORB_STORE_PLACE_H

#include "store/catalogue.h"

/* url: of a database in PostgreSQL; NULL: SQLite. STORE_UNFIT: the two do not belong together, the database cannot be
 * written, its schema is newer than this program, or it refuses the credentials; nothing was written, and the log says
 * what is wrong. */
store_result catalogue_open_at(const char *data, const char *url, catalogue **out);

#endif
