/* The generated table of the studio's files; only studio.c reads it. */
#ifndef ORB_STUDIO_TABLE_H
#define ORB_STUDIO_TABLE_H

#include "studio/file.h"

extern const orb_studio_file orb_studio_table[];
extern const size_t orb_studio_count;

#endif
