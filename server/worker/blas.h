/* The linear algebra library's own threads. */
#ifndef SERVER_WORKER_BLAS_H
#define SERVER_WORKER_BLAS_H

/* Bids it run in the caller: `workers` alone says how many cores are used, whatever OMP_* and OPENBLAS_* say, and sums
 * do not depend on how many the machine has. Before any job. */
void blas_use_one_thread(void);

#endif
