/* Results of all functions of the store. */
#ifndef ORB_STORE_RESULT_H
#define ORB_STORE_RESULT_H

typedef enum store_result {
  STORE_OK = 0,
  STORE_NOT_FOUND,
  STORE_CONFLICT, /* a condition no longer holds */
  STORE_FULL,     /* no space left */
  STORE_ERROR,    /* input/output error; logged */
  STORE_LOST,     /* objects may have been deleted since they were published: objects_hold_again() */
  STORE_AWAY,     /* S3 does not answer, or refuses; the store asks until it is back; logged */
  STORE_UNFIT,    /* only of opening: the configuration is wrong, see store/place.h; logged */
} store_result;

#endif
