/* A set of 64-bit hashes. Any thread. */
#ifndef ORB_STORE_MARKS_H
#define ORB_STORE_MARKS_H

#include <stdint.h>

typedef struct marks marks;

marks *marks_create(void); /* NULL: out of memory */
void marks_destroy(marks *m);
void marks_add(marks *m, uint64_t hash); /* if out of memory, the set does not change */
int marks_have(marks *m, uint64_t hash);

#endif
