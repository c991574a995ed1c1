/* The room that a tenant's quota of derived bytes leaves for a new job. */
#ifndef ORB_HTTP_ROOM_H
#define ORB_HTTP_ROOM_H

#include "http/http.h"

typedef struct room {
  int64_t quota, used; /* bytes; quota 0: no limit */
  int64_t left;        /* for queue_request.room */
} room;

/* STORE_ERROR: what the tenant uses cannot be read. */
store_result room_measure(const request *r, room *out);
/* Deletes kept alignments of the tenant, oldest first, until `bytes` are free or none is left. 1 if it deleted any. */
int room_make(const request *r, int64_t bytes);
/* queue_submit() found no room: answers with the problem. needs: the bytes of the job. */
void room_refuse(request *r, const room *space, int64_t needs);

#endif
