/* Runs a function for many numbers on several threads of its own, for work that mostly waits: requests to S3, reads. */
#ifndef ORB_STORE_SEVERAL_H
#define ORB_STORE_SEVERAL_H

/* S3 answers one request in some 20 ms, and many at once. */
enum { SEVERAL_THREADS = 8 };

/* Calls one(user, k) for k from 0 to count − 1, each once, and returns when all calls have ended. The calls start in
 * this order, on up to SEVERAL_THREADS threads, of which the caller is one. After a call that returns 0 no further one
 * starts. */
void several_run(int count, int (*one)(void *user, int k), void *user);

#endif
